"""Scores: one number a sample, higher where a collision is more likely."""
