"""Momentum observer, velocity fusion, and the estimator of payload and friction errors."""
