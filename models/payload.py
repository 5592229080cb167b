"""The payload: a body at the flange whose mass can change while the simulation runs."""

import mujoco
import numpy as np

from tauguard.arrays import Array
from tauguard.findings import ArgumentError
from tauguard.models.obstacles import pair_weights

#: Distance of the payload's centre of mass from the flange [m].
PAYLOAD_REACH = 0.08
#: Radius of the solid ball that gives the payload its inertia [m].
_RADIUS = 0.05
#: Mass [kg] and inertia [kg m^2] of an empty payload body, above MuJoCo's minimum.
_NO_MASS, _NO_INERTIA = 1e-6, 1e-9


def add_payload_body(spec: mujoco.MjSpec, flange: mujoco.MjsSite) -> None:
    """Add the body ``payload`` at ``flange``: nearly weightless, visible, without contacts."""
    body = flange.parent.add_body(name="payload", pos=flange.pos, quat=flange.quat)
    body.explicitinertial = True
    body.mass = _NO_MASS
    body.ipos = [0, 0, PAYLOAD_REACH]
    body.inertia = [_NO_INERTIA] * 3
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        pos=[0, 0, PAYLOAD_REACH],
        size=[0.045, 0.05, 0],
        group=2,
        contype=0,
        conaffinity=0,
        density=0,
        rgba=[0.85, 0.5, 0.15, 1],
    )


def load_body(model: mujoco.MjModel, body: int, mass: float) -> None:
    """Set mass [kg] and inertia of the payload body; derived constants stay unchanged."""
    load = max(mass, _NO_MASS)
    model.body_mass[body] = load
    model.body_inertia[body] = max(load * 0.4 * _RADIUS**2, _NO_INERTIA)


def keep_stiffness(model: mujoco.MjModel, before: Array, solref: Array) -> None:
    """After a change of masses, update derived constants; contact pairs keep their stiffness.

    Args:
        model: the changed model.
        before: its :func:`pair_weights` before the change.
        solref: its ``pair_solref`` before the change.
    """
    mujoco.mj_setConst(model, mujoco.MjData(model))
    direct = solref[:, 0] < 0
    ratio = pair_weights(model)[direct] / before[direct]
    model.pair_solref[direct] = solref[direct] * ratio[:, None]


def set_payload(model: mujoco.MjModel, data: mujoco.MjData, body: int, mass: float) -> None:
    """Set the mass [kg] of the payload body, a compact load in front of the flange.

    Args:
        model: model of the scene; changed.
        data: the running state; not changed. Its next step uses the new mass.
        body: id of the payload body (``Scene.payload_body``).
        mass: [kg].

    Raises:
        ArgumentError: a mass that is negative or not finite, or a scene without a payload body.
    """
    if body < 0:
        raise ArgumentError("the scene has no payload: compose it with SceneSpec(payload=True)")
    if not (np.isfinite(mass) and mass >= 0):
        raise ArgumentError(f"payload {mass} kg: expected 0 or more")
    before, solref = pair_weights(model), model.pair_solref.copy()
    load_body(model, body, mass)
    keep_stiffness(model, before, solref)
