"""A simulation's native memory goes with it, not when Python next looks for cycles."""

import gc
import weakref

import pytest

from tauguard.envs import CollisionPlan, Episode, Simulation


@pytest.mark.parametrize("kind", ["none", "strike", "clamp", "pulse"])
def test_a_simulation_is_in_no_cycle(kind):
    plans = () if kind == "none" else (CollisionPlan(kind, time=0.5, link=4),)
    simulation = Simulation(Episode(3, 1.5, 50.0, collisions=plans))
    simulation.run()
    parts = simulation, simulation.scene, simulation.loop, simulation.striking
    alive = [weakref.ref(part) for part in parts]
    gc.disable()
    try:
        del simulation, parts
        assert [ref() for ref in alive] == [None] * len(alive)
    finally:
        gc.enable()
