"""Momentum observer, features, collision detectors, event matching and metrics."""
