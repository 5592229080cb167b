"""Whether a sample can be believed."""
