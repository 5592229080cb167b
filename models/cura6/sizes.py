"""Arms of other sizes, derived from the CURA6-like one: same joints; other links, masses, drives.

They are designs, not products. They test whether a method works on arms that it was not
developed on.
"""

from dataclasses import dataclass, replace

from tauguard.models.cura6.design import FLANGE, LINKS, Link, Part


@dataclass(frozen=True)
class Size:
    """Factors on the arm's numbers; a tuple holds one for each link, base to tip."""

    length: tuple[float, ...]  #: factors on distances along and between joints
    mass: tuple[float, ...]
    drive: float  #: factor on torque limits, gains and friction; its square scales rotor inertia
    speed: float = 1.0  #: factor on the largest joint speeds


#: A small 5 kg arm, a long one and a strong 16 kg one.
SIZES = {
    "cura6-small": Size((0.85, 0.68, 0.74, 0.85, 0.85, 0.85), (0.6, 0.5, 0.5, 0.6, 0.6, 0.7), 0.5),
    "cura6-long": Size((1.1, 1.3, 1.4, 1.0, 1.0, 1.0), (1.2, 1.25, 1.2, 1.0, 1.0, 1.0), 1.4, 0.85),
    "cura6-strong": Size((1.15, 0.9, 0.85, 1.1, 1.1, 1.1), (1.5, 1.3, 1.3, 1.4, 1.4, 1.4), 1.6),
}


def links(size: Size) -> tuple[Link, ...]:
    """The table of links of an arm of this size."""
    stretched = (1.0, *size.length)  # a joint's offset lies on the previous link
    return tuple(
        replace(
            link,
            pos=_scaled(link.pos, stretched[i]),
            speed=link.speed * size.speed,
            torque=link.torque * size.drive,
            rotor=link.rotor * size.drive**2,
            mass=link.mass * size.mass[i],
            looks=tuple(_part(part, size.length[i]) for part in link.looks),
            collides=tuple(_part(part, size.length[i]) for part in link.collides),
        )
        for i, link in enumerate(LINKS)
    )


def flange(size: Size) -> tuple[float, float, float]:
    """Tool mounting point in the frame of the last link [m]."""
    return _scaled(FLANGE, size.length[-1])


def _scaled(point: tuple[float, float, float], factor: float) -> tuple[float, float, float]:
    return (point[0] * factor, point[1] * factor, point[2] * factor)


def _part(part: Part, factor: float) -> Part:
    return replace(part, start=_scaled(part.start, factor), end=_scaled(part.end, factor))
