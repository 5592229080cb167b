"""Quantities that are drawn for each episode: distributions, and their effect on one copy."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from tauguard.arrays import Array
from tauguard.findings import ArgumentError
from tauguard.models import Drive, Person, Scene
from tauguard.models.obstacles import pair_weights
from tauguard.models.payload import keep_stiffness, load_body

if TYPE_CHECKING:
    from tauguard.envs.gym.compiled import CompiledScene


@dataclass(frozen=True)
class Normal:
    """A normal distribution, clipped to ``low`` and ``high``."""

    mean: float
    deviation: float
    low: float = -np.inf
    high: float = np.inf

    def draw(self, rng: np.random.Generator, size: int) -> Array:
        """Draw ``size`` values."""
        return np.clip(rng.normal(self.mean, self.deviation, size), self.low, self.high)

    def ends(self) -> tuple[float, float]:
        """Least and largest value."""
        return self.low, self.high


@dataclass(frozen=True)
class Uniform:
    """Uniform between ``low`` and ``high``; a pair of numbers means the same."""

    low: float
    high: float

    def draw(self, rng: np.random.Generator, size: int) -> Array:
        """Draw ``size`` values."""
        return rng.uniform(self.low, self.high, size)

    def ends(self) -> tuple[float, float]:
        """Least and largest value."""
        return self.low, self.high


@dataclass(frozen=True)
class Choice:
    """One of several equally likely values."""

    values: tuple[float, ...]

    def draw(self, rng: np.random.Generator, size: int) -> Array:
        """Draw ``size`` values."""
        return rng.choice(np.array(self.values, dtype=np.float64), size)

    def ends(self) -> tuple[float, float]:
        """Least and largest value."""
        return min(self.values), max(self.values)


Distribution = Normal | Uniform | Choice


@dataclass(frozen=True)
class Parameter:
    """The range of a quantity that ``randomize`` can draw."""

    low: float
    high: float
    each: bool = False  #: one draw for each joint or link


PARAMETERS = {
    "mass": Parameter(0.1, 10.0, True),  # of each link (and its inertia) divided by the nominal one
    "gain": Parameter(0.1, 10.0, True),  # of each drive, divided by what the controller assumes
    "friction": Parameter(0.0, 10.0, True),  # of each joint, divided by its nominal friction
    "temperature": Parameter(-20.0, 100.0),  # of the joints [degC]
    "noise": Parameter(0.0, 100.0),  # of the sensors, divided by their nominal noise
    "payload_g": Parameter(0.0, 1e6),  # carried mass [g]
    "stature": Parameter(1.0, 2.3),  # of the person [m]
    "hand_speed": Parameter(0.01, 5.0),  # of the person's reaches [m/s]
    "walk_speed": Parameter(0.01, 5.0),  # of the person's walks [m/s]
    "reaction_time": Parameter(0.0, 10.0),  # of the person [s]
}
_OF_PERSON = ("stature", "hand_speed", "walk_speed", "reaction_time")


def distributions(given: Mapping[str, Any]) -> dict[str, Distribution]:
    """Check the keyword ``randomize``, and convert its values to distributions.

    Raises:
        ArgumentError: an unknown name or a value out of range; the message says what would work.
    """
    if not isinstance(given, Mapping):
        raise ArgumentError(
            f"randomize: a {type(given).__name__}; expected a dict such as {{'mass': (0.9, 1.1)}}"
        )
    found: dict[str, Distribution] = {}
    for name, value in given.items():
        if name not in PARAMETERS:
            raise ArgumentError(f"randomize: {name!r}; expected some of {', '.join(PARAMETERS)}")
        spread = _distribution(name, value)
        _in_range(f"randomize: {name}", name, np.array(spread.ends()))
        found[name] = spread
    return found


def _distribution(name: str, value: Any) -> Distribution:
    if isinstance(value, Normal | Uniform | Choice):
        spread: Distribution = value
    else:
        pair = _numbers(value)
        if len(pair) not in (1, 2):
            raise ArgumentError(
                f"randomize: {name} {value!r}; expected a number, (low, high), or a Uniform, "
                "Normal or Choice of tauguard.envs.gym.randomization"
            )
        spread = Uniform(float(pair[0]), float(pair[-1]))
    parameter = PARAMETERS[name]
    if isinstance(spread, Normal):
        spread = replace(
            spread, low=max(spread.low, parameter.low), high=min(spread.high, parameter.high)
        )
    low, high = spread.ends()
    if not low <= high:
        raise ArgumentError(f"randomize: {name} from {low} to {high}; expected low <= high")
    return spread


def _numbers(value: Any) -> Array:
    """The number or numbers in ``value``, shape (k,); shape (0,) if it is anything else."""
    try:
        row = np.atleast_1d(np.asarray(value, dtype=np.float64))
    except (TypeError, ValueError):
        return np.zeros(0)
    return row if row.ndim == 1 else np.zeros(0)


def _in_range(where: str, name: str, values: Array) -> None:
    low, high = PARAMETERS[name].low, PARAMETERS[name].high
    if not (np.isfinite(values) & (values >= low) & (values <= high)).all():
        raise ArgumentError(f"{where} {values.tolist()}: expected {low:g} to {high:g}")


def check_names(
    names: Iterable[str], people: tuple[Person, ...], checkers: tuple[str, ...]
) -> None:
    """Check that the scene has what ``randomize`` draws.

    Raises:
        ArgumentError: a quantity of people without a person, or stature with checkers.
    """
    for name in names:
        if name in _OF_PERSON and not people:
            raise ArgumentError(f"randomize: {name!r} without a person; add obstacles=('person',)")
        if name == "stature" and checkers:
            raise ArgumentError(
                "randomize: 'stature' with checkers: they support only one size of the person"
            )


def check_options(
    given: Mapping[str, Any], known: Mapping[str, Distribution], others: Iterable[str]
) -> None:
    """Check the names and values of ``reset(options=...)``; the caller checks ``others``.

    Raises:
        ArgumentError: a name that ``randomize`` lacks, or a value out of range.
    """
    for name, value in given.items():
        if name not in known:
            hint = f"expected some of {', '.join([*others, *known])}"
            if name in PARAMETERS:
                hint += f"; name it in randomize= first, such as randomize={{{name!r}: (1, 1)}}"
            raise ArgumentError(f"options: unknown {name!r}; {hint}")
        numbers = _numbers(value)
        if not len(numbers):
            raise ArgumentError(f"options: {name} {value!r}; expected a number, or one per joint")
        _in_range(f"options: {name}", name, numbers)


def draw(
    known: Mapping[str, Distribution],
    compiled: CompiledScene,
    rng: np.random.Generator,
    stated: Mapping[str, Any],
) -> dict[str, Array]:
    """The values of one episode; ``stated`` values replace drawn ones.

    All values are drawn, so that ``stated`` does not change later draws.
    """
    n, found = len(compiled.scene.joint_names), {}
    for name, spread in known.items():
        size = n if PARAMETERS[name].each else 1
        values = spread.draw(rng, size)
        if name in stated:
            own = _numbers(stated[name])
            if len(own) not in (1, size):
                raise ArgumentError(f"options: {name}: {len(own)} values; expected 1 or {size}")
            values = np.resize(own, size)
        found[name] = values
    return found


@dataclass
class Variant:
    """Model, drive and people of one copy; they replace those of the compiled scene."""

    model: mujoco.MjModel
    drive: Drive
    people: tuple[Person, ...]


def vary(compiled: CompiledScene, model: mujoco.MjModel, drawn: Mapping[str, Array]) -> Variant:
    """Write the drawn values into ``model``, the model of one copy."""
    base = compiled.scene.model
    _weigh(compiled.scene, base, model, drawn)
    own: dict[str, Any] = {name: float(drawn[name][0]) for name in _OF_PERSON if name in drawn}
    people = tuple(replace(person, **own) for person in compiled.people)
    for number, person in enumerate(people):
        _resize(model, person, number)
    return Variant(model, _drive(compiled.scene.drive, drawn), people)


def _weigh(
    scene: Scene, base: mujoco.MjModel, model: mujoco.MjModel, drawn: Mapping[str, Array]
) -> None:
    """Set the masses of links and payload; contact pairs keep their stated stiffness."""
    if "mass" not in drawn and "payload_g" not in drawn:
        return
    scale = drawn.get("mass", np.ones(len(scene.link_bodies)))
    bodies = scene.link_bodies
    model.body_mass[bodies] = base.body_mass[bodies] * scale
    model.body_inertia[bodies] = base.body_inertia[bodies] * scale[:, None]
    if "payload_g" in drawn:
        load_body(model, scene.payload_body, float(drawn["payload_g"][0]) / 1000)
    keep_stiffness(model, pair_weights(base), base.pair_solref)


def _resize(model: mujoco.MjModel, person: Person, number: int) -> None:
    for part in person.parts(number):
        geom, segment = model.geom(part.name).id, part.segment
        radius, half = segment.radius * person.stature, segment.half * person.stature
        model.geom_size[geom, :2] = radius, half
        model.geom_rbound[geom] = radius + half
        model.geom_aabb[geom, 3:] = radius, radius, radius + half


def _drive(drive: Drive, drawn: Mapping[str, Array]) -> Drive:
    friction, sensors = drive.friction, drive.sensors
    if friction is not None and "friction" in drawn:
        scale = drawn["friction"]
        names = ("coulomb", "static", "viscous")
        friction = replace(friction, **{name: getattr(friction, name) * scale for name in names})
    if friction is not None and "temperature" in drawn:
        friction = replace(friction, temperature=float(drawn["temperature"][0]))
    if sensors is not None and "noise" in drawn:
        loud = float(drawn["noise"][0])
        sensors = replace(
            sensors,
            current_noise=sensors.current_noise * loud,
            velocity_noise=sensors.velocity_noise * loud,
        )
    gain = drive.gain * drawn["gain"] if "gain" in drawn else drive.gain
    return replace(drive, gain=gain, friction=friction, sensors=sensors)


def own_model(compiled: CompiledScene) -> mujoco.MjModel:
    """A copy of the model, for one environment to change."""
    return copy.copy(compiled.scene.model)
