"""The model's fields that a guard compares between two steps, and values that it refuses.

The guard copies some fields; if one of them has changed, it reads pairs and shapes again. All other
numbers may change, but must be valid.
"""

import functools
import re
from collections.abc import Callable
from functools import partial
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.contacts.checker import geom_kinds
from tauguard.contacts.frames import movers
from tauguard.contacts.guard.engine import PHYSICS
from tauguard.findings import ArgumentError
from tauguard.rigid.imports import hull_rows

#: Fields that determine the pairs.
PAIRS = (
    *("geom_type", "geom_contype", "geom_conaffinity", "geom_dataid"),
    *("body_contype", "body_conaffinity"),
    *("flex_contype", "flex_conaffinity", "flex_selfcollide", "flex_dim"),
    *("exclude_signature", "pair_geom1", "pair_geom2"),
)
#: Fields that determine shapes and their poses on bodies.
SHAPES = (
    *("geom_size", "geom_pos", "geom_quat", "geom_sameframe", "body_ipos", "body_iquat"),
    *("flex_radius", "flex_elem"),
)
#: Stiffness and rest lengths of elastic flexes, and the objects of equality constraints.
MOTION = (
    *("flex_stiffness", "flexedge_length0", "eq_type", "eq_objtype", "eq_obj1id", "eq_obj2id"),
)
#: Fields of the model's structure; if they are edited, MuJoCo reads and writes beyond its arrays.
_STRUCTURE = re.compile(
    "(body|jnt|dof|tree|geom|site|flex|tendon|wrap|actuator|sensor|mesh|hfield)_.*(adr|num|id|row)$"
    "|(jnt|wrap)_type$"
)
_NOT_STRUCTURE = re.compile("geom_dataid|.*matid|geom_fluid")
#: Fields with the number of contact dimensions.
DIMENSIONS = ("geom_condim", "pair_dim", "flex_condim")
#: Allowed numbers of contact dimensions.
_CONDIM = (1, 3, 4, 6)
#: Fields whose numbers must be valid, by the rules of followed_fields.hpp.
_OBJECTS = re.compile("(body|jnt|dof|geom|pair|flex|eq|site|tendon|wrap|actuator)_|qpos(0|_spring)")
_FINITE, _NOT_NAN, _NOT_NEGATIVE = range(3)
_LIMITS = re.compile("range|yield|_user")  # these fields may be infinite
_MASSES = ("body_mass", "body_inertia", "dof_armature", "tendon_armature", "flex_radius")
#: Largest deviation of a quaternion's length from 1. MuJoCo normalizes quaternions when it compiles
#: a model, and later assumes unit length.
_UNIT = 1e-6

Regions = list[tuple[int, int]]


def followed_fields(model: Any, options: Regions) -> Regions:
    """Addresses and sizes in bytes of the fields that a guard of this model copies.

    Args:
        model: MjModel.
        options: Addresses and sizes in bytes of the options that are followed.
    """
    out = list(options)
    for name in (*PAIRS, *SHAPES, *MOTION, *DIMENSIONS, *structure_fields()):
        array = getattr(model, name)
        if array.size:
            out.append((array.ctypes.data, array.nbytes))
    carried = np.flatnonzero(movers(model) != np.arange(model.nbody))
    for array, rows in (
        (model.mesh_vert, _hull_rows(model)),
        (model.body_pos, carried),
        (model.body_quat, carried),
    ):
        out += [(array[row].ctypes.data, array[row].nbytes) for row in rows.tolist()]
    return out


@functools.cache
def _fields() -> dict[str, NDArray[Any]]:
    """Every array of an empty model, from which names and types of fields are read."""
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    fields = {name: getattr(model, name) for name in dir(model)}
    return {name: field for name, field in fields.items() if isinstance(field, np.ndarray)}


@functools.cache
def structure_fields() -> tuple[str, ...]:
    """Names of the fields of the model's structure."""
    names = filter(_STRUCTURE.match, _fields())
    return tuple(name for name in names if not _NOT_STRUCTURE.match(name))


def structure(model: Any) -> dict[str, NDArray[np.int32]]:
    """Copies of the fields of the model's structure, by name."""
    return {name: getattr(model, name).copy() for name in structure_fields()}


def refuse_structure(model: Any, built: dict[str, NDArray[np.int32]]) -> None:
    """Compare the structure of the model with the structure ``built`` at compilation.

    Raises:
        ArgumentError: they differ; the message names field, row and both values.
    """
    for name, before in built.items():
        now = getattr(model, name)
        if (now != before).any():
            row = int(np.argwhere(now != before)[0, 0])
            raise ArgumentError(
                f"{name}: row {row} is {now[row].tolist()}, expected {before[row].tolist()} as "
                "compiled; change the MjSpec and recompile it"
            )


def _hull_rows(model: Any) -> NDArray[np.int64]:
    """Rows of ``mesh_vert`` that are vertices of the hulls of mesh geoms, sorted."""
    kinds = np.array(geom_kinds(model))
    meshes = np.unique(model.geom_dataid[kinds == "mesh"]).tolist()
    rows = [np.unique(hull_rows(model, mesh)) for mesh in meshes]
    return np.concatenate(rows) if rows else np.zeros(0, dtype=np.int64)


@functools.cache
def _rules() -> dict[str, int]:
    """The rule of each field of doubles."""
    rules = {
        name: _NOT_NAN if _LIMITS.search(name) else _FINITE
        for name, field in _fields().items()
        if _OBJECTS.match(name) and field.dtype == np.float64
    }
    return rules | dict.fromkeys(_MASSES, _NOT_NEGATIVE)


def numbers(model: Any, physics: Regions) -> list[tuple[int, int, int]]:
    """Address, size in bytes and rule of the numbers that must be valid.

    Args:
        model: MjModel.
        physics: Addresses and sizes in bytes of options that must be finite.
    """
    out = [(*region, _FINITE) for region in physics]
    for name, rule in _rules().items():
        array = getattr(model, name)
        if array.size:
            out.append((array.ctypes.data, array.nbytes, rule))
    return out


def refuse_values(model: Any) -> None:
    """Check for values with which MuJoCo or a guard cannot step.

    Raises:
        ArgumentError: a number that is not finite (limits may be infinite); a negative mass, moment
            of inertia, armature, radius or size; a quaternion without unit length; an unknown id,
            type of geom or number of contact dimensions. The message names field, row and value.
    """
    for name, rule in _rules().items():
        _refuse_rows(model, name, np.isnan if rule == _NOT_NAN else _infinite, "not finite")
    for name in PHYSICS:
        value = getattr(model.opt, name)
        if not np.isfinite(value).all():
            raise ArgumentError(f"opt.{name}: {np.array(value).tolist()}, not finite")
    for name in _MASSES:
        _refuse_rows(model, name, lambda rows: rows < 0, "negative")
    for name in DIMENSIONS:
        _refuse_rows(model, name, lambda rows: ~np.isin(rows, _CONDIM), "not 1, 3, 4 or 6")
    kinds = [int(kind) for kind in mujoco.mjtGeom.__members__.values()]
    _refuse_rows(model, "geom_type", lambda rows: ~np.isin(rows, kinds), "an unknown type")
    for name, least, end in _targets(model):
        outside = partial(_outside, least=least, end=end)
        _refuse_rows(model, name, outside, "no such object")
    for name in ("geom_quat", "body_iquat"):
        _refuse_rows(model, name, _not_unit, "not of unit length")
    plane = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
    _refuse_rows(model, "geom_size", lambda rows: (rows < 0) & ~plane[:, None], "negative")
    hulls = _hull_rows(model)
    for row in hulls[~np.isfinite(model.mesh_vert[hulls]).all(axis=1)].tolist():
        raise ArgumentError(f"mesh_vert: row {row} is {model.mesh_vert[row].tolist()}, not finite")


def _targets(model: Any) -> list[tuple[str, Any, Any]]:
    """Fields of ids, with the lowest valid id and the first invalid one above it, by row."""
    geoms, kind, of = mujoco.mjtGeom, model.geom_type, model.eq_type
    field = kind == geoms.mjGEOM_HFIELD
    needed = np.isin(kind, (geoms.mjGEOM_MESH, geoms.mjGEOM_SDF, geoms.mjGEOM_HFIELD))
    ends = np.full(len(of), model.nflex)
    ends[of == mujoco.mjtEq.mjEQ_JOINT] = model.njnt
    ends[of == mujoco.mjtEq.mjEQ_TENDON] = model.ntendon
    bound = np.isin(of, (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD))
    at_sites = model.eq_objtype == mujoco.mjtObj.mjOBJ_SITE
    ends[bound] = np.where(at_sites, model.nsite, model.nbody)[bound]
    return [
        ("pair_geom1", 0, model.ngeom),
        ("pair_geom2", 0, model.ngeom),
        ("geom_dataid", np.where(needed, 0, -1), np.where(field, model.nhfield, model.nmesh)),
        ("eq_obj1id", 0, ends),
        ("eq_obj2id", np.where(bound, 0, -1), ends),
    ]


def _refuse_rows(model: Any, name: str, wrong: Callable[[Any], Any], defect: str) -> None:
    """Raise an ``ArgumentError`` with the first row in which an entry is ``wrong``."""
    rows = getattr(model, name)
    found = np.argwhere(wrong(rows))
    if len(found):
        row = int(found[0, 0])
        raise ArgumentError(f"{name}: row {row} is {rows[row].tolist()}, {defect}")


def _outside(ids: NDArray[np.int32], least: Any, end: Any) -> NDArray[np.bool_]:
    return np.asarray((ids < least) | (ids >= end))


def _infinite(rows: Array) -> NDArray[np.bool_]:
    return ~np.isfinite(rows)


def _not_unit(rows: Array) -> NDArray[np.bool_]:
    return np.asarray(np.abs(np.linalg.norm(rows, axis=1) - 1) > _UNIT)
