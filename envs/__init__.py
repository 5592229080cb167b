"""How it runs: the simulation loop, motions, injected collisions and environments."""
