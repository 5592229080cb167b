"""The body regions of a scene: their limits, stiffness and speeds."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tauguard.models import BodyProxy, Person, Scene, SceneObject
from tauguard.models.person import PersonPart
from tauguard.models.scene import people_parts

#: Distance from the middle of its line at which a region turns back [reach].
SPAN = 0.6
#: Speed at which a hand, an arm or another light region crosses [m/s]. A person's hand at work
#: moves at up to 1.6 m/s (ISO 13855).
HAND_SPEED = 0.8
BODY_SPEED = 0.3  #: speed at which a region of more than 5 kg crosses [m/s]
#: Speed of a free object after a fall of one metre [m/s].
FALL_SPEED = 4.5


@dataclass(frozen=True)
class RegionInfo:
    """A body region in the scene."""

    name: str
    body: int
    quasi_static: float  #: limit [N]
    transient: float  #: limit [N]; 0: no impact is allowed
    held: bool  #: the region cannot move away, so its limit is the quasi-static one
    stiffness: float  #: stiffness of the region's contact [N/m]
    radius: float  #: [m]
    joint: int = -1  #: -1: held in place
    mocap: int = -1  #: mocap index of the frame that moves a person's region; -1: not of a person
    span: float = 0.0  #: distance from the middle of its line at which the region turns back [m]
    speed: float = 0.0  #: along its line or path [m/s]
    unconfirmed: tuple[str, ...] = ()  #: values that no open source confirmed

    @property
    def least_pressure(self) -> float:
        """Mean pressure of a flat surface on the round region [N/cm^2], for an unknown area.

        At depth d = F / k a plane touches a sphere in a circle of area pi radius d (Hertz'
        geometry), so F / area = k / (pi radius). A robot's edge exerts a higher pressure.
        """
        return self.stiffness / (np.pi * self.radius) / 1e4


def fastest(region: RegionInfo, people: tuple[Person, ...]) -> float:
    """Largest speed of a region when it meets the arm [m/s]."""
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
        quasi_static=limits.quasi_static_force,
        transient=limits.transient_force,
        mocap=int(scene.model.body(f"{part.name}_motion").mocapid[0]),
        held=part.held,
        stiffness=limits.stiffness,
        radius=part.radius,
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
        quasi_static=math.inf if obj.quasi_static_limit is None else obj.quasi_static_limit,
        transient=math.inf if obj.transient_limit is None else obj.transient_limit,
        held=obj.motion == "fixed",
        stiffness=obj.stiffness,
        radius=math.inf,  # pressure is estimated only on people
        speed=_path_speed(obj),
    )


def _path_speed(obj: SceneObject) -> float:
    """Largest speed of an object along its path, or after a fall if it is free [m/s]."""
    if not obj.path:
        return FALL_SPEED if obj.motion == "free" else 0.0
    rows = np.array(obj.path)
    steps = np.diff(rows, axis=0)
    return float((np.linalg.norm(steps[:, 1:], axis=1) / steps[:, 0]).max())
