"""MJCF without ``<frame>`` elements, which dm_control's schema does not know."""

from __future__ import annotations

from xml.etree import ElementTree

import mujoco
import numpy as np

from tauguard.arrays import Array

#: Elements that a frame can hold and that have a place of their own.
_PLACED = ("body", "geom", "site", "camera", "light", "inertial", "joint")


def without_frames(xml: str) -> str:
    """The same MJCF, every frame's pose given to what it holds.

    Args:
        xml: text that MuJoCo has written: orientations are quaternions.

    Raises:
        ValueError: something in a frame is oriented in another way than by a quaternion.
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
    for way in ("euler", "axisangle", "xyaxes", "zaxis"):
        if element.get(way) is not None:
            raise ValueError(f"<{element.tag} {way}>: expected a quaternion inside a frame")
    pos = np.array(element.get("pos", "0 0 0").split(), dtype=float)
    quat = np.array(element.get("quat", "1 0 0 0").split(), dtype=float)
    return pos, quat / np.linalg.norm(quat)


def _place(part: ElementTree.Element, pos: Array, quat: Array) -> None:
    """Give ``part`` the frame's pose on top of its own."""
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
