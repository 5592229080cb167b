"""Datasets for other libraries: what they read, from what is there."""
