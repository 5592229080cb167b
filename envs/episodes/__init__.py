"""The episode generator: motions, injected collisions, the simulation loop, and their truth."""
