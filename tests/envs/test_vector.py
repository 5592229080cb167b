"""The vector form gives the single environments' bits, whatever the number of threads."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from tauguard.environments import ENVIRONMENTS
from tauguard.envs.gym.vector import VectorArmEnv

COPIES = 3


def same(a, b, where):
    assert type(a) is type(b), where
    if isinstance(a, tuple):
        for k, (x, y) in enumerate(zip(a, b, strict=True)):
            same(x, y, f"{where}[{k}]")
    elif isinstance(a, dict):
        assert a.keys() == b.keys(), (where, a.keys() ^ b.keys())
        for key in a:
            same(a[key], b[key], f"{where}.{key}")
    elif isinstance(a, np.ndarray) and a.dtype == object:
        assert len(a) == len(b)
        for x, y in zip(a, b, strict=True):
            same(x, y, where)
    elif isinstance(a, np.ndarray):
        assert a.dtype == b.dtype, where
        assert np.array_equal(a, b), where
    else:
        assert a == b, where


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize("name", sorted(ENVIRONMENTS))
def test_bits_are_those_of_the_single_environments(name, threads):
    keywords = {"max_episode_steps": 12}
    sync = SyncVectorEnv([lambda: gym.make(name, **keywords)] * COPIES)
    vector = gym.make_vec(name, num_envs=COPIES, threads=threads, **keywords)
    assert isinstance(vector.unwrapped, VectorArmEnv)
    compare(sync, vector, 40)


@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP])
@pytest.mark.parametrize("keywords", [{}, {"detector": "observer", "noise": True}])
def test_autoreset_modes_and_sensors(mode, keywords):
    name = "tauguard/Reach-v0"
    keywords = {"max_episode_steps": 7, **keywords}
    sync = SyncVectorEnv(
        [lambda: gym.make(name, **keywords) for _ in range(COPIES)], autoreset_mode=mode
    )
    vector = gym.make_vec(name, num_envs=COPIES, autoreset_mode=mode.value, **keywords)
    compare(sync, vector, 25)


def compare(sync, vector, steps):
    same(sync.reset(seed=11), vector.reset(seed=11), "reset")
    vector.action_space.seed(1)
    for step in range(steps):
        actions = vector.action_space.sample()
        same(sync.step(actions), vector.step(actions), f"step {step}")


def test_gymnasiums_own_vector_contract():
    vector = gym.make_vec("tauguard/Reach-v0", num_envs=2)
    observations, infos = vector.reset(seed=0)
    assert vector.observation_space.contains(observations)
    assert vector.observation_space.shape == (2, *vector.single_observation_space.shape)
    assert vector.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    observations, rewards, terminated, truncated, infos = vector.step(vector.action_space.sample())
    assert vector.observation_space.contains(observations)
    assert rewards.dtype == np.float64
    assert terminated.dtype == truncated.dtype == np.bool_
    assert all(len(value) == 2 for value in infos.values())
    wrapped = gym.wrappers.vector.RecordEpisodeStatistics(vector)
    wrapped.reset(seed=0)
    wrapped.step(vector.action_space.sample())
    vector.close()


@pytest.mark.parametrize("keywords", [{"num_envs": 0}, {"num_envs": 2, "threads": -1}])
def test_numbers_that_cannot_be(keywords):
    with pytest.raises(ValueError, match="expected"):
        gym.make_vec("tauguard/Reach-v0", **keywords)


def test_reset_mask_begins_the_chosen_anew():
    vector = gym.make_vec("tauguard/Reach-v0", num_envs=3, autoreset_mode="Disabled")
    first, _ = vector.reset(seed=[5, 6, 7])
    for _ in range(3):
        moved = vector.step(np.ones((3, 6), dtype=np.float32))[0]
    again, infos = vector.reset(
        seed=[5, None, 7], options={"reset_mask": np.array([True, False, True])}
    )
    assert np.array_equal(again[[0, 2]], first[[0, 2]])
    assert np.array_equal(again[1], moved[1])
    assert infos["_time"].tolist() == [True, False, True]


@pytest.mark.parametrize(
    ("actions", "words"),
    [
        (np.zeros((3, 6)), r"expected \(2, 6\)"),
        (np.array([[0.0] * 6, [0, np.nan, 0, 0, 0, 0]]), "entry 1 of environment 1"),
    ],
)
def test_bad_actions(actions, words):
    vector = gym.make_vec("tauguard/Reach-v0", num_envs=2)
    vector.reset(seed=0)
    with pytest.raises(ValueError, match=words):
        vector.step(actions)


def test_a_diverged_copy_leaves_the_others_alone():
    vector = gym.make_vec("tauguard/Reach-v0", num_envs=2).unwrapped
    alone = gym.make_vec("tauguard/Reach-v0", num_envs=2).unwrapped
    for one in (vector, alone):
        one.reset(seed=0)
    vector.batch.datas[0].qvel[0] = 1e6
    actions = np.full((2, 6), 0.3)
    got, expected = vector.step(actions), alone.step(actions)
    assert got[3].tolist() == [True, False]
    assert got[4]["reason"][0].startswith("diverged")
    assert np.isfinite(got[0]).all()
    assert np.array_equal(got[0][1], expected[0][1])
    assert not vector.step(actions)[3].any()
