"""The keywords of an environment, and their checks."""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from numbers import Real
from typing import Any

import numpy as np

from tauguard.arrays import Array
from tauguard.envs.episodes.motions import check_load
from tauguard.envs.gym.randomization import distributions
from tauguard.findings import ArgumentError, cause
from tauguard.models import (
    BODY_REGIONS,
    BodyProxy,
    Cloth,
    Mismatch,
    Person,
    Robot,
    SceneObject,
    Table,
    load_objects,
)
from tauguard.models.scene import INTEGRATORS

#: Control modes in native code's order; :mod:`tauguard.envs.gym.actions` states their units.
CONTROLS = ("current", "torque", "joint_velocity", "joint_position", "cartesian")
#: Types of the keywords that are not strings, and the text of their errors.
_SEVERAL = "one, or a tuple of them"
_KINDS: dict[str, tuple[Any, str]] = {
    "floor": (bool | Real, "True, False or a height [m]"),
    **dict.fromkeys(("timestep", "control_rate", "payload_g"), (Real, "a number")),
    **dict.fromkeys(("max_speed", "contact_area"), (Real | None, "a number or None")),
    "robot": (str | os.PathLike | Robot, "a name, a file or a Robot, also for two arms"),
    "table": (Table | None, "a tauguard.models.Table or None"),
    "cloth": (Cloth | None, "a tauguard.models.Cloth or None"),
    "checkers": (Iterable, _SEVERAL),
    "obstacles": (Iterable | BodyProxy | Person, _SEVERAL),
    "objects": (Iterable | SceneObject | os.PathLike, _SEVERAL),
}
#: Detectors that need no file.
DETECTORS = ("observer",)
#: Objects that leave the workspace go on, end the episode, or begin again where they started.
LEAVING = (None, "end", "reset")
#: Name of the obstacle that is a whole person.
PERSON = "person"


@dataclass(frozen=True)
class Settings:
    """The keywords of every environment.

    Attributes:
        control: one of :data:`CONTROLS`.
        control_rate: actions per second [Hz].
        timestep: time step of the physics [s].
        integrator: integrator of the physics.
        robot: a name, a robot file or a ``Robot``, see ``tauguard robot``.
        payload_g: load at the flange, unknown to controller and detector [g].
        mismatch: difference between the simulated and the nominal arm, or the seed to draw it.
        obstacles: "person", names of body regions, or :class:`BodyProxy` and :class:`Person`.
        table: a board that the arm can touch.
        cloth: a hanging cloth.
        objects: your own objects, or the TOML file that lists them.
        detector: one of :data:`DETECTORS`, a model file, or a ``CollisionAlarm``.
        checkers: names of contact checkers that check every physics step.
        labels: contact sensors; without them force, cost and tau_ext stay 0.
        noise: whether observations are measured instead of true positions, speeds and currents.
        ideal_drive: no friction, ripple, lag or sensor errors.
        max_speed: largest speed of every joint [rad/s]; default: the arm's own, else 2.
        randomize: quantities drawn in each episode, see :mod:`tauguard.envs.gym.randomization`.
        contact_area: area of the robot's contact surface [cm^2], if known.
        floor: whether free objects fall onto a floor, or its height [m]. True: people's floor;
            without people the base's height, or :attr:`Person.floor` if an object is below that.
        leaving: what an object does that leaves the workspace: one of :data:`LEAVING`.
        workspace: its corners ((x, y, z), (x, y, z)) [m]; default: 1.5 times the arm's reach about
            the base, and down to 0.3 m below it.
    """

    control: str = "joint_velocity"
    control_rate: float = 100.0
    timestep: float = 1e-3
    integrator: str = "implicitfast"
    robot: str | Robot = "cura6"
    payload_g: float = 0.0
    mismatch: Mismatch | int | None = None
    obstacles: tuple[str | BodyProxy | Person, ...] = ()
    table: Table | None = None
    cloth: Cloth | None = None
    objects: tuple[SceneObject, ...] = ()
    detector: Any = None
    checkers: tuple[str, ...] = ()
    labels: bool = True
    noise: bool = False
    ideal_drive: bool = False
    max_speed: float | None = None
    randomize: Mapping[str, Any] | None = None
    contact_area: float | None = None
    floor: bool | float = True
    leaving: str | None = None
    workspace: Any = None

    def __post_init__(self) -> None:
        """Check the values; an ``ArgumentError`` names the wrong one and what would work."""
        for name, (kind, words) in _KINDS.items():
            if not isinstance(getattr(self, name), kind):
                raise ArgumentError(f"{name} {getattr(self, name)!r}: expected {words}")
        one_of("control", self.control, CONTROLS)
        one_of("integrator", self.integrator, tuple(INTEGRATORS))
        for name in ("timestep", "control_rate"):
            positive(name, getattr(self, name))
        for name in ("max_speed", "contact_area"):
            if getattr(self, name) is not None:
                positive(name, getattr(self, name))
        steps = 1 / (self.control_rate * self.timestep)
        if round(steps) < 1 or abs(steps - round(steps)) > 1e-6:
            raise ArgumentError(
                f"control_rate {self.control_rate} Hz at a timestep of {self.timestep} s: "
                f"{steps:g} physics steps per action; expected a whole number, 1 or more"
            )
        check_load(self.payload_g)
        if isinstance(self.mismatch, int):
            object.__setattr__(self, "mismatch", Mismatch(seed=self.mismatch))
        if not (self.mismatch is None or isinstance(self.mismatch, Mismatch)):
            raise ArgumentError(f"mismatch {self.mismatch!r}: expected a Mismatch, a seed, or None")
        for name in ("obstacles", "checkers"):
            value = getattr(self, name)
            one = isinstance(value, str | BodyProxy | Person)
            object.__setattr__(self, name, (value,) if one else tuple(value))
        _check_obstacles(self.obstacles)
        object.__setattr__(self, "objects", _objects(self.objects))
        one_of("leaving", self.leaving, LEAVING)
        if self.workspace is not None:
            object.__setattr__(self, "workspace", _corners(self.workspace))
        object.__setattr__(self, "randomize", distributions(self.randomize or {}))
        if isinstance(self.detector, os.PathLike):
            object.__setattr__(self, "detector", os.fspath(self.detector))
        named = isinstance(self.detector, str) and self.detector not in DETECTORS
        if named and not os.path.isfile(self.detector):
            raise ArgumentError(
                f"detector {self.detector!r}: no such model file; expected "
                f"{', '.join(DETECTORS)}, the path of a trained detector, or None"
            )

    @property
    def substeps(self) -> int:
        """Number of physics steps per action."""
        return round(1 / (self.control_rate * self.timestep))

    @classmethod
    def from_keywords(
        cls, defaults: Mapping[str, Any], given: Mapping[str, Any], others: Iterable[str] = ()
    ) -> Settings:
        """The settings of an environment: its defaults, replaced by the user's keywords.

        Raises:
            ArgumentError: an unknown keyword; the message lists the known ones and ``others``.
        """
        known = [*(field.name for field in fields(cls)), *others]
        for name in given:
            if name not in known:
                near = difflib.get_close_matches(name, known, n=1)
                hint = f"did you mean {near[0]}? " if near else ""
                text = f"keyword {name!r}: {hint}expected one of {', '.join(known)}"
                raise ArgumentError(cause("keyword", text))
        return cls(**{**defaults, **given})


def _check_obstacles(obstacles: tuple[Any, ...]) -> None:
    known = (PERSON, *BODY_REGIONS)
    for item in obstacles:
        if not isinstance(item, BodyProxy | Person) and item not in known:
            raise ArgumentError(f"obstacles: {item!r}; expected some of {', '.join(known)}")
    if obstacles.count(PERSON) > 1:
        raise ArgumentError("obstacles: 'person' twice; add further people as Person(position=...)")


def _objects(value: Any) -> tuple[SceneObject, ...]:
    if isinstance(value, str | os.PathLike):
        return load_objects(os.fspath(value))
    found = (value,) if isinstance(value, SceneObject) else tuple(value)
    for item in found:
        if not isinstance(item, SceneObject):
            raise ArgumentError(f"objects: {item!r}; expected SceneObjects, or a TOML file of them")
    names = [item.name for item in found]
    if len(set(names)) < len(names):
        raise ArgumentError(f"objects: {', '.join(names)}; expected each name once")
    return found


def _corners(value: Any) -> Array:
    """The lower and the upper corner of a box [m], shape (2, 3)."""
    try:
        corners = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        corners = np.zeros(0)
    if corners.shape != (2, 3) or not (corners[0] < corners[1]).all():
        raise ArgumentError(f"workspace {value!r}: expected a lower and an upper corner [m]")
    return corners


def one_of(name: str, value: object, known: tuple[str | None, ...]) -> None:
    """Raise an ``ArgumentError`` that lists ``known`` if ``value`` is not among them."""
    if value not in known:
        raise ArgumentError(f"{name} {value!r}: expected one of {', '.join(map(str, known))}")


def positive(name: str, value: float) -> None:
    """Raise an ``ArgumentError`` unless ``value`` is finite and above 0."""
    if not (np.isfinite(value) and value > 0):
        raise ArgumentError(f"{name} {value}: expected a finite number above 0")
