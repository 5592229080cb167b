"""Scores: one number per sample, higher if a collision is more likely."""
