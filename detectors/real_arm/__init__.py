"""A real arm: from collision-free logs to a calibrated robot file and a detector."""
