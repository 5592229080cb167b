"""A person in an environment: what they do in an episode, drawn once and then played natively."""

from __future__ import annotations

import numpy as np

from tauguard.arrays import Array
from tauguard.envs import _plant
from tauguard.models import Person
from tauguard.models.person import SEGMENTS

assert len(SEGMENTS) == _plant.PERSON_SEGMENTS
#: Number of reaches of each hand and of places to walk to in a script, which then repeats.
REACHES, WALKS = 24, 8
#: Time between two reaches, and at the goal [s].
PAUSE, HOLD = (0.2, 1.5), (0.2, 1.0)
#: Time at work and away [s]; distance of the other place, to the side and behind [m].
STAY, AWAY = (3.0, 8.0), (1.0, 3.0)
ASIDE, BEHIND = (0.5, 1.2), (0.0, 0.6)
#: Range of a reach ahead and to the side, in units of the arm's length, and above the hips [m].
AHEAD, ACROSS, ABOVE = (0.5, 1.3), (-0.5, 0.8), (0.0, 0.55)


def anatomy(person: Person) -> _plant.Anatomy:
    """The native form."""
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
    )


def draw_script(person: Person, rng: np.random.Generator) -> tuple[Array, Array]:
    """What a person does in one episode: reaches (2, rows, 5) and walks (rows, 3).

    A reach: wait [s], place [m], hold [s]. A walk: stay there [s], place [m].
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
    aside = rng.uniform(*ASIDE, WALKS) * rng.choice([-1.0, 1.0], WALKS)
    shift = np.outer(aside, left) - np.outer(rng.uniform(*BEHIND, WALKS), forward)
    near = rng.normal(0.0, 0.03, (WALKS, 2))
    near[0] = 0.0
    walks[:, 1:] = person.position + np.where(away[:, None], shift, near)
    walks[:, 0] = np.where(away, rng.uniform(*AWAY, WALKS), rng.uniform(*STAY, WALKS))
    if person.motion != "walk" or person.seated:
        walks[:, 1:], walks[:, 0] = walks[0, 1:], np.inf
    return reaches, walks
