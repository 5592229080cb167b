"""For users of dm_control: the arm as a composer entity, and environments for ``dm_env``.

dm_control has no wheels for Python 3.13 and later; there, this module raises ``ImportError``.
"""

import warnings
from typing import Any
from xml.etree import ElementTree

import gymnasium
import mujoco
import numpy as np
from gymnasium import spaces

from tauguard.arrays import Array
from tauguard.findings import ArgumentError
from tauguard.models import load_arm
from tauguard.models.mjcf import xml_text

try:
    import dm_env

    with warnings.catch_warnings():  # of glfw, where there is no display
        warnings.filterwarnings("ignore", module="glfw")
        from dm_control.mujoco.wrapper.mjbindings import sizes
    from dm_env import specs
except ImportError as error:
    raise ImportError(
        "dm_control is not installed: it has wheels for Python 3.12 and earlier only"
    ) from error
# dm_control 1.0.50 lists arrays that MuJoCo 4 no longer has, and reads all of them.
for _name, _kind in (("mjmodel", mujoco.MjModel), ("mjdata", mujoco.MjData)):
    _table = sizes.array_sizes[_name]
    for _field in [field for field in _table if not hasattr(_kind, field)]:
        del _table[_field]

with warnings.catch_warnings():
    warnings.filterwarnings("ignore", module="glfw")
    from dm_control import composer, mjcf  # only after the arrays were removed
    from dm_control.composer.observation import observable

__all__ = ["ArmEntity", "DmEnvironment"]

#: Elements that can have their own pose inside a frame.
_PLACED = ("body", "geom", "site", "camera", "light", "inertial", "joint")


class ArmEntity(composer.Entity):  # type: ignore[misc]
    """A serial arm with one torque motor per joint.

    The observables are ``joint_positions`` [rad], ``joint_velocities`` [rad/s] and
    ``joint_torques`` (of the motors, N m), each of shape (n,).
    """

    def _build(self, arm: str = "cura6", name: str | None = None) -> None:
        """Build from ``arm``: ``cura6``, or an MJCF or URDF file with one serial arm.

        Raises:
            ArgumentError: not an arm, see :func:`tauguard.models.load_arm`.
            FileNotFoundError: no such file.
        """
        source = load_arm(arm)
        source.spec.compile()
        self._root = mjcf.from_xml_string(without_frames(xml_text(source.spec)))
        self._root.model = name or "arm"
        self._joints = [self._root.find("joint", joint) for joint in source.joints]
        self.home: np.ndarray = source.home
        for joint, limit in zip(self._joints, source.torque_limit, strict=True):
            bounded = {"ctrlrange": [-limit, limit]} if np.isfinite(limit) else {}
            self._root.actuator.add("motor", name=joint.name, joint=joint, **bounded)
        self._flange = self._root.find("site", source.flange().name)

    def _build_observables(self) -> composer.Observables:
        return ArmObservables(self)

    def initialize_episode(self, physics: mjcf.Physics, random_state: Any) -> None:
        """Put the arm into its home pose, at rest."""
        del random_state
        physics.bind(self._joints).qpos = self.home
        physics.bind(self._joints).qvel = 0.0

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        """The arm's MJCF."""
        return self._root

    @property
    def joints(self) -> list[mjcf.Element]:
        """The joints from base to tip."""
        return self._joints

    @property
    def actuators(self) -> list[mjcf.Element]:
        """The motors in the order of :attr:`joints`; the control of a motor is a torque [N m]."""
        return list(self._root.find_all("actuator"))

    @property
    def flange(self) -> mjcf.Element | None:
        """The site of the tool flange; ``None`` if the file has none."""
        return self._flange


class ArmObservables(composer.Observables):  # type: ignore[misc]
    """The observables of an :class:`ArmEntity`."""

    @composer.observable  # type: ignore[untyped-decorator]
    def joint_positions(self) -> observable.MJCFFeature:
        """Joint positions [rad]."""
        return observable.MJCFFeature("qpos", self._entity.joints)

    @composer.observable  # type: ignore[untyped-decorator]
    def joint_velocities(self) -> observable.MJCFFeature:
        """Joint velocities [rad/s]."""
        return observable.MJCFFeature("qvel", self._entity.joints)

    @composer.observable  # type: ignore[untyped-decorator]
    def joint_torques(self) -> observable.MJCFFeature:
        """Torque of the motors [N m]."""
        return observable.MJCFFeature("qfrc_actuator", self._entity.joints)


def without_frames(xml: str) -> str:
    """The same MJCF without frames: each frame's pose is applied to its elements.

    Args:
        xml: text written by MuJoCo, with orientations as quaternions.

    Raises:
        ArgumentError: an orientation in a frame is not a quaternion.
    """
    root = ElementTree.fromstring(xml)
    world = root.find("worldbody")
    if world is not None:
        _flatten(world)
    return ElementTree.tostring(root, encoding="unicode")


def _flatten(parent: ElementTree.Element) -> None:
    for child in list(parent):
        _flatten(child)
        if child.tag != "frame":
            continue
        at = list(parent).index(child)
        parent.remove(child)
        pos, quat = _pose(child)
        for offset, part in enumerate(list(child)):
            _place(part, pos, quat)
            parent.insert(at + offset, part)


def _pose(element: ElementTree.Element) -> tuple[Array, Array]:
    for name in ("euler", "axisangle", "xyaxes", "zaxis"):
        if element.get(name) is not None:
            raise ArgumentError(f"<{element.tag} {name}>: expected a quaternion inside a frame")
    pos = np.array(element.get("pos", "0 0 0").split(), dtype=float)
    quat = np.array(element.get("quat", "1 0 0 0").split(), dtype=float)
    return pos, quat / np.linalg.norm(quat)


def _place(part: ElementTree.Element, pos: Array, quat: Array) -> None:
    """Apply the frame's pose to the pose of ``part``."""
    if part.tag not in _PLACED:
        return
    if part.get("fromto") is not None:
        ends = np.array(part.attrib["fromto"].split(), dtype=float).reshape(2, 3)
        part.set("fromto", _text(np.concatenate([_moved(end, pos, quat) for end in ends])))
        return
    own, turn = _pose(part)
    whole = np.zeros(4)
    mujoco.mju_mulQuat(whole, quat, turn)
    part.set("pos", _text(_moved(own, pos, quat)))
    if part.tag == "joint":
        axis = np.array(part.get("axis", "0 0 1").split(), dtype=float)
        part.set("axis", _text(_moved(axis, np.zeros(3), quat)))
    elif part.tag != "light":
        part.set("quat", _text(whole))


def _moved(point: Array, pos: Array, quat: Array) -> Array:
    out = np.zeros(3)
    mujoco.mju_rotVecQuat(out, point, quat)
    return out + pos


def _text(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values)


class DmEnvironment(dm_env.Environment):  # type: ignore[misc]
    """A Gymnasium environment with the interface of ``dm_env``.

    A truncated episode ends with discount 1, a terminated one with discount 0, as ``dm_env``
    defines it. :attr:`info` holds Gymnasium's ``info``.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], seed: int | None = None) -> None:
        """Wrap ``env``, with Box, Discrete or Dict spaces.

        Args:
            env: a Gymnasium environment.
            seed: seed of the first episode.

        Raises:
            ArgumentError: ``env`` has a space of another kind.
        """
        self._env, self._seed, self._over = env, seed, True
        self._observation_spec = _spec(env.observation_space, "observation")
        self._action_spec = _spec(env.action_space, "action")
        self.info: dict[str, Any] = {}

    def reset(self) -> dm_env.TimeStep:
        """Begin an episode."""
        observation, self.info = self._env.reset(seed=self._seed)
        self._seed, self._over = None, False
        return dm_env.restart(observation)

    def step(self, action: Any) -> dm_env.TimeStep:
        """Apply the action; the first step after the end of an episode resets instead."""
        if self._over:
            return self.reset()
        observation, reward, terminated, truncated, self.info = self._env.step(action)
        self._over = terminated or truncated
        if terminated:
            return dm_env.termination(float(reward), observation)
        if truncated:
            return dm_env.truncation(float(reward), observation)
        return dm_env.transition(float(reward), observation)

    def observation_spec(self) -> Any:
        """Spec of the observation: an array spec, or a dictionary of array specs."""
        return self._observation_spec

    def action_spec(self) -> Any:
        """Spec of the action."""
        return self._action_spec

    def close(self) -> None:
        """Close the wrapped environment."""
        self._env.close()


def _spec(space: gymnasium.Space[Any], name: str) -> Any:
    if isinstance(space, spaces.Dict):
        return {key: _spec(part, key) for key, part in space.spaces.items()}
    if isinstance(space, spaces.Box):
        return specs.BoundedArray(space.shape, space.dtype, space.low, space.high, name)
    if isinstance(space, spaces.Discrete):
        if space.start != 0:
            raise ArgumentError(f"{name}: a Discrete space from {space.start}; expected one from 0")
        return specs.DiscreteArray(int(space.n), np.int64, name)
    raise ArgumentError(f"{name}: a {type(space).__name__} space; expected Box, Discrete or Dict")
