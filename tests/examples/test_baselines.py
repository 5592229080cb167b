"""Standing still is never a success, hurry is punished, care is rewarded, policies load."""

import importlib.util
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from tauguard.envs.policies import MlpPolicy

SOURCE = Path(__file__).parents[2] / "examples" / "baselines.py"
SPEC = importlib.util.spec_from_file_location("baselines", SOURCE)
BASELINES = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(BASELINES)
#: Seeds that nothing was developed on.
FIRST = 70_000


@pytest.mark.parametrize("task", BASELINES.TASKS)
def test_standing_still_does_not_succeed(task):
    assert BASELINES.play(task, "zero", 3, FIRST)[:, 0].sum() == 0


def test_the_path_of_react_is_for_the_gentle():
    gentle = BASELINES.play("React-v1", "power and force", 8, FIRST)
    fast = BASELINES.play("React-v1", "fast", 8, FIRST)
    assert gentle[:, 0].mean() >= 0.8
    assert fast[:, 0].mean() <= 0.2
    assert gentle[:, 3].max() < 1 < fast[:, 3].max()  # force over its limit
    assert gentle[:, 2].mean() > fast[:, 2].mean() + 1


def test_straight_paths_of_two_arms_meet_and_cost():
    rows = BASELINES.play("TwoArms-v1", "fast", 4, FIRST)
    assert rows[:, 1].mean() > 1
    assert (rows[:, 4] > 0).mean() >= 0.5


def test_an_arm_that_yields_presses_less_than_one_that_does_not():
    stiff, soft = (BASELINES.play("TwoArms-v1", name, 6, FIRST) for name in ("fast", "admittance"))
    assert soft[:, 4].mean() < 0.8 * stiff[:, 4].mean()  # N s
    assert soft[:, 1].sum() > 0


@pytest.mark.parametrize("task", ["Reach-v0", "React-v1", "TwoArms-v1"])
def test_the_shipped_policies_do_more_than_random(task):
    random = BASELINES.play(task, "random", 4, FIRST)[:, 2].mean()
    for name in ("ppo", "ppo, budget"):
        assert BASELINES.play(task, name, 4, FIRST)[:, 2].mean() > random + 0.2


@pytest.mark.parametrize("file", sorted(BASELINES.POLICIES.glob("*.npz")), ids=lambda f: f.stem)
def test_the_shipped_policies_say_where_they_were_trained(file):
    policy = MlpPolicy.load(file)
    env = gym.make(**policy.environment)
    assert policy.environment["id"].endswith(file.stem.removesuffix("-budget"))
    assert env.action_space.contains(policy(env.reset(seed=0)[0]).astype(np.float32))


def test_a_policy_is_what_was_saved_and_refuses_other_observations(tmp_path):
    rng = np.random.default_rng(0)
    layers = [rng.normal(size=shape) for shape in ((8, 5), (3, 8))]
    biases = [rng.normal(size=n) for n in (8, 3)]
    policy = MlpPolicy(rng.normal(size=5), np.full(5, 2.0), tuple(layers), tuple(biases))
    policy = replace(policy, environment={"id": "tauguard:tauguard/Reach-v0", "control_rate": 20.0})
    policy.save(tmp_path / "p.npz")
    again, seen = MlpPolicy.load(tmp_path / "p.npz"), rng.normal(size=(4, 5))
    hidden = np.tanh((seen - policy.mean) / 2 @ layers[0].T + biases[0])
    wanted = np.clip(hidden @ layers[1].T + biases[1], -1, 1)
    assert again(seen) == pytest.approx(wanted, abs=1e-5)
    assert repr(again) == "MlpPolicy(5 -> 8 -> 3)"
    assert again.environment == policy.environment
    with pytest.raises(ValueError, match="expects 5"):
        again(np.zeros(6))
    for text in ("[]", "{", "1"):
        np.savez(tmp_path / "bad.npz", mean=np.zeros(5), environment=text)
        with pytest.raises(ValueError, match="expected a policy"):
            MlpPolicy.load(tmp_path / "bad.npz")
    np.savez(tmp_path / "bad.npz", mean=np.zeros(5), weight0=np.zeros((3, 4)), bias0=np.zeros(3))
    with pytest.raises(ValueError, match="do not fit"):
        MlpPolicy.load(tmp_path / "bad.npz")
    (tmp_path / "no.npz").write_bytes(b"no archive")
    with pytest.raises(ValueError, match="expected a policy"):
        MlpPolicy.load(tmp_path / "no.npz")
