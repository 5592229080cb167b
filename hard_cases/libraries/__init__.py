"""Adapters of libraries, one per file."""
