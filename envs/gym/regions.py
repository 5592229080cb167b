"""The body regions of a scene: their limits, stiffness and speeds."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tauguard.models import BodyProxy, Person, Scene, SceneObject
from tauguard.models.person import PersonPart
from tauguard.models.scene import people_parts

#: Distance from the middle of its line at which a region turns back, in units of the reach.
SPAN = 0.6
#: Speeds at which regions cross [m/s]: a person's hand at work moves at up to 1.6 (ISO 13855),
#: a torso at less.
HAND_SPEED, BODY_SPEED = 0.8, 0.3
#: Speed of a free object after a fall of one metre [m/s].
FALL_SPEED = 4.5


@dataclass(frozen=True)
class RegionInfo:
    """A body region in the scene."""

    name: str
    body: int
    joint: int  #: -1: held in place
    quasi_static: float  #: limit [N]
    transient: float  #: limit [N]; 0: no impact is allowed
    mocap: int  #: of the frame that a person moves; -1: not of a person
    held: bool  #: cannot move away: its limit is the quasi-static one
    stiffness: float  #: of its contact [N/m]
    radius: float  #: [m]
    span: float  #: [m]
    speed: float  #: [m/s]
    unconfirmed: tuple[str, ...]  #: values that no open source confirmed

    @property
    def least_pressure(self) -> float:
        """Mean pressure of a flat surface on a round region [N/cm^2], where no area is known.

        The surface touches it in a circle, at the depth that its stiffness allows: pi radius F / k
        (Hertz' geometry). The estimate is low, since a robot's edge presses harder.
        """
        return self.stiffness / (np.pi * self.radius) / 1e4


def fastest(region: RegionInfo, people: tuple[Person, ...]) -> float:
    """Largest speed at which a region may meet the arm [m/s]."""
    if region.mocap < 0:
        return region.speed
    limb = region.name.endswith(("hand", "arm"))
    return max(person.walk_speed + (person.hand_speed if limb else 0.0) for person in people)


def regions_of(scene: Scene, reach: float) -> tuple[RegionInfo, ...]:
    """The regions of proxies, then of people, then of objects."""
    spec = scene.spec
    return (
        *(_region(scene, proxy, reach) for proxy in spec.proxies),
        *(_segment(scene, part) for part in people_parts(spec)),
        *(_object(scene, obj) for obj in spec.objects if obj.touchable),
    )


def _segment(scene: Scene, part: PersonPart) -> RegionInfo:
    limits = part.limits
    return RegionInfo(
        name=part.name,
        body=int(scene.model.body(part.name).id),
        joint=-1,
        quasi_static=limits.quasi_static_force,
        transient=limits.transient_force,
        mocap=int(scene.model.body(f"{part.name}_motion").mocapid[0]),
        held=part.held,
        stiffness=limits.stiffness,
        radius=part.radius,
        span=0.0,
        speed=0.0,
        unconfirmed=limits.unconfirmed,
    )


def _region(scene: Scene, proxy: BodyProxy, reach: float) -> RegionInfo:
    limits = proxy.limits
    slow = limits.mass > 5
    return RegionInfo(
        name=proxy.region,
        body=int(scene.model.body(proxy.region).id),
        joint=-1 if proxy.clamped else int(scene.model.joint(proxy.region).id),
        quasi_static=limits.quasi_static_force,
        transient=limits.transient_force,
        mocap=-1,
        held=proxy.clamped,
        stiffness=limits.stiffness,
        radius=proxy.radius,
        span=SPAN * reach,
        speed=BODY_SPEED if slow else HAND_SPEED,
        unconfirmed=limits.unconfirmed,
    )


def _object(scene: Scene, obj: SceneObject) -> RegionInfo:
    body = scene.model.body(obj.name)
    return RegionInfo(
        name=obj.name,
        body=int(body.id),
        joint=-1,
        quasi_static=math.inf if obj.quasi_static_limit is None else obj.quasi_static_limit,
        transient=math.inf if obj.transient_limit is None else obj.transient_limit,
        mocap=-1,
        held=obj.motion == "fixed",
        stiffness=obj.stiffness,
        radius=math.inf,  # a pressure is estimated on people only
        span=0.0,
        speed=_path_speed(obj),
        unconfirmed=(),
    )


def _path_speed(obj: SceneObject) -> float:
    """Largest speed along a path [m/s]; for a free object its speed after a fall."""
    if not obj.path:
        return FALL_SPEED if obj.motion == "free" else 0.0
    rows = np.array(obj.path)
    steps = np.diff(rows, axis=0)
    return float((np.linalg.norm(steps[:, 1:], axis=1) / steps[:, 0]).max())
