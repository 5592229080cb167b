"""The cost of a step: impulse beyond the limits, of what the arm does itself, at any rate."""

import gymnasium as gym
import numpy as np
import pytest

from oracles.contact_forces import contact_forces
from tauguard.models import BodyProxy, SceneObject, Shape

REACH = "tauguard:tauguard/Reach-v0"
#: Limit of the block below [N].
LIMIT = 20.0


def sinking(rate):
    """An environment in which the tool begins above a block."""
    bare = gym.make(REACH, obstacles=()).unwrapped
    bare.reset(seed=0)
    x, y, z = bare.batch.observation[0, 18:21]
    block = SceneObject(
        "block",
        (Shape("box", (0.2, 0.2, 0.05)),),
        position=(x, y, z - 0.2),
        quasi_static_limit=LIMIT,
    )
    env = gym.make(REACH, control_rate=rate, obstacles=(), objects=(block,))
    env.reset(seed=0)
    return env.unwrapped


def force_on_block(env):
    """By MuJoCo's own contacts [N]."""
    return float(np.linalg.norm(sum(force for _, force in contact_forces(env.model, env.data))))


def press(rate, seconds=1.4):
    """The shoulder turns down onto the block; cost of each action, and MuJoCo's forces."""
    env = sinking(rate)
    action = np.array([0, 0.4, 0, 0, 0, 0])
    costs, forces, whole = [], [], []
    for _ in range(round(seconds * rate)):
        info = env.step(action)[4]
        costs.append(info["cost"])
        whole.append(info["excess"])
        forces.append(force_on_block(env))
    assert info["cost_sum"] == pytest.approx(sum(costs))
    return info["cost_sum"], np.array(costs), np.array(forces), np.array(whole)


def test_the_cost_is_the_impulse_beyond_the_limit_at_any_control_rate():
    cost, costs, forces, whole = press(1000)
    assert forces.max() > 5 * LIMIT
    truth = 1e-3 * np.maximum(forces - LIMIT, 0)
    np.testing.assert_allclose(whole, truth, rtol=1e-9, atol=1e-12)
    # At the beginning of a touch the arm's advance lags the depth by a part of a step.
    assert (costs <= truth + 1e-9).all()
    assert np.isclose(costs, truth)[truth > 0].mean() > 0.9
    assert cost == pytest.approx(truth.sum(), rel=0.02)
    for rate in (20, 100):
        assert press(rate)[0] == pytest.approx(cost, rel=0.01)


def meet(arm, hand, force=0.0):
    """The first joint turns against a hand's flight [m/s]: cost, peak force, excess, its causes."""
    proxy = BodyProxy("hand", position=(0.0, 0.6, 0.45), direction=(0.0, -1.0, 0.0))
    env = gym.make(REACH, obstacles=(proxy,), control_rate=500).unwrapped
    env.reset(seed=0)
    joint = env.model.joint("hand")
    turn, excess, causes = np.zeros(6), 0.0, set()
    env.data.qpos[joint.qposadr[0]], env.data.qvel[joint.dofadr[0]] = 0.0, hand
    for _ in range(500):
        turn[0] = arm
        info = env.step(turn)[4]
        force, excess = max(force, info["region_force"][0]), excess + info["excess"]
        assert (info["limit_ratio"] > 1) == bool(info["excess_cause"])
        causes |= {info["excess_cause"]} - {""}
        if force and not info["region_force"][0]:
            break
    return info["cost_sum"], force, excess, causes


def test_who_runs_into_an_arm_that_stands_is_not_billed_to_it():
    cost, force, excess, causes = meet(0.0, 4.0)
    assert force > 280
    assert cost == 0
    assert excess > 0.05
    assert causes == {"region"}


def test_an_arm_that_runs_into_somebody_is_billed():
    cost, force, excess, causes = meet(-1.0, 4.0)
    assert force > 280
    assert excess >= cost > 0.1
    assert "arm" in causes
