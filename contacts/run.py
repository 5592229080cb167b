"""The record of a run of a scene with several checkers."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tauguard.arrays import Array
from tauguard.contacts.checker import Contacts, State
from tauguard.contacts.ground_truth import Touches

#: Surfaces closer than this count as touching [m]. Swept checkers stop within 1e-10 of the shapes'
#: size, and the tolerance of the ground truth is a thousand times larger.
TOUCHING = 1e-8


@dataclass
class Run:
    """The record of a run, step by step; ``times`` has one entry more than there are steps.

    Attributes:
        model: MjModel.
        times: Times of the states [s].
        contacts: One :class:`Contacts` per step, by checker.
        touches: The true contacts, one item per step; empty without ground truth.
        seconds: Processor time of each call [s], by checker.
        step_seconds: Processor time of each ``mj_step`` [s].
        state_seconds: Processor time of copying each state [s].
        states: All states if they were kept, otherwise only the first.
    """

    model: Any
    times: list[float]
    contacts: dict[str, list[Contacts]]
    touches: list[Touches] = field(default_factory=list)
    seconds: dict[str, list[float]] = field(default_factory=dict)
    step_seconds: list[float] = field(default_factory=list)
    state_seconds: list[float] = field(default_factory=list)
    states: list[State] = field(default_factory=list)

    def recording(self) -> dict[str, Any]:
        """Arguments of :func:`tauguard.replay.contacts.write_contacts_rrd`, except the notes."""
        count = len(self.times)
        return {
            "model": self.model,
            "t": np.array(self.times),
            "positions": np.array([state.xpos for state in self.states]),
            "rotations": np.array([state.xmat for state in self.states]).reshape(count, -1, 3, 3),
            "vertices": np.array([state.flexvert_xpos for state in self.states]),
            "marks": {name: self._marks(found) for name, found in self.contacts.items()},
        }

    def _marks(self, found: list[Contacts]) -> tuple[Array, Array, Array]:
        """Times [s], points and normals of all contacts in which surfaces touch."""
        begin, length = np.array(self.times[:-1]), np.diff(self.times)
        when = [begin[k] + length[k] * one.time for k, one in enumerate(found)]
        touching = np.concatenate([one.distance <= TOUCHING for one in found])
        points = np.concatenate([one.point for one in found])
        normals = np.concatenate([one.normal for one in found])
        return np.concatenate(when)[touching], points[touching], normals[touching]
