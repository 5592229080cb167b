"""Derive the numbers that a robot file does not state; comments give the reason of each rule."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array

#: Rotor inertia at the joint per torque limit [kg m^2 / (N m)]. Geared cobot drives with small
#: motors have about 0.002 (1e-5 kg m^2 behind a gear of 101 for 54 N m); the DLR arm has 0.016
#: (3.2 kg m^2 for 200 N m).
ROTOR_PER_TORQUE = 0.005
#: Rotor inertia of a joint without torque limit, as a fraction of the joint's largest inertia.
ROTOR_FRACTION = 0.05
#: Default torque limit: HOLDING_FACTOR times (largest gravity torque + the file's friction), plus
#: SPARE_ACCELERATION [rad/s^2] times the largest inertia. (A UR10e's base can reach 27 rad/s^2.)
HOLDING_FACTOR, SPARE_ACCELERATION = 2.0, 30.0
#: Plausible ratios of the strongest joint's torque limit to the largest gravity torque of a joint.
#: UR5, UR10, Panda, xArm7, Z1, Kinova j2s6s200 and the CURA6-like arm have 1.6 to 4.1.
PLAUSIBLE = (1.0, 8.0)
#: If the largest gravity torque over the arm's weight is below this [m], gravity loads no hinge.
SHORTEST_LEVER = 0.02
#: Default of the largest joint speed [rad/s] and of the largest joint acceleration [rad/s^2].
DEFAULT_SPEED, DEFAULT_ACCELERATION = 2.0, 10.0
#: Number of poses in which inertia and gravity are computed.
POSES = 64
#: Poses of a joint without a range are drawn within this distance of zero [rad].
FREE_RANGE = np.pi
#: Distance of the home pose from both ends of a joint's range, as a fraction of it.
HOME_MARGIN = 0.1
#: Limits of the change of the servo's fastest mode in a step (:func:`stiffest_mode`). A default
#: bandwidth is lowered to the first limit. A stated bandwidth beyond the second one is refused.
#: At 2 the servo is unstable.
MOST_PER_STEP, LIMIT_PER_STEP = 1.0, 1.5
#: Upper bound of a joint's rotation while a contact force builds up [rad]: 5 cm at 0.2 m.
PRESSING = 0.25
#: Default bandwidth of a servo [rad/s].
BANDWIDTH = 30.0


def joint_ids(model: mujoco.MjModel, joints: tuple[str, ...]) -> NDArray[np.int64]:
    """MuJoCo's ids of the named joints, shape (n,)."""
    return np.array([model.joint(name).id for name in joints])


def ranges(model: mujoco.MjModel, joints: tuple[str, ...]) -> tuple[Array, Array]:
    """Joint ranges [rad or m], shapes (n,); without a range +-pi, or +-0.5 m for a slide."""
    at = joint_ids(model, joints)
    limited = model.jnt_limited[at].astype(bool)
    slides = model.jnt_type[at] == mujoco.mjtJoint.mjJNT_SLIDE
    free = np.where(slides, 0.5, FREE_RANGE)
    low = np.where(limited, model.jnt_range[at, 0], -free)
    high = np.where(limited, model.jnt_range[at, 1], free)
    return low, high


def random_poses(model: mujoco.MjModel, joints: tuple[str, ...], count: int = POSES) -> Array:
    """Poses over the whole range, the same at each call [rad], shape (count, n)."""
    low, high = ranges(model, joints)
    middle, half = (low + high) / 2, np.minimum((high - low) / 2, FREE_RANGE)
    rng = np.random.default_rng(0)
    return np.asarray(middle + half * rng.uniform(-1, 1, (count, len(joints))))


def inertia_matrices(model: mujoco.MjModel, joints: tuple[str, ...], poses: Array) -> Array:
    """Joint-space inertia at each pose [kg m^2], shape (count, n, n)."""
    at = joint_ids(model, joints)
    adr, dof = model.jnt_qposadr[at], model.jnt_dofadr[at]
    data, full = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    out = np.empty((len(poses), len(at), len(at)))
    for k, pose in enumerate(poses):
        data.qpos[adr] = pose
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_makeM(model, data)
        mujoco.mj_fullM(model, data, full)
        out[k] = full[np.ix_(dof, dof)]
    return out


def holding_torque(model: mujoco.MjModel, joints: tuple[str, ...]) -> Array:
    """Largest gravity torque of each joint over the random poses [N m], shape (n,)."""
    at = joint_ids(model, joints)
    adr, dof = model.jnt_qposadr[at], model.jnt_dofadr[at]
    data, most, torque = mujoco.MjData(model), np.zeros(len(at)), np.zeros(model.nv)
    for pose in random_poses(model, joints):
        data.qpos[adr] = pose
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_rne(model, data, 0, torque)
        most = np.maximum(most, np.abs(torque[dof]))
    return most


def implausible_limit(model: mujoco.MjModel, joints: tuple[str, ...], limit: Array) -> str:
    """A warning about a file's torque limits [N m], shape (n,); "" if they are plausible.

    The strongest joint of a serial arm has a few times the gravity torque of the most loaded one.
    """
    hinge = model.jnt_type[joint_ids(model, joints)] == mujoco.mjtJoint.mjJNT_HINGE
    if not hinge.any():
        return ""
    needed = np.where(hinge, holding_torque(model, joints), 0.0)
    weight = float(np.linalg.norm(model.opt.gravity)) * float(model.body_mass.sum())
    held, most = int(np.argmax(needed)), int(np.argmax(np.where(hinge, limit, 0.0)))
    if needed[held] < SHORTEST_LEVER * weight:
        return ""  # gravity loads no joint: nothing to compare with
    low, high = PLAUSIBLE
    ratio = limit[most] / needed[held]
    if low <= ratio <= high:
        return ""
    return (
        f"; implausible: the largest limit, {limit[most]:.3g} N m at {joints[most]}, is "
        f"{ratio:.2g} times the largest gravity torque, {needed[held]:.2g} N m at {joints[held]} "
        "(cobots have 1.6 to 4.1 times): state torque_limit"
    )


def rotor_inertia(model: mujoco.MjModel, joints: tuple[str, ...], limit: Array) -> Array:
    """The file's rotor inertia at the joint [kg m^2], or a default (0 for slides), shape (n,)."""
    at = joint_ids(model, joints)
    given = model.dof_armature[model.jnt_dofadr[at]]
    hinge = model.jnt_type[at] == mujoco.mjtJoint.mjJNT_HINGE
    least = ROTOR_FRACTION * servo_inertia(model, joints)
    guess = np.where(np.isfinite(limit), ROTOR_PER_TORQUE * limit, least)
    return np.where(given > 0, given, np.where(hinge, guess, 0.0))


def largest_energy(
    model: mujoco.MjModel, joints: tuple[str, ...], speed: Array, limit: Array
) -> tuple[float, float]:
    """Energies that an arm can put into a contact [J]: kinetic energy, and work of its drives.

    The kinetic energy 1/2 v^T |M| v has the largest joint speeds, the worst signs and the worst of
    the random poses. The work is that of all drives at their limits over :data:`PRESSING`.
    """
    masses = np.abs(inertia_matrices(model, joints, random_poses(model, joints)))
    moving = 0.5 * float(np.einsum("i,kij,j->k", speed, masses, speed).max())
    return moving, float(PRESSING * np.where(np.isfinite(limit), limit, 0.0).sum())


def torque_limit(model: mujoco.MjModel, joints: tuple[str, ...], stated: Array) -> Array:
    """Torque limits [N m], shape (n,); a hinge without one gets the default (HOLDING_FACTOR)."""
    if np.isfinite(stated).all():
        return stated
    hinge = model.jnt_type[joint_ids(model, joints)] == mujoco.mjtJoint.mjJNT_HINGE
    most = servo_inertia(model, joints)
    dofs = model.jnt_dofadr[joint_ids(model, joints)]
    lost = model.dof_frictionloss[dofs] + model.dof_damping[dofs] * DEFAULT_SPEED
    spare = HOLDING_FACTOR * (holding_torque(model, joints) + lost) + SPARE_ACCELERATION * most
    return np.where(np.isfinite(stated) | ~hinge, stated, spare)


def servo_inertia(model: mujoco.MjModel, joints: tuple[str, ...]) -> Array:
    """Largest inertia at each joint over the poses [kg m^2], shape (n,)."""
    masses = inertia_matrices(model, joints, random_poses(model, joints))
    most: Array = masses.diagonal(axis1=1, axis2=2).max(axis=0)
    return most


def lightest_inertia(model: mujoco.MjModel, joints: tuple[str, ...]) -> Array:
    """Smallest inertia at a joint while the others are free: 1 / (M^-1)_ii, shape (n,)."""
    masses = inertia_matrices(model, joints, random_poses(model, joints))
    least: Array = 1 / np.linalg.inv(masses).diagonal(axis1=1, axis2=2).max(axis=0)
    return least


def stiffest_mode(
    model: mujoco.MjModel, joints: tuple[str, ...], kp: Array, kd: Array
) -> tuple[float, int]:
    """Change of the servo's fastest mode in a time step, and the joint that dominates it.

    With damping ``d`` and stiffness ``k`` per unit of inertia, an explicitly integrated servo is
    stable for ``d dt + k dt^2 / 2 < 2``. The first result is the largest such sum over the poses.
    """
    dt = float(model.opt.timestep)
    masses = inertia_matrices(model, joints, random_poses(model, joints))
    loop = np.diag(kd * dt + kp * dt * dt / 2)
    worst, joint = 0.0, 0
    for mass in masses:
        values, vectors = np.linalg.eig(np.linalg.solve(mass, loop))
        k = int(np.argmax(values.real))
        if values[k].real > worst:
            worst = float(values[k].real)
            shape = np.abs(vectors[:, k]) ** 2 * np.diag(loop)
            joint = int(np.argmax(shape))
    return worst, joint


def home_pose(model: mujoco.MjModel, joints: tuple[str, ...], tip: int) -> Array:
    """A home pose [rad], shape (n,): in front of the base, away from singular poses and limits.

    It is the best of fixed random poses away from the joint limits. The criterion is manipulability
    times a weight that is largest if the tool is in the middle of its reach, in front of the base.
    An arm of fewer than four joints gets the pose nearest to zero that is away from the limits.
    """
    at = joint_ids(model, joints)
    adr, dof = model.jnt_qposadr[at], model.jnt_dofadr[at]
    low, high = ranges(model, joints)
    inner_low, inner_high = low + HOME_MARGIN * (high - low), high - HOME_MARGIN * (high - low)
    if len(joints) < 4:
        return np.clip(np.zeros(len(joints)), inner_low, inner_high)
    near_low, near_high = np.maximum(inner_low, -2.0), np.minimum(inner_high, 2.0)
    empty = near_low >= near_high
    near_low, near_high = (
        np.where(empty, inner_low, near_low),
        np.where(empty, inner_high, near_high),
    )
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    jac_p, jac_r = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    poses = rng.uniform(near_low, near_high, (600, len(joints)))
    tips, scores = np.empty((len(poses), 3)), np.empty(len(poses))
    for k, pose in enumerate(poses):
        data.qpos[adr] = pose
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_jacBody(model, data, jac_p, jac_r, tip)
        base = data.xanchor[at[0]]
        tips[k] = data.xpos[tip] - base
        values = np.linalg.svd(np.vstack([jac_p, jac_r])[:, dof], compute_uv=False)
        clear = min(float((data.xpos[model.jnt_bodyid[j]] - base)[2]) for j in at[2:])
        scores[k] = np.prod(values[: min(6, len(at))]) * (clear > -0.05)
    reach = float(np.linalg.norm(tips, axis=1).max())
    flat = np.hypot(tips[:, 0], tips[:, 1]) / reach
    spot = (tips[:, 0] > 0) & (np.abs(tips[:, 1]) < 0.4 * reach) & (tips[:, 2] > 0.1 * reach)
    well = np.exp(-(((flat - 0.55) / 0.15) ** 2)) * np.where(spot, 1.0, 1e-3)
    return np.asarray(poses[int(np.argmax(scores * well))])
