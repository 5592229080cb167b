"""A person made of capsules, one for each body region, sized by stature.

Lengths are fractions of the stature after Drillis & Contini, "Body Segment Parameters" (1966), as
in Winter, "Biomechanics and Motor Control of Human Movement", figure 4.1. Statures are those of
Huston, "Principles of Biomechanics" (2009). The radii are estimates from girths of adults (no
source was found): verify them if a clearance depends on them.

Each capsule is a body with its region's effective mass. Three slide joints with weak springs
connect it to a frame (a MuJoCo mocap body) that follows the person's motion exactly. So an impact
has the two masses and the spring of ISO 10218-2, and the standard's peak force. Fixed to the frame,
a capsule would have infinite mass: the peak force between a hand and an arm of 4 kg would be 2.8
times too high. The effective mass of a chain of driven links would depend on the pose, and the
limits do not hold for that. Pelvis and legs carry the person and have no such joints. As they have
40 to 75 kg, their force on an arm of 5 kg is at most 6 % too high.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from tauguard.findings import ArgumentError
from tauguard.models.body_regions import BodyRegion, body_region
from tauguard.models.checks import above_zero, not_negative

#: Statures of adults by sex and percentile [m].
STATURES = {
    "female 5": 1.518, "female 50": 1.618, "female 95": 1.724,
    "male 5": 1.649, "male 50": 1.759, "male 95": 1.869,
}  # fmt: skip
POSTURES = ("standing", "seated")
#: Motions of a person: reach and walk, reach in place, or stand with hanging arms.
MOTIONS = ("walk", "work", "still")
#: Lengths in units of the stature. Trunk: from hip to shoulder; grip: from wrist to palm.
LENGTHS = {
    "hip": 0.530, "trunk": 0.288, "shoulder": 0.1295, "hip_half": 0.055, "neck": 0.052,
    "head": 0.130, "upper_arm": 0.186, "lower_arm": 0.146, "hand": 0.108, "grip": 0.054,
    "thigh": 0.245, "shank": 0.246, "foot": 0.039,
}  # fmt: skip
#: Least stiffness of a region's springs [N/m]: that of a hand held still (Mussa-Ivaldi, Hogan &
#: Bizzi 1985). Least natural frequency on the springs [rad/s], much slower than an impact, and
#: fraction of critical damping (both are estimates).
GIVE_STIFFNESS, GIVE_FREQUENCY, GIVE_DAMPING = 300.0, 2 * np.pi, 0.5


@dataclass(frozen=True)
class Segment:
    """One capsule; lengths in units of the stature."""

    name: str
    region: str
    half: float  #: half length of the capsule's straight part
    radius: float
    height: float  #: height of the centre above the floor, standing
    gives: bool = True  #: on springs, so that it yields to a force


def _limbs(side: str) -> tuple[Segment, ...]:
    half = {
        name: LENGTHS[name] / 2 for name in ("upper_arm", "lower_arm", "hand", "thigh", "shank")
    }
    return (
        Segment(f"{side}_upper_arm", "upper_arm", half["upper_arm"], 0.030, 0.725),
        Segment(f"{side}_lower_arm", "lower_arm", half["lower_arm"], 0.023, 0.6),
        Segment(f"{side}_hand", "hand", half["hand"] - 0.018, 0.018, 0.5),
        Segment(f"{side}_thigh", "thigh", half["thigh"], 0.048, 0.41, gives=False),
        Segment(f"{side}_lower_leg", "lower_leg", half["shank"], 0.033, 0.16, gives=False),
    )


#: In the order of the capsules in envs/src/anatomy.hpp; left and right are the person's own.
SEGMENTS = (
    Segment("skull", "skull", 0.020, 0.047, 0.93),
    Segment("neck", "neck", 0.020, 0.034, 0.84),
    Segment("chest", "chest", 0.045, 0.070, 0.75),
    Segment("abdomen", "abdomen", 0.025, 0.066, 0.64),
    Segment("pelvis", "pelvis", 0.036, 0.066, 0.54, gives=False),
    *_limbs("left"),
    *_limbs("right"),
)


@dataclass(frozen=True)
class Person:
    """One person; all fields have defaults."""

    position: tuple[float, float] = (1.0, 0.0)  #: work place: the point below the hips [m]
    facing: float = np.pi  #: heading about z [rad]; 0: along x
    floor: float = -0.75  #: height of the floor: the arm stands on a bench [m]
    stature: float = STATURES["male 50"]  #: [m]
    posture: str = "standing"  #: one of :data:`POSTURES`
    motion: str = "walk"  #: one of :data:`MOTIONS`; a seated person does not walk
    hand_speed: float = 1.6  #: peak speed of a reach [m/s], from ISO 13855
    walk_speed: float = 1.0  #: peak speed of a walk [m/s]
    reacts: bool = True  #: whether they draw back after a touch
    reaction_time: float = 0.2  #: from touch to motion [s]
    damping: float = 0.0  #: of the contacts [N s/m]; the standard's spring has none

    def __post_init__(self) -> None:
        """Check the values: ``ArgumentError`` names the one that is out of range."""
        above_zero(self, "hand_speed", "walk_speed")
        not_negative(self, "damping", "reaction_time")
        if not 1.0 <= self.stature <= 2.3:
            raise ArgumentError(f"Person.stature {self.stature}: expected 1 to 2.3 m")
        for name, known in (("posture", POSTURES), ("motion", MOTIONS)):
            if getattr(self, name) not in known:
                raise ArgumentError(
                    f"Person.{name} {getattr(self, name)!r}: expected one of {', '.join(known)}"
                )
        place = (*self.position, self.facing, self.floor)
        if len(place) != 4 or not np.isfinite(place).all():
            raise ArgumentError("Person: position (x, y), facing and floor are finite numbers")

    @property
    def seated(self) -> bool:
        """Whether the person sits."""
        return self.posture == "seated"

    def length(self, name: str) -> float:
        """One of :data:`LENGTHS` [m]."""
        return LENGTHS[name] * self.stature

    @property
    def hip_height(self) -> float:
        """Height of the hips above the floor [m]; if seated, the height of the knees."""
        return self.length("hip") if not self.seated else self.length("shank") + self.length("foot")

    def chest_height(self) -> float:
        """Height of the middle of the chest above the floor [m]."""
        return self.hip_height + 0.78 * self.length("trunk")

    def parts(self, number: int = 0) -> Iterator[PersonPart]:
        """The capsules of the scene's person ``number``, in the order of :data:`SEGMENTS`."""
        for segment in SEGMENTS:
            yield PersonPart(self, segment, prefix(number))


@dataclass(frozen=True)
class PersonPart:
    """One capsule of a person, for the scene."""

    person: Person
    segment: Segment
    prefix: str = "person_"

    @property
    def name(self) -> str:
        """Name of its body and geom."""
        return self.prefix + self.segment.name

    @property
    def limits(self) -> BodyRegion:
        """The region's numbers."""
        return body_region(self.segment.region)

    @property
    def stiffness(self) -> float:
        """Stiffness of the contact [N/m]."""
        return self.limits.stiffness

    @property
    def damping(self) -> float:
        """Damping of the contact [N s/m]."""
        return self.person.damping

    @property
    def held(self) -> bool:
        """Whether the part cannot yield, because it lies on a seat."""
        return self.person.seated and self.segment.region in ("pelvis", "thigh")

    @property
    def radius(self) -> float:
        """[m]."""
        return self.segment.radius * self.person.stature


#: Colours: skin and clothes.
_SKIN, _SHIRT, _TROUSERS = [0.87, 0.67, 0.55, 1], [0.25, 0.42, 0.62, 1], [0.28, 0.30, 0.36, 1]
_COLOURS = {"pelvis": _TROUSERS, "thigh": _TROUSERS, "lower_leg": _TROUSERS, "chest": _SHIRT,
            "abdomen": _SHIRT, "upper_arm": _SHIRT}  # fmt: skip


def prefix(number: int) -> str:
    """Prefix of the names of the parts of a scene's person ``number`` (from 0)."""
    return f"person{number + 1}_" if number else "person_"


def add_person(spec: mujoco.MjSpec, person: Person, number: int = 0) -> dict[str, PersonPart]:
    """Add the capsules to the world of ``spec``; their contacts come with ``add_pairs``."""
    parts = {part.name: part for part in person.parts(number)}
    x, y = person.position
    for name, part in parts.items():
        segment = part.segment
        place = [x, y, person.floor + segment.height * person.stature]
        frame = spec.worldbody.add_body(name=f"{name}_motion", pos=place, mocap=True)
        body = frame.add_body(name=name, gravcomp=1)
        if segment.gives:
            _add_slides(body, part.limits.mass)
        body.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            size=[part.radius, segment.half * person.stature, 0],
            mass=part.limits.mass,
            contype=0,
            conaffinity=0,
            rgba=_COLOURS.get(segment.region, _SKIN),
        )
    return parts


def _add_slides(body: mujoco.MjsBody, mass: float) -> None:
    """Three slides that yield to an impact and return."""
    stiffness = max(GIVE_STIFFNESS, mass * GIVE_FREQUENCY**2)
    damping = 2 * GIVE_DAMPING * float(np.sqrt(stiffness * mass))
    for axis in np.eye(3):
        joint = body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        joint.stiffness, joint.damping = [stiffness, 0, 0], [damping, 0, 0]
