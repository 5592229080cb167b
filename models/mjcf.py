"""Specs compiled without meshes that are not at hand; text that gives the same numbers again."""

from __future__ import annotations

import ctypes
import functools
from pathlib import Path

import mujoco

#: Significant digits that identify every double.
_DIGITS = 17


@functools.cache
def _library() -> ctypes.CDLL | None:
    """The MuJoCo library, if it lets the digits of its XML be chosen."""
    folder = Path(mujoco.__file__).parent
    names = [*folder.glob("libmujoco.so*"), *folder.glob("libmujoco*.dylib")]
    library = ctypes.CDLL(str(names[0])) if names else None
    return library if hasattr(library, "_mjPRIVATE__set_xml_precision") else None


def xml_text(spec: mujoco.MjSpec) -> str:
    """The MJCF text of a compiled spec, with every digit.

    MuJoCo writes six digits unless told otherwise, which moves a rotated base by micrometres. The
    switch is a private function of its library; where it is missing the text has six digits.
    """
    library = _library()
    if library is None:
        return str(spec.to_xml())
    before = library._mjPRIVATE__get_xml_precision()
    library._mjPRIVATE__set_xml_precision(_DIGITS)
    try:
        return str(spec.to_xml())
    finally:
        library._mjPRIVATE__set_xml_precision(before)


def compiled(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """The model of ``spec``, without its mesh geoms where these keep it from compiling.

    Raises:
        ValueError: it does not compile either way; MuJoCo's first message.
    """
    try:
        return spec.compile()
    except (ValueError, RuntimeError) as error:
        for geom in list(spec.geoms):
            if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
                spec.delete(geom)
        for mesh in list(spec.meshes):
            spec.delete(mesh)
        try:
            return spec.compile()
        except (ValueError, RuntimeError):
            raise ValueError(str(error)) from error
