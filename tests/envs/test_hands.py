"""People's arms and objects: they stop at them or go round; coal says how far apart they are."""

from functools import cache

import coal
import gymnasium as gym
import numpy as np
import pytest

from tauguard.models import Person, SceneObject, Shape
from tauguard.models.person import SEGMENTS

REACH = "tauguard:tauguard/Reach-v0"
#: Out of the arm's reach: only people and objects matter here.
SOMEONE = Person(position=(4.0, 0.0), motion="walk")
ARMS = [k for k, s in enumerate(SEGMENTS) if s.region in ("upper_arm", "lower_arm", "hand")]

REQUEST = coal.DistanceRequest()


def walls(half, high, thick):
    """A bin without a lid."""
    floor = Shape("box", (half, half, thick), (0.0, 0.0, -high))
    sides = [
        Shape("box", (thick if x else half, thick if y else half, high), (x * half, y * half, 0.0))
        for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))
    ]
    return floor, *sides


THINGS = {
    "block": SceneObject("thing", (Shape("box", (0.1, 0.15, 0.15)),), position=(3.25, 0.1, 0.15)),
    "ball": SceneObject("thing", (Shape("sphere", 0.12),), position=(3.3, -0.1, 0.35)),
    "wall": SceneObject("thing", (Shape("box", (0.02, 0.5, 0.25)),), position=(3.35, 0.0, 0.2)),
    "bin": SceneObject("thing", walls(0.15, 0.1, 0.01), position=(3.3, 0.0, 0.15)),
    "part": SceneObject(
        "thing", (Shape("box", (0.08, 0.08, 0.08)),),
        path=((0, 3.2, -0.6, 0.3), (2, 3.2, 0.6, 0.3), (4, 3.2, -0.6, 0.3)),
    ),
}  # fmt: skip


def make(*objects, person=SOMEONE):
    """An environment in which one person works beside the objects."""
    return gym.make(
        REACH, obstacles=(person,), objects=objects, max_episode_steps=10**6, checkers=()
    ).unwrapped


@cache
def solid(shape):
    """coal's."""
    if shape.kind == "sphere":
        return coal.Sphere(shape.size[0])
    return coal.Box(*(2 * s for s in shape.size))


@cache
def capsule(radius, half):
    """coal's."""
    return coal.Capsule(radius, 2 * half)


def placed(position, quat_wxyz):
    """coal's pose."""
    return coal.Transform3s(coal.Quaternion(*quat_wxyz), np.asarray(position, dtype=np.float64))


def distance(env, poses, thing):
    """Least signed distance [m] of the arms' capsules at poses (regions) from a thing's shapes."""
    least, where = np.inf, poses[-1]["position"] if len(poses) > len(SEGMENTS) else thing.position
    there = [
        (solid(shape), placed(np.add(where, shape.position), (1.0, 0.0, 0.0, 0.0)))
        for shape in thing.shapes
    ]
    for k in ARMS:
        radius, half, _ = env.model.geom(f"person_{SEGMENTS[k].name}").size
        pose = placed(poses[k]["position"], poses[k]["quat_wxyz"])
        for shape, place in there:
            result = coal.DistanceResult()
            found = coal.distance(capsule(radius, half), pose, shape, place, REQUEST, result)
            least = min(least, found)
    return least


@pytest.mark.parametrize("name", THINGS)
def test_arms_of_people_pass_through_nothing(name):
    """At every physics step apart, no faster than startled, where the same reaches went through."""
    thing = THINGS[name]
    env, empty = make(thing), make()
    nearest, unimpeded, fastest, last = np.inf, np.inf, 0.0, None
    for seed in range(2):
        env.reset(seed=seed)
        empty.reset(seed=seed)
        for _ in range(400):
            env.step(np.zeros(6))
            empty.step(np.zeros(6))
            rows = env.batch.region[0]
            nearest = min(nearest, *(distance(env, row, thing) for row in rows[::2]))
            free = np.append(empty.batch.region[0, -1], rows[-1, -1:])
            unimpeded = min(unimpeded, distance(env, free, thing))
            steps = rows["position"][:, ARMS] if last is None else np.diff(
                np.concatenate([last, rows["position"][:, ARMS]]), axis=0
            )  # fmt: skip
            if last is not None:
                fastest = max(fastest, float(np.linalg.norm(steps, axis=2).max()) * 1000)
            last = rows["position"][-1:, ARMS]
        last = None
    assert unimpeded < -0.01  # else this shows nothing
    assert nearest > 0
    assert fastest < 6.0  # a walk, a turn of the body and a startled hand at once


def test_a_trunk_takes_no_upper_arm_into_a_thing():
    """Who sits leans to reach; the box before them is at the height of the elbows."""
    thing = SceneObject("thing", (Shape("box", (0.05, 0.3, 0.1)),), position=(3.3, 0.0, -0.1))
    env, nearest = make(thing, person=Person(position=(4.0, 0.0), posture="seated")), np.inf
    for seed in range(2):
        env.reset(seed=seed)
        for _ in range(250):
            env.step(np.zeros(6))
            nearest = min(nearest, *(distance(env, row, thing) for row in env.batch.region[0]))
    assert nearest > 0


def test_a_hand_that_is_sent_into_a_thing_stops_at_it_and_comes_back():
    thing = THINGS["block"]
    env = make(thing)
    env.reset(seed=0)
    hands = [k for k in ARMS if SEGMENTS[k].region == "hand"]
    env.batch.reaches[0, :, :, 0] = 1e6  # no reach of their own
    env.batch.walks[0, :, 0] = np.inf
    env.batch.start(0)
    env.step(np.zeros(6))
    rest = env.batch.region[0, -1]["position"][hands].copy()
    env.batch.plants[0].aim(np.array(thing.position), 0.5)
    nearest = np.inf
    for _ in range(80):
        env.step(np.zeros(6))
        nearest = min(nearest, distance(env, env.batch.region[0, -1], thing))
    assert 0 < nearest < 0.01
    for _ in range(400):
        env.step(np.zeros(6))
    assert env.batch.region[0, -1]["position"][hands] == pytest.approx(rest, abs=1e-3)


def test_a_snapshot_remembers_a_hand_that_is_held_up():
    env = make(THINGS["wall"])
    env.reset(seed=0)
    for _ in range(150):
        env.step(np.zeros(6))
    state = env.get_state()
    once = [env.step(np.zeros(6))[0] for _ in range(60)]
    env.set_state(state)
    assert np.array_equal(once, [env.step(np.zeros(6))[0] for _ in range(60)])
