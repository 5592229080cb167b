"""An arm model from collision-free motion: simulated arms and real ones."""
