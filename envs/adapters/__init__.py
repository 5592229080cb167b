"""Wrappers of environments, and interfaces for users of other libraries."""
