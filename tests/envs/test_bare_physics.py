"""An environment beside MuJoCo's own loops of the same motion, and reactions beside none."""

import numpy as np
import pytest

from oracles.bare_physics import batched, reach, recorded
from oracles.reaction_swings import swing


def test_rollout_of_the_recorded_forces_makes_the_same_motion():
    env = reach(0)
    actions = np.random.default_rng(0).uniform(-0.5, 0.5, (60, 6)).astype(np.float32)
    forces, error = recorded(env, actions, 0)
    assert forces.shape[0] == 600
    assert error == 0


def test_copies_in_mujocos_batch_move_as_one_does():
    assert batched(0, 4, 3, 2)[1] == 0


@pytest.mark.parametrize("speed", [0.25, 0.5, 1.0])
@pytest.mark.parametrize("detector", [None, "observer"])
def test_stopping_presses_less_than_no_reaction(speed, detector):
    stop, none = (
        swing(speed, detector, name, 0, 0)["peak_force_N"] for name in ("stop0", "continue")
    )
    assert stop < none


def test_a_retraction_ends_behind_the_contact_and_a_stop_does_not():
    ends = [swing(0.5, None, name, 0, 0)["end_m"] for name in ("retract", "stop2", "continue")]
    assert ends[0] < -0.02 < ends[1] < ends[2]
