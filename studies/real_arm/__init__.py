"""The study of logs of a real arm."""
