"""Scenes with fabrics: a cloth in the arm's path, a sleeve on the arm, a garment on a chest."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.contacts.scenes.scene import ContactScene, driven, sway, turn
from tauguard.models import BodyProxy, Cloth, SceneSpec, compose
from tauguard.models.cloth import add_sheet

#: Young's modulus of the fabrics [Pa]; times the thickness of 2 mm it is 400 N/m (a soft knit).
FABRIC_YOUNG = 2e5
#: The link of the forearm; the sleeve surrounds its capsule.
SLEEVED_LINK = "link3"


def arm_cloth(count: int = 15) -> ContactScene:
    """The arm turns about its base into a cloth of 0.6 m that hangs from its upper edge.

    Args:
        count: vertices along each side of the cloth.
    """
    cloth = Cloth(
        count=count,
        position=(0.4, 0.3, 0.75),
        quat_wxyz=(0.5**0.5, 0.5**0.5, 0.0, 0.0),
        young=FABRIC_YOUNG,
    )
    scene = compose(SceneSpec(labels=False, cloth=cloth, integrator="discrete"))
    moves = [(scene.joint_names, turn(scene.home, 0, 1.5, 0.7))]
    return driven("arm_cloth", scene.model, 0.6, moves)


def sleeve_arm() -> ContactScene:
    """A wide tube of fabric lies around the forearm, which sways; nothing else holds the tube."""
    scene = compose(SceneSpec(labels=False, integrator="discrete"))
    model, data = scene.model, mujoco.MjData(scene.model)
    data.qpos[scene.qpos_adr] = scene.home
    mujoco.mj_kinematics(model, data)
    body = model.body(SLEEVED_LINK)
    shapes = range(body.geomadr[0], body.geomadr[0] + body.geomnum[0])
    arm = next(g for g in shapes if model.geom_contype[g])
    radius, half = model.geom_size[arm, :2]
    points, faces = tube(14, 10, radius + 0.012, half)
    points = points @ data.geom_xmat[arm].reshape(3, 3).T + data.geom_xpos[arm]
    spec = mujoco.MjSpec.from_string(scene.xml)
    add_sheet(spec, points, faces, mass=0.08, radius=1e-3, young=FABRIC_YOUNG)
    reference = sway(scene.home, np.array([0, 2]), np.array([0.15, 0.12]), 0.8)
    moves = [(scene.joint_names, reference)]
    return driven("sleeve_arm", spec.compile(), 0.8, moves)


def tube(around: int, along: int, radius: float, length: float) -> tuple[Array, NDArray[np.int32]]:
    """An open tube about the z axis: points (around * along, 3) [m] and faces (F, 3)."""
    angle = 2 * np.pi * np.arange(around) / around
    ring = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    height = np.linspace(-length / 2, length / 2, along)
    points = np.concatenate([np.tile(ring, (along, 1)), np.repeat(height, around)[:, None]], axis=1)
    i, j = (k.ravel() for k in np.meshgrid(np.arange(along - 1), np.arange(around), indexing="ij"))
    a, b = i * around + j, i * around + (j + 1) % around
    c, d = a + around, b + around
    faces = np.concatenate([np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)])
    return points, faces.astype(np.int32)


def garment_chest() -> ContactScene:
    """A cloth hangs over a person's chest (a fixed proxy), and the arm presses into both."""
    chest = BodyProxy("chest", (0.32, 0.42, 0.78), (0.0, 1.0, 0.0), radius=0.1, clamped=True)
    cloth = Cloth(
        size=0.5,
        mass=0.12,
        position=(0.38, 0.305, 0.74),
        quat_wxyz=(0.5**0.5, 0.5**0.5, 0.0, 0.0),
        young=FABRIC_YOUNG,
    )
    scene = compose(SceneSpec(labels=False, proxies=(chest,), cloth=cloth, integrator="discrete"))
    spec = mujoco.MjSpec.from_string(scene.xml)
    worn = spec.geom("chest")
    worn.contype, worn.conaffinity = 4, 6  # collides with the cloth; with the arm by explicit pairs
    for flex in spec.flexes:
        flex.contype, flex.conaffinity = 6, 5
    moves = [(scene.joint_names, turn(scene.home, 0, 0.8, 0.6))]
    return driven("garment_chest", spec.compile(), 0.7, moves)
