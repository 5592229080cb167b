"""NoiseModel of collision-free residuals, windows, and training data from traces."""
