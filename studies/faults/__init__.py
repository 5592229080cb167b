"""Faults of samples: which are seen, how soon, and what they cost."""
