"""Faults of samples."""
