"""The episode generator: motions, the simulation loop, injected collisions and their truth."""
