"""What learning libraries see: costs and budgets, pictures, Stable-Baselines3, Minari."""

import ctypes.util
import os
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest

from tauguard.envs.policies import MlpPolicy
from tauguard.envs.wrappers import CameraObservation, CostBudget, CostStep

REACH = "tauguard:tauguard/Reach-v0"


def straight(observation):
    return np.append(np.clip(observation[21:24] / 0.02, -1, 1), np.zeros(3))


def costly(env):
    """Plays straight-line episodes until one has a cost; what each step returned."""
    for seed in range(20):
        observation, _ = env.reset(seed=seed)
        rows = []
        for _ in range(500):
            row = env.step(straight(observation))
            observation = row[0]
            rows.append(row)
            if row[-3] or row[-2]:
                break
        if rows[-1][-1]["cost_sum"] > 0:
            return rows
    raise AssertionError("no episode with a cost")


def test_cost_is_third_of_six_and_sums_up():
    rows = costly(CostStep(gym.make(REACH, control="cartesian"), scale=0.01))
    assert {len(row) for row in rows} == {6}
    assert sum(row[2] for row in rows) == pytest.approx(0.01 * rows[-1][5]["cost_sum"])
    assert all(row[2] == pytest.approx(0.01 * row[5]["cost"]) for row in rows)


def test_a_spent_budget_ends_the_episode():
    rows = costly(CostBudget(gym.make(REACH, control="cartesian"), limit=0.0))
    assert rows[-1][2]
    assert rows[-1][4]["cost_left"] < 0
    assert all(row[4]["cost_left"] >= 0 for row in rows[:-1])
    with pytest.raises(ValueError, match="limit"):
        CostBudget(gym.make(REACH), limit=-1.0)


@pytest.mark.skipif(ctypes.util.find_library("EGL") is None, reason="no EGL library")
def test_pictures_are_part_of_the_observation():
    code = """
import gymnasium, numpy, tauguard, warnings
from gymnasium.utils.env_checker import check_env
from tauguard.envs.wrappers import CameraObservation
env = CameraObservation(gymnasium.make("tauguard/Reach-v0"), height=24, width=32)
seen, _ = env.reset(seed=0)
assert env.observation_space.contains(seen), {k: (v.shape, v.dtype) for k, v in seen.items()}
assert seen["rgb"].shape == (24, 32, 3) and seen["depth"].shape == (24, 32, 1)
assert len(numpy.unique(seen["rgb"].reshape(-1, 3), axis=0)) > 50
depth = seen["depth"][..., 0]
assert 1.5 < depth.min() < 4.0, depth.min()  # the person and the arm, about 3.3 m away
"""
    environment = {**os.environ, "MUJOCO_GL": "egl"}
    out = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment
    )
    if out.returncode and "no picture" in out.stderr:
        pytest.skip("the EGL library cannot draw here")
    assert out.returncode == 0, out.stderr


@pytest.mark.parametrize("keywords", [{"mode": "sound"}, {"height": 0}])
def test_cameras_that_cannot_be(keywords):
    with pytest.raises(ValueError, match="expected"):
        CameraObservation(gym.make(REACH), **keywords)


def test_stable_baselines_sees_the_native_copies():
    pytest.importorskip("stable_baselines3")
    from tauguard.envs.stable_baselines import NativeVecEnv

    envs = NativeVecEnv("tauguard/Reach-v0", 2, max_episode_steps=5, obstacles=())
    envs.seed(3)
    first = envs.reset()
    single = gym.make("tauguard/Reach-v0", max_episode_steps=5, obstacles=())
    expected, _ = single.reset(seed=3)
    assert np.array_equal(first[0], expected)
    action = np.full((2, 6), 0.3, dtype=np.float32)
    for step in range(5):
        seen, rewards, over, infos = envs.step(action)
        expected, reward, *_ = single.step(action[0])
        last = infos[0]["terminal_observation"] if over[0] else seen[0]
        assert np.array_equal(last, expected)
        assert rewards[0] == np.float32(reward)
        assert over.tolist() == [step == 4] * 2
    assert infos[0]["TimeLimit.truncated"]
    keys = {key for key in single.step(action[0])[-1]}
    assert infos[0].keys() == keys | {"terminal_observation", "TimeLimit.truncated"}
    with pytest.raises(AttributeError, match="constructor"):
        envs.set_attr("control", "torque")


@pytest.mark.parametrize("normalised", [False, True])
@pytest.mark.parametrize(
    ("method", "goal"), [("PPO", False), ("SAC", False), ("SAC", True), ("TD3", False)]
)
def test_a_policy_is_the_one_that_was_trained(method, goal, normalised, tmp_path):
    sb3 = pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.vec_env import VecNormalize

    from tauguard.envs.stable_baselines import NativeVecEnv

    envs = NativeVecEnv("tauguard/Reach-v0", 2, goal=goal, obstacles=(), max_episode_steps=20)
    envs = VecNormalize(envs) if normalised else envs
    kind, form = "MultiInputPolicy" if goal else "MlpPolicy", {"net_arch": [8, 8]}
    short = {"n_steps": 16, "batch_size": 16} if method == "PPO" else {"learning_starts": 8}
    model = getattr(sb3, method)(kind, envs, policy_kwargs=form, seed=0, device="cpu", **short)
    model.learn(40)
    if normalised:
        envs.training = False  # the moments stay as they are
    MlpPolicy.from_sb3(model).save(tmp_path / "policy.npz")
    policy, seen = MlpPolicy.load(tmp_path / "policy.npz"), envs.reset()
    raw = envs.get_original_obs() if normalised else seen
    for _ in range(5):
        expected = model.predict(seen, deterministic=True)[0]
        np.testing.assert_allclose(policy(raw), expected, atol=2e-5)  # single precision
        seen, *_ = envs.step(expected)
        raw = envs.get_original_obs() if normalised else seen


def test_hindsight_replay_takes_the_native_copies():
    sb3 = pytest.importorskip("stable_baselines3")
    from tauguard.envs.stable_baselines import NativeVecEnv

    envs = NativeVecEnv("tauguard/Reach-v0", 2, goal=True, obstacles=(), max_episode_steps=10)
    replay = {"replay_buffer_class": sb3.HerReplayBuffer, "learning_starts": 25}
    model = sb3.SAC("MultiInputPolicy", envs, seed=0, device="cpu", batch_size=64, **replay)
    model.learn(60)
    batch = model.replay_buffer.sample(200)
    reached = batch.next_observations["achieved_goal"] - batch.observations["desired_goal"]
    near = np.linalg.norm(reached.numpy(), axis=1) < envs.envs.task.tolerance
    np.testing.assert_array_equal(batch.rewards.numpy()[:, 0], np.where(near, 0.0, -1.0))
    assert near.any()


def test_minari_records_a_policy(tmp_path, monkeypatch):
    minari = pytest.importorskip("minari")
    from tauguard.envs.offline import record_policy

    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    name = "tauguard/reach-straight-v0"
    count = record_policy(
        "tauguard/Reach-v0",
        straight,
        name,
        episodes=2,
        seed=5,
        control="cartesian",
        max_episode_steps=20,
    )
    assert count == 2
    episodes = list(minari.load_dataset(name).iterate_episodes())
    env = gym.make("tauguard/Reach-v0", control="cartesian", max_episode_steps=20)
    observation, _ = env.reset(seed=5)
    assert np.array_equal(episodes[0].observations[0], observation)
    for k in range(20):
        observation, reward, *_, info = env.step(episodes[0].actions[k])
        assert np.array_equal(episodes[0].observations[k + 1], observation)
        assert episodes[0].rewards[k] == reward
        assert episodes[0].infos["cost"][k + 1] == info["cost"]
    with pytest.raises(ValueError, match="another version"):
        record_policy("tauguard/Reach-v0", straight, name, episodes=1)
