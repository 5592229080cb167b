"""Scenes with a fast sphere and a thin object, which it can pass through within one step."""

import mujoco
import numpy as np

from tauguard.arrays import Array
from tauguard.contacts.scenes.scene import ContactScene
from tauguard.findings import ArgumentError
from tauguard.models.cloth import Cloth, add_cloth
from tauguard.models.scene import INTEGRATORS

BALL_RADIUS = 0.010  #: [m]
PLATE_HALF_THICKNESS = 0.001  #: [m]
BALL_MASS = 0.020  #: [kg]
#: Young's modulus of the cloth [Pa]; times its thickness of 2 mm it is 20 kN/m (a woven fabric).
CLOTH_YOUNG = 1e7
#: Initial distance of the surfaces of ball and cloth or plate, without ``offset`` [m].
BALL_GAP = 0.005
#: solref and solimp of contacts so stiff that a fast ball does not sink through.
STIFF = ((1e-4, 1.0), (0.99, 0.999, 0.001, 0.5, 2.0))
#: Impact points on the cloth, as weights of the three vertices of a face.
IMPACT_POINTS = {"vertex": (1.0, 0.0, 0.0), "edge": (0.5, 0.5, 0.0), "face": (1 / 3, 1 / 3, 1 / 3)}


def ball_cloth(
    speed: float = 10.0,
    offset: float = 0.0,
    impact: str = "face",
    stiff: bool = True,
    count: int = 15,
) -> ContactScene:
    """A ball (radius 10 mm, 20 g) flies straight into a stretched cloth of 0.3 m; no gravity.

    Args:
        speed: speed of the ball, along -z [m/s].
        offset: additional initial distance [m].
        impact: one of :data:`IMPACT_POINTS`, on a face in the middle of the cloth.
        stiff: whether contacts of the cloth use :data:`STIFF`. Otherwise MuJoCo averages the time
            constants of cloth (0.003 s) and ball (0.02 s).
        count: vertices along each side of the cloth.

    Raises:
        ArgumentError: an unknown impact point, or a speed that is not above 0.
    """
    if impact not in IMPACT_POINTS:
        raise ArgumentError(f"impact {impact!r}: expected one of {', '.join(IMPACT_POINTS)}")
    spec = _spec("discrete", speed)
    cloth = Cloth(
        count=count,
        size=0.3,
        mass=0.05,
        position=(0.0, 0.0, 0.0),
        quat_wxyz=(1.0, 0.0, 0.0, 0.0),
        pinned="frame",
        young=CLOTH_YOUNG,
        solref=STIFF[0] if stiff else (0.003, 1.0),
    )
    add_cloth(spec, cloth)
    ball = spec.worldbody.add_body(name="ball")
    ball.add_freejoint()
    ball.add_geom(name="ball", size=[BALL_RADIUS, 0, 0], mass=BALL_MASS, conaffinity=2)
    model = spec.compile()
    if stiff:
        model.flex_priority[0] = 1
        model.flex_solimp[0] = STIFF[1]
    qpos, qvel = model.qpos0.copy(), np.zeros(model.nv)
    joint = model.body("ball").jntadr[0]
    where, how = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
    height = BALL_RADIUS + cloth.radius + BALL_GAP + offset
    qpos[where : where + 3] = _impact_point(model, impact) + np.array([0.0, 0.0, height])
    qvel[how + 2] = -speed
    seconds = (BALL_GAP + offset) / speed + 0.03
    return ContactScene("ball_cloth", model, qpos, qvel, seconds)


def _impact_point(model: mujoco.MjModel, impact: str) -> Array:
    """The impact point on the face nearest to the cloth's middle, shape (3,) [m]."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    faces = data.flexvert_xpos[model.flex_elem.reshape(-1, 3)]
    middle = data.flexvert_xpos.mean(axis=0)
    face = faces[np.argmin(np.linalg.norm(faces.mean(axis=1) - middle, axis=1))]
    return np.asarray(np.array(IMPACT_POINTS[impact]) @ face, dtype=np.float64)


def sphere_plate(speed: float = 10.0, offset: float = 0.0, stiff: bool = True) -> ContactScene:
    """A rigid sphere (radius 10 mm, 20 g) flies straight into a fixed 2 mm plate; no gravity.

    Args:
        speed: speed of the sphere, along -z [m/s].
        offset: additional initial distance [m].
        stiff: whether contacts of the plate use :data:`STIFF` instead of MuJoCo's default.

    Raises:
        ArgumentError: a speed that is not above 0.
    """
    spec = _spec("implicitfast", speed)
    plate = spec.worldbody.add_geom(
        name="plate", type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 0.1, PLATE_HALF_THICKNESS]
    )
    if stiff:
        plate.priority, plate.solref, plate.solimp = 1, STIFF[0], STIFF[1]
    ball = spec.worldbody.add_body(name="ball")
    ball.add_freejoint()
    ball.add_geom(name="ball", size=[BALL_RADIUS, 0, 0], mass=BALL_MASS)
    model = spec.compile()
    qpos, qvel = model.qpos0.copy(), np.zeros(model.nv)
    qpos[:3] = [0.013, 0.007, PLATE_HALF_THICKNESS + BALL_RADIUS + BALL_GAP + offset]
    qvel[2] = -speed
    return ContactScene("sphere_plate", model, qpos, qvel, (BALL_GAP + offset) / speed + 0.03)


def _spec(integrator: str, speed: float) -> mujoco.MjSpec:
    """An empty scene without gravity; ``ArgumentError`` for a bad speed."""
    if not 0 < speed < np.inf:
        raise ArgumentError(f"speed {speed} m/s: expected above 0")
    spec = mujoco.MjSpec()
    spec.option.gravity = [0, 0, 0]
    spec.option.integrator = INTEGRATORS[integrator]
    return spec
