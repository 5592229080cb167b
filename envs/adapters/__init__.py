"""Wrappers of environments, and interfaces of other libraries."""
