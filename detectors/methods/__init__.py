"""One file for each detection method."""
