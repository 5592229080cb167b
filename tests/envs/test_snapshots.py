"""Snapshots: the same actions after them give the same bits."""

import copy
import pickle
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

from tauguard.datasets.plans import free_episodes, struck_episodes
from tauguard.detectors import ArmModel, CollisionAlarm, RobotNumbers, SrqSvr
from tauguard.detectors.alarms.training import train
from tauguard.envs import simulate
from tauguard.models import cura6, cura6_drive, pin_model

CASES = {
    "Reach-v0": {"detector": "observer", "control": "cartesian", "noise": True},
    "React-v1": {"mismatch": 3},
    "TwoArms-v1": {},
    "ClothReach-v1": {"checkers": ()},
}


def played(env, actions):
    rows = []
    for action in actions:
        seen, reward, _, _, info = env.step(action)
        parts = [seen, [reward, info["force"], info["alarm"]], info["tau_ext"], info["residual"]]
        rows.append(np.concatenate([np.ravel(part) for part in parts]).astype(float))
    return np.array(rows)


@pytest.mark.parametrize("name", CASES)
def test_a_snapshot_goes_on_with_the_same_bits(name):
    env = gym.make(f"tauguard/{name}", **CASES[name]).unwrapped
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1, 1, (30, *env.action_space.shape))
    env.reset(seed=1)
    played(env, actions[:12])
    state = env.get_state()
    twin, stored = copy.deepcopy(env), pickle.loads(pickle.dumps(env))
    expected = played(env, actions[12:])
    env.set_state(state)
    np.testing.assert_array_equal(played(env, actions[12:]), expected)
    for other in (twin, stored):
        np.testing.assert_array_equal(played(other, actions[12:]), expected)


class Sums:
    """A method of another's whose score depends on all samples."""

    name, dt, settle = "sums", 1e-3, 0.0

    def __init__(self):
        numbers = RobotNumbers.from_pin(pin_model(cura6.arm_xml()))
        self.arm = ArmModel(numbers, cura6_drive().gain, noise=np.ones(6))

    def scores(self, trace):
        return np.cumsum(np.abs(trace.qd).sum(axis=1))

    def stream(self):
        return Sum()


class Sum:
    def __init__(self):
        self.total = 0.0

    def step(self, q, qd, current, dt=None):
        self.total += float(np.abs(qd).sum())
        return self.total


@pytest.fixture(scope="module")
def detectors():
    episodes = free_episodes(5, 3, 10.0, (30.0, 60.0), (0.0,), None)
    episodes += struck_episodes(6, 2, 3, (30.0, 60.0), (0.0,), None)
    traces = [simulate(episode) for episode in episodes]
    arm = ArmModel(Sums().arm.robot, cura6_drive().gain)
    checked = train(SrqSvr(windows=200, mined=50), traces, arm, 60.0, folds=1)
    unchecked = replace(checked, inputs=None)
    return {"own": CollisionAlarm(Sums(), 1700.0), "kernel": unchecked, "checked": checked}


@pytest.mark.parametrize("kind", ["own", "kernel", "checked"])
def test_a_snapshot_with_a_trained_detector_goes_on_with_the_same_bits(kind, detectors):
    env = gym.make("tauguard/Reach-v0", detector=detectors[kind], noise=True).unwrapped
    actions = np.random.default_rng(0).uniform(-1, 1, (60, *env.action_space.shape))
    env.reset(seed=1)
    played(env, actions[:30])
    state = env.get_state()
    twin, stored = copy.deepcopy(env), pickle.loads(pickle.dumps(state))
    expected = played(env, actions[30:])
    for restored in (state, state, stored):  # a state can be restored more than once
        env.set_state(restored)
        np.testing.assert_array_equal(played(env, actions[30:]), expected)
    np.testing.assert_array_equal(played(twin, actions[30:]), expected)
    if kind == "own":
        alarms = expected[:, env.observation_space.shape[0] + 2]
        assert 0 < alarms.sum() < len(alarms)


def test_a_person_goes_on_in_another_environment_from_any_moment():
    # A reach may begin where the body was a step before: a snapshot holds that, too.
    one, other = (gym.make("tauguard/React-v1", obstacles=("person",)).unwrapped for _ in "ab")
    one.reset(seed=3)
    other.reset(seed=4)
    action = np.zeros(one.action_space.shape)
    for _ in range(15):
        other.step(action)
    for _ in range(250):
        other.set_state(one.get_state())
        expected, *_, info = one.step(action)
        seen, *_, own = other.step(action)
        np.testing.assert_array_equal(seen, expected)
        assert own["distance"] == info["distance"]
        np.testing.assert_array_equal(other.get_state()["plant"], one.get_state()["plant"])


def test_a_state_of_another_scene_is_refused():
    one, other = (gym.make(f"tauguard/{n}").unwrapped for n in ("Reach-v0", "React-v1"))
    one.reset(seed=0)
    with pytest.raises(ValueError, match="another scene"):
        other.set_state(one.get_state())


def test_a_state_of_another_arm_or_detector_and_what_is_no_state_are_refused():
    env = gym.make("tauguard/Reach-v0").unwrapped
    env.reset(seed=0)
    state = env.get_state()
    for keywords, said in (
        ({"robot": "cura6-long"}, "another scene"),  # of the same sizes
        ({"detector": "observer"}, "another detector"),
    ):
        other = gym.make("tauguard/Reach-v0", **keywords).unwrapped
        other.reset(seed=1)
        own = other.get_state()
        with pytest.raises(ValueError, match=said):
            other.set_state(state)
        np.testing.assert_array_equal(other.get_state()["physics"], own["physics"])
    for damaged in (None, {}, "state", {k: v for k, v in state.items() if k != "rng"}):
        with pytest.raises(ValueError, match="expected what get_state"):
            env.set_state(damaged)
    env.set_state(state)


def test_a_state_with_numbers_that_no_plant_gives_is_refused_and_changes_nothing():
    env = gym.make("tauguard/React-v1", obstacles=("person",)).unwrapped
    env.reset(seed=3)
    still = np.zeros((1, *env.action_space.shape))
    played(env, still)
    state = env.get_state()
    strange, plant = (np.nan, np.inf, 1e300, -3.0, 0.5, 2.0**40), state["plant"]
    refused = []
    for k in range(len(plant)):
        state["plant"] = plant.copy()
        state["plant"][k] = strange[(k + k // len(strange)) % len(strange)]
        try:
            env.set_state(state)
        except ValueError:
            refused.append(k)
            np.testing.assert_array_equal(env.get_state()["plant"], plant)
        else:
            played(env, still)
        env.set_state(state | {"plant": plant})
    # What chooses or counts: two reaches, a walk, the link and region, switches of the drives.
    assert len(refused) >= 10


def test_unknown_options_are_refused():
    env = gym.make("tauguard/Reach-v0").unwrapped
    with pytest.raises(ValueError, match="unknown 'bogus'"):
        env.reset(options={"bogus": 1})
    envs = gym.make_vec("tauguard/Reach-v0", num_envs=2)
    with pytest.raises(ValueError, match=r"bogus.*reset_mask"):
        envs.reset(options={"bogus": 1})
