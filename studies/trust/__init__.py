"""What keeps working when files, disks, processes and hours are bad."""
