"""An episode: one run of the arm, described completely by plain values and a seed."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from dataclasses import dataclass
from typing import Any

from tauguard.envs.episodes.motions import check_load, check_percent
from tauguard.findings import ArgumentError
from tauguard.models import Mismatch, SceneObject
from tauguard.traces import KINDS


@dataclass(frozen=True)
class CollisionPlan:
    """A collision to inject; the episode's seed determines its point and direction.

    Attributes:
        kind: "strike" (a moving obstacle), "clamp" (a fixed one) or "pulse" (a wrench pulse).
        time: earliest time of the collision [s].
        link: 1-based link to strike.
        severity: wanted range (low, high) of the peak of abs(tau_ext) over joints 1 to 4 [N m]. The
            strength is varied until the achieved peak is in this range.
        strength: first guess of the strength: speed of a strike [m/s], depth of a clamp [m, 0.03 or
            more], force of a pulse [N].
        duration: duration of a pulse or of a clamp [s]; not used for a strike.
        at_rest: a pulse or strike begins while the arm dwells, if it dwells soon after ``time``.
        force: wanted peak contact force (low, high) [N]; targets whose lever arms cannot give
            ``severity`` at such a force are skipped.
    """

    kind: str
    time: float
    link: int
    severity: tuple[float, float] | None = None
    strength: float | None = None
    duration: float = 0.1
    at_rest: bool = False
    force: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        """Check the values: ``ArgumentError`` names what is wrong and what would work."""
        if self.kind not in KINDS:
            raise ArgumentError(f"kind {self.kind!r}: expected one of {', '.join(KINDS)}")
        if self.link < 1:
            raise ArgumentError(f"link {self.link}: links are counted from 1")
        if not 0 < self.duration < math.inf:
            raise ArgumentError(f"duration {self.duration}: expected seconds above 0")
        if self.strength is not None and not math.isfinite(self.strength):
            raise ArgumentError(f"strength {self.strength}: expected a finite number")
        for name, unit in (("severity", "N m"), ("force", "N")):
            span = getattr(self, name)
            if span is not None and not 0 < span[0] < span[1]:
                raise ArgumentError(f"{name} {span}: expected 0 < low < high [{unit}]")


@dataclass(frozen=True)
class PayloadPick:
    """A payload picked up (or put down: 0 g) at a time; the observer does not get its mass."""

    time: float  #: [s]
    payload_g: float  #: mass from then on [g]


@dataclass(frozen=True)
class Episode:
    """One run of the arm at work."""

    seed: int
    seconds: float = 20.0  #: length [s]
    speed: float = 30.0  #: percent of the joints' largest speeds, above 1 and at most 100
    payload_g: float = 0.0  #: carried from the start; the observer does not get it [g]
    collisions: tuple[CollisionPlan, ...] = ()
    picks: tuple[PayloadPick, ...] = ()
    mismatch: Mismatch | None = None  #: how the simulated arm differs from the nominal one
    temperature: float | None = None  #: of the gears [degC]; None: the drive's default
    ideal_drive: bool = False  #: no friction, ripple, lag or sensor errors
    timestep: float = 1e-3  #: [s]
    arm: str = "cura6"  #: a name or a file, see :func:`tauguard.models.load_arm`
    objects: tuple[SceneObject, ...] = ()  #: your own objects around the arm

    def __post_init__(self) -> None:
        """Check the values: ``ArgumentError`` names what is wrong and what would work."""
        for name in ("seconds", "timestep"):
            value = getattr(self, name)
            if not 0 < value < math.inf:
                raise ArgumentError(f"{name} {value}: expected more than 0 and finite")
        if self.seconds < 2 * self.timestep:
            raise ArgumentError(f"seconds {self.seconds}: expected two steps of {self.timestep} s")
        if self.temperature is not None and not math.isfinite(self.temperature):
            raise ArgumentError(f"temperature {self.temperature}: expected a finite number of degC")
        check_percent(self.speed)
        for load in (self.payload_g, *(pick.payload_g for pick in self.picks)):
            check_load(load)
        times = [plan.time for plan in self.collisions] + [pick.time for pick in self.picks]
        for time in times:
            if not 0 <= time < self.seconds:
                raise ArgumentError(f"time {time}: outside the episode (0 to {self.seconds} s)")

    def to_json(self) -> str:
        """The episode as JSON text, for :meth:`from_json`."""
        values = dataclasses.asdict(self)
        if not self.objects:  # then the text and its hash are the same as in earlier versions
            del values["objects"]
        return json.dumps(values, sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> Episode:
        """The episode in a text of :meth:`to_json`.

        Raises:
            ArgumentError: not JSON, or an unknown key.
        """
        try:
            values: dict[str, Any] = json.loads(text)
        except json.JSONDecodeError as error:
            raise ArgumentError(f"episode: not JSON ({error})") from None
        known = {f.name for f in dataclasses.fields(cls)}
        if unknown := sorted(values.keys() - known):
            raise ArgumentError(f"episode: unknown keys {unknown}; known: {sorted(known)}")
        values["collisions"] = tuple(
            CollisionPlan(
                **{**c, **{k: tuple(c[k]) for k in ("severity", "force") if c.get(k) is not None}}
            )
            for c in values.get("collisions", ())
        )
        values["objects"] = tuple(SceneObject(**o) for o in values.get("objects", ()))
        values["picks"] = tuple(PayloadPick(**p) for p in values.get("picks", ()))
        if values.get("mismatch") is not None:
            values["mismatch"] = Mismatch(**values["mismatch"])
        return cls(**values)

    @property
    def config_hash(self) -> str:
        """SHA-256 of the JSON form."""
        return hashlib.sha256(self.to_json().encode()).hexdigest()
