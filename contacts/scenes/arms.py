"""Scenes with arms: one between boxes, and two that meet over a table."""

import mujoco
import numpy as np

from tauguard.contacts.scenes.scene import ContactScene, driven, sway
from tauguard.models import SceneSpec, Table, compose, load_arm
from tauguard.models.scene import INTEGRATORS

#: Distance between the pedestals of both arms along x [m].
DISTANCE = 1.0
PERIOD = 1.2  #: of the swings [s]
#: Amplitudes of the first three joints in ``two_arms`` [rad].
REACH = (0.15, 0.25, 0.1)


def arm_boxes() -> ContactScene:
    """The arm swings its base joint between two rows of boxes; a free box stands in its path."""
    spec = mujoco.MjSpec.from_string(compose(SceneSpec(labels=False)).xml)
    for i, (x, y, z) in enumerate(
        [(0.42, 0.42, 0.72), (0.42, -0.16, 0.72), (0.1, 0.42, 0.55), (0.58, 0.2, 0.97)]
    ):
        spec.worldbody.add_geom(
            name=f"box{i}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[0.08, 0.05, 0.12],
            pos=[x, y, z],
            quat=[0.97, 0.05 * i, 0.1, 0.2],
            contype=2,
            conaffinity=1,
        )
    loose = spec.worldbody.add_body(name="loose", pos=[0.39, 0.24, 0.66], gravcomp=1)
    loose.add_freejoint()
    loose.add_geom(
        name="loose",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[0.03, 0.03, 0.05],
        mass=0.3,
        contype=2,
        conaffinity=3,
    )
    return _swinging("arm_boxes", spec, [""], (0.45, 0.25, -0.15))


def two_arms() -> ContactScene:
    """Two arms face each other over one table, reach for its middle and meet there."""
    table = Table(position=(DISTANCE / 2, 0.15, 0.5), half_extents=(0.2, 0.5, 0.02))
    spec = mujoco.MjSpec.from_string(compose(SceneSpec(labels=False, table=table)).xml)
    other = load_arm("cura6").spec
    for geom in other.geoms:  # they collide with the first arm and the table, not with each other
        if geom.contype or geom.conaffinity:
            geom.contype, geom.conaffinity = 4, 3
    frame = spec.worldbody.add_frame(pos=[DISTANCE, 0.3, 0], quat=[0, 0, 0, 1])
    spec.attach(other, frame=frame, prefix="other_")
    return _swinging("two_arms", spec, ["", "other_"], REACH)


def _swinging(
    name: str,
    spec: mujoco.MjSpec,
    prefixes: list[str],
    amplitude: tuple[float, float, float],
) -> ContactScene:
    """The scene ``spec``, in which every arm swings its first three joints about its home pose."""
    spec.option.integrator = INTEGRATORS["implicitfast"]
    arm = load_arm("cura6")
    reference = sway(arm.home, np.arange(3), np.array(amplitude), PERIOD)
    arms = [(tuple(prefix + joint for joint in arm.joints), reference) for prefix in prefixes]
    return driven(name, spec.compile(), 2 * PERIOD, arms)
