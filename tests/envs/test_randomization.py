"""Randomisation per episode: what is drawn acts, the seed decides it, snapshots hold it."""

import copy

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv

from tauguard.envs.gym.randomization import PARAMETERS, Choice, Normal, Uniform

REACH = "tauguard:tauguard/Reach-v0"
ALL = {
    "mass": (0.8, 1.2),
    "gain": Uniform(0.95, 1.05),
    "friction": Normal(1.0, 0.2, 0.5, 2.0),
    "temperature": (15.0, 45.0),
    "noise": Choice((0.5, 1.0, 2.0)),
    "payload_g": (0.0, 2000.0),
    "stature": (1.5, 1.9),
    "hand_speed": (0.5, 1.6),
    "walk_speed": 1.0,
    "reaction_time": (0.1, 0.4),
}


def played(env, actions):
    rows = [env.step(action) for action in actions]
    return np.array(
        [np.concatenate([row[0], [row[1], row[4]["cost"]], row[4]["residual"]]) for row in rows]
    )


def test_every_parameter_is_tried_here():
    assert set(ALL) == set(PARAMETERS)


def test_the_seed_decides_and_a_snapshot_goes_on_with_the_same_bits():
    keywords = {"randomize": ALL, "detector": "observer", "noise": True}
    env = gym.make(REACH, **keywords).unwrapped
    actions = np.random.default_rng(0).uniform(-1, 1, (20, 6))
    env.reset(seed=3)
    first, drawn = played(env, actions[:10]), env.drawn
    state, twin = env.get_state(), copy.deepcopy(env)
    rest = played(env, actions[10:])
    env.reset(seed=4)
    assert not np.array_equal(env.drawn["mass"], drawn["mass"])
    env.set_state(state)
    assert np.array_equal(env.drawn["mass"], drawn["mass"])
    assert np.array_equal(played(env, actions[10:]), rest)
    assert np.array_equal(played(twin, actions[10:]), rest)
    env.reset(seed=3)
    assert np.array_equal(played(env, actions[:10]), first)
    other = gym.make(REACH, **keywords).unwrapped
    other.reset(seed=3)
    assert np.array_equal(played(other, actions[:10]), first)


@pytest.mark.parametrize("threads", [1, 3])
def test_native_and_single_have_the_same_bits(threads):
    keywords = {"randomize": ALL, "max_episode_steps": 6}
    sync = SyncVectorEnv([lambda: gym.make(REACH, **keywords)] * 2)
    vector = gym.make_vec(REACH, num_envs=2, threads=threads, **keywords)
    assert np.array_equal(sync.reset(seed=1)[0], vector.reset(seed=1)[0])
    vector.action_space.seed(0)
    for _ in range(15):
        actions = vector.action_space.sample()
        a, b = sync.step(actions), vector.step(actions)
        assert np.array_equal(a[0], b[0])
        assert np.array_equal(a[4]["tau_ext_peak"], b[4]["tau_ext_peak"])
        assert np.array_equal(a[4]["cost_sum"], b[4]["cost_sum"])


def test_without_randomisation_nothing_is_drawn():
    plain, other = gym.make(REACH).unwrapped, gym.make(REACH, randomize={}).unwrapped
    assert np.array_equal(plain.reset(seed=0)[0], other.reset(seed=0)[0])
    assert plain.np_random.random() == other.np_random.random()


def test_what_is_drawn_acts():
    """A payload pulls, a weaker drive lags, friction brakes: against the same episode without."""
    names = {"payload_g": 0.0, "gain": 1.0, "friction": 1.0, "mass": 1.0}
    env = gym.make(REACH, obstacles=(), control="current", randomize=names).unwrapped
    changed = {"payload_g": 3000.0, "gain": 0.5, "friction": 3.0, "mass": [1, 1, 1.5, 1, 1, 1]}

    def fallen(**options):
        env.reset(seed=0, options=options)
        push = np.zeros(6)
        push[0] = 0.3
        for _ in range(25):
            env.step(push)
        return env.data.qpos[:6].copy()

    same = fallen()
    assert np.array_equal(fallen(), same)
    for name, value in changed.items():
        assert np.abs(fallen(**{name: value}) - same).max() > 1e-3, name
    assert np.array_equal(fallen(), same)
    env.reset(seed=0, options={"mass": 1.2})
    link = env.compiled.scene.link_bodies
    assert env.model.body_mass[link] == pytest.approx(
        1.2 * env.compiled.scene.model.body_mass[link]
    )


def test_contacts_keep_the_stiffness_that_they_say():
    env = gym.make(REACH, randomize={"mass": (0.5, 2.0), "payload_g": (0, 5000)}).unwrapped
    env.reset(seed=0)
    base = env.compiled.scene.model

    def stiffness(model):
        inverse = model.body_invweight0[:, 0][model.geom_bodyid]
        weight = inverse[model.pair_geom1] + inverse[model.pair_geom2]
        return -model.pair_solref[:, 0] / weight

    assert stiffness(env.model) == pytest.approx(stiffness(base), rel=1e-9)


def test_a_taller_person_is_taller():
    env = gym.make(REACH, randomize={"stature": (1.5, 1.9)}).unwrapped
    heights = []
    for stature in (1.5, 1.9):
        env.reset(seed=0, options={"stature": stature})
        heights.append(env.data.body("person_skull").xpos[2] - env.compiled.person.floor)
        radius = env.model.geom("person_chest").size[0]
        assert radius == pytest.approx(0.070 * stature)
    assert heights[1] / heights[0] == pytest.approx(1.9 / 1.5, rel=0.02)


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"randomize": {"colour": (0, 1)}}, "'colour'; expected some of mass, "),
        ({"randomize": {"mass": (1.2, 0.8)}}, "expected low <= high"),
        ({"randomize": {"mass": (0.0, 1.0)}}, "0.1 to 10"),
        ({"randomize": {"mass": "heavy"}}, "mass 'heavy'"),
        ({"randomize": {"stature": 1.7}, "obstacles": ()}, "without a person"),
    ],
)
def test_distributions_that_cannot_be(keywords, words):
    with pytest.raises(ValueError, match=words):
        gym.make(REACH, **keywords)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"mas": 1.0}, "unknown 'mas'; expected some of target, .*mass"),
        ({"payload_g": 1.0}, "name it in randomize"),
        ({"mass": 100.0}, "0.1 to 10"),
        ({"mass": "heavy"}, "expected a number"),
        ({"mass": [1.0, 1.0]}, "2 values; expected 1 or 6"),
    ],
)
def test_options_that_cannot_be(options, words):
    env = gym.make(REACH, randomize={"mass": (0.9, 1.1)})
    with pytest.raises(ValueError, match=words):
        env.reset(seed=0, options=options)
    envs = gym.make_vec(REACH, num_envs=2, randomize={"mass": (0.9, 1.1)})
    with pytest.raises(ValueError, match=words):
        envs.reset(seed=0, options=options)
