"""Correct physically impossible inertias of a URDF, which MuJoCo refuses."""

import xml.etree.ElementTree as ElementTree

import numpy as np

from tauguard.arrays import Array

#: Smallest principal moment over the largest one, in a corrected inertia.
LEAST_MOMENT = 0.01
#: Smallest corrected moment [kg m^2] (MuJoCo takes those below 1e-14 for 0). Links without inertia
#: and below this mass [kg] are not corrected.
SMALLEST, LIGHTEST = 1e-12, 1e-5
#: A body with a mass but no inertia becomes a ball of this density [kg/m^3].
DENSITY = 1000.0
_ENTRIES = {
    "ixx": (0, 0),
    "iyy": (1, 1),
    "izz": (2, 2),
    "ixy": (0, 1),
    "ixz": (0, 2),
    "iyz": (1, 2),
}


def mend_inertias(root: ElementTree.Element) -> tuple[str, ...]:
    """Correct the impossible inertias of a URDF in place; returns the names of their links.

    Moments at or below 0 are raised, and the largest is cut to the sum of the others. Missing
    moments become those of a ball.

    Raises:
        ValueError: a mass or moment that is no number.
    """
    mended = []
    for link in root.findall("link"):
        inertia = link.find("inertial/inertia")
        mass = link.find("inertial/mass")
        if inertia is None or mass is None:
            continue
        name = str(link.get("name"))
        size = _number(mass, "value", name)
        tensor = np.zeros((3, 3))
        for key, (i, j) in _ENTRIES.items():
            tensor[i, j] = tensor[j, i] = _number(inertia, key, name)
        if (tensor.any() or size > LIGHTEST) and not _possible(tensor):
            found = possible_inertia(tensor, size)
            for key, (i, j) in _ENTRIES.items():
                inertia.set(key, repr(float(found[i, j])))
            mended.append(name)
    return tuple(mended)


def possible_inertia(tensor: Array, mass: float) -> Array:
    """A physically possible inertia near ``tensor`` [kg m^2], shape (3, 3)."""
    moments, axes = np.linalg.eigh(tensor)
    if moments[2] <= 0:
        # A mass below 0 gets no ball; MuJoCo then reports its link.
        ball = (3 * max(mass, 0.0) / (4 * np.pi * DENSITY)) ** (1 / 3)
        return np.diag(np.full(3, 0.4 * mass * ball**2))
    moments = np.maximum(moments, max(LEAST_MOMENT * moments[2], SMALLEST))
    moments[2] = min(moments[2], 0.999 * (moments[0] + moments[1]))
    mended: Array = axes @ np.diag(np.sort(moments)) @ axes.T
    return np.asarray((mended + mended.T) / 2)


def _possible(tensor: Array) -> bool:
    moments = np.linalg.eigvalsh(tensor)
    return bool(moments[0] > 0 and moments[2] <= moments[0] + moments[1])


def _number(element: ElementTree.Element, key: str, link: str) -> float:
    text = element.get(key, "0")
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise ValueError(f"link {link!r}: {element.tag} {key} {text!r}: expected a number")
    return value
