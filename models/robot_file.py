"""Write a copy of a robot file (URDF or MJCF) with other inertial numbers and a note."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import mujoco
import numpy as np

from tauguard.arrays import Array
from tauguard.atomic_write import write_atomic
from tauguard.findings import FileError
from tauguard.models.robot_check import checked_robot
from tauguard.models.urdf import xml_root
from tauguard.untrusted_input import read_text

#: Name of the element (URDF) or of the custom text (MJCF) that holds a note.
TAG = "tauguard"


def write_robot_file(
    source: str | Path, target: str | Path, joints: tuple[str, ...], inertial: Array, note: str
) -> None:
    """Copy a robot file, with the inertial numbers of its moving links replaced.

    Args:
        source: URDF or MJCF of an arm.
        target: where to write, in the same format.
        joints: names, in the order of ``inertial``; all other joints are made fixed.
        inertial: inertia of all that moves with each joint, in the joint's frame: mass, first
            moment (3), Ixx Ixy Iyy Ixz Iyz Izz about its origin [kg, kg m, kg m^2], shape (n, 10).
        note: any text; :func:`read_note` finds it again.

    Raises:
        FileError: not XML, not a robot, or without one of the joints.
        OSError: cannot be read or written.
    """
    root = _root(source)
    if root.tag == "robot":
        text = _urdf(root, joints, inertial, note)
    else:
        text = _mjcf(Path(source), joints, inertial, note)
    write_atomic(Path(target), text)


def read_note(source: str | Path) -> str | None:
    """The note in a robot file, None if it has none.

    Raises:
        FileError: not XML.
        OSError: cannot be read.
    """
    root = _root(source)
    if root.tag == "robot":
        return root.findtext(TAG)
    for text in root.iterfind("custom/text"):
        if text.get("name") == TAG:
            return text.get("data") or text.text
    return None


def _root(source: str | Path) -> ElementTree.Element:
    try:
        return xml_root(read_text(source))
    except ValueError as error:
        raise FileError(f"{source}: {error}") from None


def _about_centre(numbers: Array) -> tuple[float, Array, Array]:
    """Mass, centre of mass and inertia about it."""
    mass = float(numbers[0])
    centre = numbers[1:4] / mass
    xx, xy, yy, xz, yz, zz = numbers[4:]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    inertia -= mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    return mass, centre, inertia


def _urdf(root: ElementTree.Element, joints: tuple[str, ...], inertial: Array, note: str) -> str:
    links = {link.get("name"): link for link in root.findall("link")}
    children: dict[str | None, list[ElementTree.Element]] = {}
    by_name = {}
    for joint in root.findall("joint"):
        by_name[joint.get("name")] = joint
        children.setdefault(_end(joint, "parent"), []).append(joint)

    for name, joint in by_name.items():
        if name not in joints and joint.get("type") != "fixed":
            joint.set("type", "fixed")
            for part in ("axis", "limit", "mimic", "dynamics", "safety_controller"):
                for element in joint.findall(part):
                    joint.remove(element)

    def strip(link: str | None) -> None:
        for element in links[link].findall("inertial"):
            links[link].remove(element)
        for joint in children.get(link, []):
            if joint.get("type") == "fixed":
                strip(_end(joint, "child"))

    for name, numbers in zip(joints, inertial, strict=True):
        if name not in by_name:
            raise FileError(f"the robot file has no joint {name!r}")
        link = _end(by_name[name], "child")
        strip(link)
        mass, centre, inertia = _about_centre(numbers)
        body = ElementTree.SubElement(links[link], "inertial")
        ElementTree.SubElement(body, "mass", {"value": repr(mass)})
        ElementTree.SubElement(body, "origin", {"rpy": "0 0 0", "xyz": _numbers(centre)})
        names = ("ixx", 0, 0), ("ixy", 0, 1), ("ixz", 0, 2), ("iyy", 1, 1), ("iyz", 1, 2)
        entries = {key: repr(float(inertia[i, j])) for key, i, j in (*names, ("izz", 2, 2))}
        ElementTree.SubElement(body, "inertia", entries)
    for old in root.findall(TAG):
        root.remove(old)
    ElementTree.SubElement(root, TAG).text = note
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _end(joint: ElementTree.Element, which: str) -> str | None:
    element = joint.find(which)
    return None if element is None else element.get("link")


def _numbers(values: Array) -> str:
    return " ".join(repr(float(v)) for v in values)


def _mjcf(source: Path, joints: tuple[str, ...], inertial: Array, note: str) -> str:
    try:
        spec = mujoco.MjSpec.from_file(str(checked_robot(Path(source))))
    except ValueError as error:
        raise FileError(f"{source}: {' '.join(str(error).split())}") from None
    held = {str(joint.name) for joint in spec.joints} - set(joints)
    if held:
        spec.compile()
        spec = mujoco.MjSpec.from_string(_without_joints(str(spec.to_xml()), held))
    for name, numbers in zip(joints, inertial, strict=True):
        joint = spec.joint(name)
        if joint is None:
            raise FileError(f"the robot file has no joint {name!r}")
        body = joint.parent
        mass, centre, inertia = _about_centre(numbers)
        for fixed in _welded(body):
            fixed.mass, fixed.explicitinertial = 0.0, True
            fixed.inertia = np.zeros(3)
            fixed.fullinertia = np.full(6, np.nan)
        body.mass, body.explicitinertial = mass, True
        body.ipos = centre + joint.pos
        body.iquat = np.array([1.0, 0.0, 0.0, 0.0])
        body.inertia = np.zeros(3)
        body.fullinertia = inertia[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)]
    for text in list(spec.texts):
        if text.name == TAG:
            spec.delete(text)
    spec.add_text(name=TAG, data=note)
    spec.compile()
    return str(spec.to_xml())


def _without_joints(text: str, held: set[str]) -> str:
    """MJCF without some joints, and without all sections that refer to joints."""
    root = ElementTree.fromstring(text)
    for section in ("actuator", "equality", "tendon", "keyframe", "sensor"):
        for element in root.findall(section):
            root.remove(element)
    for body in root.iter("body"):
        for joint in body.findall("joint"):
            if joint.get("name") in held:
                body.remove(joint)
    return ElementTree.tostring(root, encoding="unicode")


def _welded(body: mujoco.MjsBody) -> list[mujoco.MjsBody]:
    """Bodies below ``body`` that are welded to it."""
    found = []
    for child in body.bodies:
        if not child.joints:
            found += [child, *_welded(child)]
    return found
