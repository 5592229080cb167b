"""Compile specs whose meshes are missing, and write MJCF text with full precision."""

import ctypes
import functools
from pathlib import Path

import mujoco
import numpy as np

from tauguard.findings import FileError
from tauguard.models.mujoco_library import library
from tauguard.models.urdf import coarse

#: Significant digits that identify every double.
_DIGITS = 17


@functools.cache
def _precise_library() -> ctypes.CDLL | None:
    """The MuJoCo library, if it lets a caller choose the digits of its XML."""
    try:
        found = library()
    except OSError:
        return None
    return found if hasattr(found, "_mjPRIVATE__set_xml_precision") else None


def xml_text(spec: mujoco.MjSpec) -> str:
    """The MJCF text of a compiled spec, with every digit.

    MuJoCo writes six digits by default, which moves a rotated base by micrometres. The
    switch is a private function of its library; where it is missing the text has six digits.
    """
    switch = _precise_library()
    if switch is None:
        return str(spec.to_xml())
    before = switch._mjPRIVATE__get_xml_precision()
    switch._mjPRIVATE__set_xml_precision(_DIGITS)
    try:
        return str(spec.to_xml())
    finally:
        switch._mjPRIVATE__set_xml_precision(before)


class SpecText:
    """The MJCF text of a copy of a spec, written when it is first needed.

    Writing an arm with detailed meshes takes seconds, and few callers read the text.
    """

    def __init__(self, spec: mujoco.MjSpec) -> None:
        """Keep a copy of ``spec``."""
        self._spec = spec.copy()
        self._text: str | None = None

    def __str__(self) -> str:
        """MJCF with every digit."""
        if self._text is None:
            self._spec.compile()
            self._text = xml_text(self._spec)
        return self._text

    def dynamics(self) -> mujoco.MjModel:
        """The compiled model, without shapes if the spec states every body's inertia."""
        spec = self._spec.copy()
        if not all(body.explicitinertial for body in spec.bodies if body.name != "world"):
            return mujoco.MjModel.from_xml_string(str(self))
        without_shapes(spec, [geom for geom in spec.geoms if geom.parent.name != "world"])
        return spec.compile()


def without_shapes(spec: mujoco.MjSpec, geoms: list[mujoco.MjsGeom]) -> None:
    """Delete geoms, and the meshes and materials that are then unused."""
    for geom in geoms:
        spec.delete(geom)
    used = {geom.meshname for geom in spec.geoms}
    for mesh in list(spec.meshes):
        if mesh.name not in used:
            spec.delete(mesh)


def compiled(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """The model of ``spec``, without its mesh geoms if it does not compile with them.

    Raises:
        FileError: it compiles neither with nor without them; the text is MuJoCo's first message.
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
            raise FileError(str(error)) from error


def inline_meshes(spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    """Write mesh files into the text and remove textures, so that the text is self-contained."""
    solid = {geom.meshname for geom in spec.geoms if geom.contype or geom.conaffinity}
    for mesh in [mesh for mesh in spec.meshes if mesh.file]:
        at = model.mesh(mesh.name or Path(mesh.file).stem)
        first, count = int(model.mesh_vertadr[at.id]), int(model.mesh_vertnum[at.id])
        face, faces = int(model.mesh_faceadr[at.id]), int(model.mesh_facenum[at.id])
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.mesh_quat[at.id])
        vertices = model.mesh_vert[first : first + count] @ turn.reshape(3, 3).T
        vertices, triangles = vertices + model.mesh_pos[at.id], model.mesh_face[face : face + faces]
        inertia, hull = mesh.inertia, mesh.maxhullvert
        if at.name not in solid:
            vertices, triangles = coarse(vertices, triangles)
            inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        spec.delete(mesh)  # the file's normals and texture coordinates would stay
        plain = spec.add_mesh(name=at.name, inertia=inertia, maxhullvert=hull)
        plain.uservert = vertices.ravel().tolist()
        plain.userface = triangles.ravel().tolist()
    for texture in list(spec.textures):
        spec.delete(texture)
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
