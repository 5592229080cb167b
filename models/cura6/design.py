"""The designs of the arm and of its other sizes; :func:`mjcf` writes ``cura6.xml`` from the table.

README.md beside this file gives the source of each number. A test compares table and file.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

SHELL, HOUSING, ACCENT, STEEL = "shell", "housing", "accent", "steel"


@dataclass(frozen=True)
class Part:
    """A cylinder, capsule or ellipsoid of a link, in the link's frame."""

    start: tuple[float, float, float]  #: [m]
    end: tuple[float, float, float]  #: [m]
    radius: float  #: [m]
    material: str = SHELL
    shape: str = "cylinder"


@dataclass(frozen=True)
class Link:
    """A link with its joint; every frame is parallel to the world's when all joints are at zero."""

    pos: tuple[float, float, float]  #: of the joint in the parent's frame [m]
    axis: str  #: "y" or "z"
    reach: float  #: the joint's range is -reach to reach [rad]
    speed: float  #: largest joint speed [rad/s]
    torque: float  #: largest joint torque [N m]
    rotor: float  #: inertia of motor and gear at the joint (rotor inertia x gear^2) [kg m^2]
    mass: float  #: [kg]
    looks: tuple[Part, ...]  #: visual parts
    collides: tuple[Part, ...]  #: collision shapes


LINKS = (
    Link(  # shoulder: turns about the vertical
        (0, 0, 0.105), "z", 6.2832, 2.0944, 330, 2.2, 7.4,
        (
            Part((0, 0, -0.005), (0, 0, 0.01), 0.093, ACCENT),
            Part((0, 0, 0.01), (0, 0, 0.085), 0.089),
            Part((0, -0.085, 0.085), (0, 0.075, 0.085), 0.088),
            Part((0, -0.1, 0.085), (0, -0.085, 0.085), 0.08, HOUSING),
            Part((0, 0.075, 0.085), (0, 0.082, 0.085), 0.089, ACCENT),
        ),
        (Part((0, -0.04, 0.085), (0, 0.04, 0.085), 0.095, shape="capsule"),),
    ),
    Link(  # upper arm
        (0, 0.17, 0.085), "y", 6.2832, 2.0944, 330, 2.2, 12.5,
        (
            Part((0, -0.088, 0), (0, 0.075, 0), 0.088),
            Part((0, 0.075, 0), (0, 0.092, 0), 0.08, HOUSING),
            Part((0, 0, 0.05), (0, 0, 0.565), 0.066),
            Part((0, 0, 0.075), (0, 0, 0.083), 0.0675, STEEL),
            Part((0, 0, 0.532), (0, 0, 0.54), 0.0675, STEEL),
            Part((0, -0.065, 0.6127), (0, 0.062, 0.6127), 0.073),
            Part((0, 0.062, 0.6127), (0, 0.076, 0.6127), 0.066, HOUSING),
            Part((0, -0.072, 0.6127), (0, -0.065, 0.6127), 0.074, ACCENT),
        ),
        (
            Part((0, 0, 0), (0, 0, 0.6127), 0.073, shape="capsule"),
            Part((0, -0.03, 0), (0, 0.03, 0), 0.09, shape="capsule"),
        ),
    ),
    Link(  # forearm
        (0, -0.14, 0.6127), "y", 2.9, 3.1416, 150, 1.1, 4.4,
        (
            Part((0, -0.06, 0), (0, 0.068, 0), 0.072),
            Part((0, -0.075, 0), (0, -0.06, 0), 0.066, HOUSING),
            Part((0, 0, 0.04), (0, 0, 0.53), 0.052),
            Part((0, 0, 0.066), (0, 0, 0.073), 0.0535, STEEL),
            Part((0, 0, 0.49), (0, 0, 0.497), 0.0535, STEEL),
            Part((0, -0.05, 0.5716), (0, 0.048, 0.5716), 0.056),
            Part((0, -0.062, 0.5716), (0, -0.05, 0.5716), 0.05, HOUSING),
            Part((0, 0.048, 0.5716), (0, 0.054, 0.5716), 0.057, ACCENT),
        ),
        (Part((0, 0, 0), (0, 0, 0.5716), 0.062, shape="capsule"),),
    ),
    Link(  # wrist 1
        (0, 0.115, 0.5716), "y", 6.2832, 3.1416, 56, 0.32, 2.0,
        (
            Part((0, -0.061, 0), (0, 0.045, 0), 0.053),
            Part((0, 0.045, 0), (0, 0.056, 0), 0.047, HOUSING),
            Part((0, 0, 0), (0, 0, 0.054), 0.052),
            Part((0, 0, 0.054), (0, 0, 0.06), 0.0535, ACCENT),
        ),
        (
            Part((0, -0.02, 0), (0, 0.01, 0), 0.056, shape="capsule"),
        ),
    ),
    Link(  # wrist 2
        (0, 0, 0.115), "z", 6.2832, 3.1416, 56, 0.32, 2.0,
        (
            Part((0, 0, -0.055), (0, 0, 0.042), 0.052),
            Part((0, 0, 0.042), (0, 0, 0.053), 0.046, HOUSING),
            Part((0, 0, 0), (0, 0.054, 0), 0.051),
            Part((0, 0.054, 0), (0, 0.06, 0), 0.0525, ACCENT),
        ),
        (
            Part((0, 0, -0.02), (0, 0, 0.01), 0.055, shape="capsule"),
        ),
    ),
    Link(  # wrist 3 with the tool flange
        (0, 0.1, 0), "y", 6.2832, 3.1416, 56, 0.25, 0.7,
        (
            Part((0, -0.04, 0), (0, 0.004, 0), 0.046),
            Part((0, 0.004, 0), (0, 0.018, 0), 0.0375, STEEL),
        ),
        (Part((0, -0.015, 0), (0, 0.0, 0), 0.045, shape="capsule"),),
    ),
)  # fmt: skip

#: Height of the caps of the joint housings, relative to their radius.
_BULGE = 0.28
#: Tool mounting point in the frame of link 6 [m]; the flange's outward normal is +y.
FLANGE = (0.0, 0.018, 0.0)
#: Home pose [rad]: elbow up, tool axis down.
HOME = (0.0, -0.5, 1.9, 0.1708, -1.5708, 0.0)
#: Largest joint speeds and accelerations of planned motions [rad/s, rad/s^2].
MAX_SPEED = tuple(link.speed for link in LINKS)
MAX_ACCELERATION = (8.0, 8.0, 12.0, 16.0, 16.0, 16.0)
JOINTS = tuple(f"joint{i}" for i in range(1, 7))

_BASE = (
    Part((0, 0, 0), (0, 0, 0.02), 0.1, STEEL),
    Part((0, 0, 0.02), (0, 0, 0.1), 0.088),
)


def inertial(link: Link) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass [kg], centre of mass [m] and inertia about it [kg m^2, (3, 3)] of a link.

    The mass is spread over the link's solid cylinders in proportion to their volume, except that
    the joint housings weigh three times as much as the tubes (motor and gear inside).
    """
    weights, centres, tensors = [], [], []
    for part in link.looks:
        start, end = np.array(part.start), np.array(part.end)
        length = float(np.linalg.norm(end - start))
        along = (end - start) / length
        dense = 1.0 if length > 4 * part.radius else 3.0
        weights.append(dense * np.pi * part.radius**2 * length)
        centres.append((start + end) / 2)
        across = (3 * part.radius**2 + length**2) / 12
        line = np.outer(along, along)
        tensors.append(across * (np.eye(3) - line) + part.radius**2 / 2 * line)
    masses = np.array(weights) / sum(weights) * link.mass
    centre = (masses[:, None] * np.array(centres)).sum(axis=0) / link.mass
    total = np.zeros((3, 3))
    for m, c, tensor in zip(masses, centres, tensors, strict=True):
        d = c - centre
        total += m * (tensor + np.dot(d, d) * np.eye(3) - np.outer(d, d))
    return link.mass, centre, total


def _numbers(values: object) -> str:
    return " ".join(f"{float(v):.6g}" for v in np.asarray(values).ravel())


def _geom(part: Part, kind: str) -> str:
    material = f' material="{part.material}"' if kind == "visual" else ""
    return (
        f'<geom class="{kind}" type="{part.shape}" fromto="{_numbers((*part.start, *part.end))}" '
        f'size="{part.radius:g}"{material}/>'
    )


def dome(cap: Part) -> Part:
    """The bulge of a housing's cap: half an ellipsoid on its outer face, without mass."""
    inner, outer = sorted((np.array(cap.start), np.array(cap.end)), key=lambda p: np.linalg.norm(p))
    along = (outer - inner) / np.linalg.norm(outer - inner) * _BULGE * cap.radius
    (x0, y0, z0), (x1, y1, z1) = (outer - along).tolist(), (outer + along).tolist()
    return Part((x0, y0, z0), (x1, y1, z1), 0.985 * cap.radius, HOUSING, "ellipsoid")


def mjcf(
    links: Sequence[Link] = LINKS,
    flange: tuple[float, float, float] = FLANGE,
    name: str = "cura6",
) -> str:
    """The MJCF text of an arm with these links; by default, of the CURA6-like arm."""
    lines = [_HEAD.replace('"cura6"', f'"{name}"')]
    indent = "    "
    lines += [f'{indent}<body name="base">']
    lines += [f"{indent}  {_geom(part, 'visual')}" for part in _BASE]
    lines += [f"{indent}  {_geom(Part((0, 0, 0.03), (0, 0, 0.08), 0.092), 'collision')}"]
    for i, link in enumerate(links, start=1):
        indent += "  "
        mass, centre, inertia = inertial(link)
        full = [inertia[0, 0], inertia[1, 1], inertia[2, 2]]
        full += [inertia[0, 1], inertia[0, 2], inertia[1, 2]]
        lines += [
            f'{indent}<body name="link{i}" pos="{_numbers(link.pos)}">',
            f'{indent}  <inertial pos="{_numbers(centre)}" mass="{mass:g}" '
            f'fullinertia="{_numbers(full)}"/>',
            f'{indent}  <joint name="joint{i}" axis="{"0 1 0" if link.axis == "y" else "0 0 1"}" '
            f'range="{-link.reach:g} {link.reach:g}" armature="{link.rotor:g}" '
            f'actuatorfrcrange="{-link.torque:g} {link.torque:g}"/>',
        ]
        shown = [*link.looks, *(dome(part) for part in link.looks if part.material == HOUSING)]
        lines += [f"{indent}  {_geom(part, 'visual')}" for part in shown]
        lines += [f"{indent}  {_geom(part, 'collision')}" for part in link.collides]
    lines += [
        f'{indent}  <site name="flange" pos="{_numbers(flange)}" quat="0.707107 -0.707107 0 0"/>'
    ]
    lines += [f"{' ' * (4 + 2 * depth)}</body>" for depth in range(len(links), -1, -1)]
    lines += ["  </worldbody>", "  <keyframe>"]
    lines += [f'    <key name="home" qpos="{_numbers(HOME)}"/>', "  </keyframe>", "</mujoco>", ""]
    return "\n".join(lines)


_HEAD = """\
<mujoco model="cura6">
  <!-- Written by design.py from its table of numbers; see README.md for their sources. -->
  <compiler angle="radian" autolimits="true"/>
  <option timestep="0.001" integrator="implicitfast"/>
  <default>
    <default class="visual">
      <geom group="2" contype="0" conaffinity="0" density="0"/>
    </default>
    <default class="collision">
      <geom group="3" contype="1" conaffinity="2" density="0" rgba="0.4 0.6 0.9 0.3"/>
    </default>
  </default>
  <asset>
    <material name="shell" rgba="0.90 0.91 0.93 1" specular="0.4" shininess="0.5"/>
    <material name="housing" rgba="0.20 0.22 0.25 1" specular="0.4" shininess="0.5"/>
    <material name="accent" rgba="0.05 0.53 0.62 1" specular="0.5" shininess="0.6"/>
    <material name="steel" rgba="0.55 0.57 0.60 1" specular="0.8" shininess="0.8"/>
  </asset>
  <worldbody>"""


@dataclass(frozen=True)
class Size:
    """Factors on the arm's numbers; a tuple holds one for each link, base to tip."""

    length: tuple[float, ...]  #: factors on distances along and between joints
    mass: tuple[float, ...]
    drive: float  #: factor on torque limits, gains and friction; its square scales rotor inertia
    speed: float = 1.0  #: factor on the largest joint speeds


#: A small 5 kg arm, a long one and a strong 16 kg one: designs, not products. They test whether a
#: method works on arms that it was not developed on.
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
