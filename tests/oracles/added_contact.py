"""Contacts of known torque, added to a log without contacts.

The motion stays as it was. The drive balances the contact at once: the current changes by
``-tau_ext / gain``. A real controller also yields a little.
"""

from dataclasses import dataclass, replace

import numpy as np

SHAPES = {
    "impact": lambda x: np.sin(np.pi * x),
    # A hand's push: rises in a fifth of its time, holds, lets go in a fifth.
    "push": lambda x: np.clip(np.minimum(x, 1 - x) / 0.2, 0.0, 1.0),
}


@dataclass(frozen=True)
class Added:
    start: float  #: [s]
    seconds: float
    torque: tuple[float, ...]  #: at its peak, one per joint [N m]
    shape: str = "impact"


def add_contact(trace, drive_gain, contact):
    phase = (trace.t - contact.start) / contact.seconds
    inside = (phase >= 0) & (phase <= 1)
    course = np.where(inside, SHAPES[contact.shape](np.clip(phase, 0, 1)), 0.0)
    return replace(trace, current=trace.current - np.outer(course, contact.torque) / drive_gain)
