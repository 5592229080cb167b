"""Semi-real collisions: torques of known shape added to collision-free logs of a real arm.

The motion stays as it was recorded. The drive is assumed to balance the contact at once, so the
current changes by ``-tau_ext / gain``. A real controller also yields a little, and its current
follows the contact some milliseconds later. So such collisions are good for comparing detectors;
they do not replace real pushes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tauguard.arrays import Array
from tauguard.traces.trace import Trace

#: Time course of a contact over its duration, 0 to 1, by name.
SHAPES: dict[str, Callable[[Array], Array]] = {
    # An impact: half a sine.
    "impact": lambda x: np.asarray(np.sin(np.pi * x)),
    # A hand's push: rises in a fifth of its time, holds, lets go in a fifth.
    "push": lambda x: np.asarray(np.clip(np.minimum(x, 1 - x) / 0.2, 0.0, 1.0)),
}


@dataclass(frozen=True)
class Added:
    """A contact to add."""

    start: float  #: [s]
    seconds: float  #: how long
    torque: tuple[float, ...]  #: at its peak, one a joint [N m]
    shape: str = "impact"


def add_contact(trace: Trace, drive_gain: Array, contact: Added) -> Trace:
    """The trace with a contact in its currents, labelled semi-real in ``meta``.

    Args:
        trace: collision-free.
        drive_gain: N m per ampere, shape (n,).
        contact: what to add; outside of the trace it adds nothing.

    Raises:
        ValueError: an unknown shape, no duration, or not one torque a joint.
    """
    if contact.shape not in SHAPES:
        raise ValueError(f"shape {contact.shape!r}: expected {' or '.join(SHAPES)}")
    if not contact.seconds > 0 or len(contact.torque) != trace.q.shape[1]:
        raise ValueError(
            f"contact of {contact.seconds} s and {len(contact.torque)} torques: expected more than "
            f"0 s and {trace.q.shape[1]} torques"
        )
    phase = (trace.t - contact.start) / contact.seconds
    inside = (phase >= 0) & (phase <= 1)
    course = np.where(inside, SHAPES[contact.shape](np.clip(phase, 0, 1)), 0.0)
    current = trace.current - np.outer(course, contact.torque) / drive_gain
    return replace(trace, current=current, meta={**trace.meta, "collisions": "semi-real"})
