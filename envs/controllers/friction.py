"""What a controller adds to make up for the friction that it knows of."""

from __future__ import annotations

import numpy as np

from tauguard.arrays import Array
from tauguard.models import Friction

#: The Coulomb part rises over this speed [rad/s].
SMOOTHING = 0.02


def friction_torque(friction: Friction | None, qd_des: Array) -> Array:
    """Nominal friction at the wanted speed [N m], shape (n,); zero without a friction model.

    It takes the wanted speed, not the measured one: a compensation by the measured speed would
    chatter at rest. ``scene.facts.nominal.friction`` is the friction that is known of an arm.
    """
    if friction is None:
        return np.zeros_like(qd_des)
    level = friction.coulomb * np.tanh(qd_des / SMOOTHING)
    return np.asarray(level + friction.viscous * qd_des)
