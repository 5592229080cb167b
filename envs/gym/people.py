"""Draw the motions of a person in an episode; native code carries them out."""

from __future__ import annotations

import numpy as np

from tauguard.arrays import Array
from tauguard.envs import _plant
from tauguard.models import Person
from tauguard.models.person import SEGMENTS

assert len(SEGMENTS) == _plant.PERSON_SEGMENTS
#: Number of reaches per hand, and of walks, in a script; at its end the script repeats.
REACHES, WALKS = 24, 8
#: Range of the time between two reaches, and of the hand's time at its goal [s].
PAUSE, HOLD = (0.2, 1.5), (0.2, 1.0)
#: Range of the time at the work place, and away from it [s].
STAY, AWAY = (3.0, 8.0), (1.0, 3.0)
#: Range of the distance of the place away from work: beside and behind the work place [m].
ASIDE, BEHIND = (0.5, 1.2), (0.0, 0.6)
#: Least distance of a walk from tables and objects [m]; less if the work place itself is nearer.
CLEAR = 0.3
DRAWN = 20  #: number of draws for one walk, after which it is left out
STEP_BACK = 0.3  #: longest step back [m]
#: No obstacles to walk around.
NOWHERE: Array = np.zeros((0, 4))
#: Range of a reach: ahead and to the side [arm's length], and above the hips [m].
AHEAD, ACROSS, ABOVE = (0.5, 1.3), (-0.5, 0.8), (0.0, 0.55)


def anatomy(person: Person, blocked: Array) -> _plant.Anatomy:
    """The person's numbers for native code; for ``blocked`` see :func:`draw_script`."""
    back = -np.array([np.cos(person.facing), np.sin(person.facing)])
    far = np.linspace(0.0, STEP_BACK, 13)
    free = [d for d in far if _clear(person, blocked, person.position + d * back)]
    names = (
        "trunk", "shoulder", "hip_half", "neck", "head", "upper_arm", "lower_arm", "hand",
        "grip", "thigh", "shank",
    )  # fmt: skip
    return _plant.Anatomy(
        hip_height=person.hip_height,
        **{name: person.length(name) for name in names},
        floor=person.floor,
        facing=person.facing,
        hand_speed=person.hand_speed,
        walk_speed=person.walk_speed,
        reaction_time=person.reaction_time,
        seated=person.seated,
        hanging=person.motion == "still",
        reacts=person.reacts,
        step_back=float(max(free)),
    )


def _clear(person: Person, blocked: Array, place: Array, begin: Array | None = None) -> bool:
    """Whether the straight path to a place keeps clear of all blocked areas."""
    if not len(blocked):
        return True
    at_work = np.array(person.position)
    begin = at_work if begin is None else begin
    way = begin + np.linspace(0.0, 1.0, 25)[:, None] * (place - begin)
    rows = np.concatenate([at_work[None], way])[:, None]
    outside = np.maximum(np.maximum(blocked[:, :2] - rows, rows - blocked[:, 2:]), 0.0)
    distance = np.linalg.norm(outside, axis=2).min(axis=1)
    return bool(distance[1:].min() >= min(CLEAR, distance[0] - 1e-6))


def draw_script(
    person: Person, rng: np.random.Generator, blocked: Array = NOWHERE
) -> tuple[Array, Array]:
    """Draw the motions of one episode: reaches (2, rows, 5) and walks (rows, 3).

    The columns of a reach are wait [s], place (3) [m] and hold [s]. The columns of a walk are the
    time at its place [s] and the place (2) [m].

    Args:
        person: the person.
        rng: source of the draws.
        blocked: areas that walks avoid: least x and y, largest x and y [m], shape (k, 4).
    """
    reaches = np.zeros((2, REACHES, _plant.REACH_WIDTH))
    walks = np.zeros((WALKS, _plant.WALK_WIDTH))
    forward = np.array([np.cos(person.facing), np.sin(person.facing)])
    left = np.array([-forward[1], forward[0]])
    arm = sum(person.length(name) for name in ("upper_arm", "lower_arm", "grip"))
    hips = person.floor + person.hip_height
    for hand, side in enumerate((1.0, -1.0)):
        low, high = np.transpose([PAUSE, AHEAD, ACROSS, ABOVE, HOLD])
        wait, ahead, across, above, hold = rng.uniform(low, high, (REACHES, 5)).T
        places = np.outer(ahead * arm, forward) + np.outer(side * across * arm, left)
        reaches[hand, :, 0], reaches[hand, :, 4] = wait, hold
        reaches[hand, :, 1:3] = person.position + places
        reaches[hand, :, 3] = hips + above
    away = np.arange(WALKS) % 2 == 1

    def spots(count: int) -> Array:
        """Draw places at work (row 0) and away from work (row 1) [m], shape (count, 2, 2)."""
        aside = rng.uniform(*ASIDE, count) * rng.choice([-1.0, 1.0], count)
        shift = np.outer(aside, left) - np.outer(rng.uniform(*BEHIND, count), forward)
        near = rng.normal(0.0, 0.03, (count, 2))
        return np.asarray(person.position + np.stack([near, shift], axis=1))

    drawn = spots(WALKS)[np.arange(WALKS), away.astype(int)]
    drawn[0] = person.position
    for k in range(1, WALKS if len(blocked) else 0):
        last = drawn[k - 1]
        # The last candidate is the work place, with which the script begins again.
        tries = [drawn[k], *spots(DRAWN)[:, int(away[k])], drawn[0]]
        free = (p for p in tries if _clear(person, blocked, p) and _clear(person, blocked, p, last))
        drawn[k] = next(free, last)
    walks[:, 1:] = drawn
    walks[:, 0] = np.where(away, rng.uniform(*AWAY, WALKS), rng.uniform(*STAY, WALKS))
    if person.motion != "walk" or person.seated:
        walks[:, 1:], walks[:, 0] = walks[0, 1:], np.inf
    return reaches, walks
