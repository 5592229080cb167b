"""What a user may change between two steps, drawn at random; each edit can be taken back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from mujoco.introspect import structs

from scenes.drawing import between

#: Every array of real numbers in mjModel, by name.
FIELDS = tuple(
    field.name
    for field in structs.STRUCTS["mjModel"].fields
    if getattr(getattr(field.type, "inner_type", None), "name", "") in ("mjtNum", "float")
)
#: Those that most often matter to what passes through what: drawn as often as all others.
OFTEN = (
    *("geom_pos", "geom_quat", "geom_size", "geom_margin", "geom_gap", "geom_solref"),
    *("geom_solimp", "geom_friction", "geom_rbound", "geom_aabb", "body_mass", "body_inertia"),
    *("body_pos", "body_quat", "body_ipos", "body_iquat", "mesh_vert", "flex_radius", "flex_vert"),
    *("flex_margin", "flex_stiffness", "flexedge_length0", "qpos0", "jnt_axis", "jnt_pos"),
    *("jnt_range", "dof_armature", "dof_damping", "eq_data", "actuator_gear", "pair_margin"),
)
_MASKS = ("geom_contype", "geom_conaffinity", "flex_contype", "flex_conaffinity")
_OPTIONS = ("timestep", "impratio", "density", "viscosity", "tolerance", "o_margin", "gravity")
_KINDS = ("SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX")


@dataclass(frozen=True)
class Edit:
    """One change that was made."""

    name: str
    undo: Callable[[], None]


def edit(rng: np.random.Generator, model: Any, data: Any) -> Edit:
    """Change something in model or data."""
    draws = (_field, _field, _field, _mask, _option, _flag, _state, _kind, _switch, _begin)
    while True:
        found = draws[int(rng.integers(len(draws)))](rng, model, data)
        if found is not None:
            return found


def _array(owner: Any, name: str, row: Any, value: Any) -> Edit:
    array = getattr(owner, name)
    before = np.array(array[row])

    def undo() -> None:
        array[row] = before

    array[row] = value
    return Edit(name, undo)


def _field(rng: np.random.Generator, model: Any, data: Any) -> Edit | None:
    """A row of some field: scaled, shifted, or one number that is none."""
    name = str(rng.choice(OFTEN if rng.random() < 0.5 else FIELDS))
    array = getattr(model, name)
    if not array.size:
        return None
    row = int(rng.integers(len(array)))
    value = np.array(array[row], dtype=np.float64)
    how = rng.random()
    if how < 0.02:
        value.flat[rng.integers(value.size)] = rng.choice([np.nan, np.inf])
    elif how < 0.5:
        value = value * np.exp(rng.uniform(-0.7, 0.7, value.shape))
    else:
        value = value + rng.normal(size=value.shape) * between(rng, 1e-5, 0.05)
    if name.endswith("quat") and np.isfinite(value).all() and rng.random() < 0.9:
        value /= np.linalg.norm(value)
    if name == "geom_pos" and rng.random() < 0.5:
        model.geom_sameframe[row] = 0
    return _array(model, name, row, value)


def _mask(rng: np.random.Generator, model: Any, data: Any) -> Edit | None:
    name = str(rng.choice(_MASKS))
    array = getattr(model, name)
    if not array.size:
        return None
    return _array(model, name, int(rng.integers(len(array))), int(rng.integers(4)))


def _option(rng: np.random.Generator, model: Any, data: Any) -> Edit:
    option = model.opt
    name = str(rng.choice([*_OPTIONS, "integrator", "solver", "cone", "iterations", "jacobian"]))
    before = np.copy(getattr(option, name))
    if name == "gravity":
        option.gravity[:] = rng.normal(size=3) * 10
    elif name in _OPTIONS:
        absurd = rng.choice([0.0, -1e-3, np.nan, np.inf])
        value = absurd if rng.random() < 0.1 else (before or 1e-3) * between(rng, 0.3, 3)
        setattr(option, name, float(value))
    else:
        counts = {"integrator": 5, "solver": 3, "cone": 2, "iterations": 50, "jacobian": 3}
        setattr(option, name, int(rng.integers(counts[name])))

    def undo() -> None:
        if name == "gravity":
            option.gravity[:] = before
        else:
            setattr(option, name, before.item())

    return Edit(f"opt.{name}", undo)


def _flag(rng: np.random.Generator, model: Any, data: Any) -> Edit:
    name = "disableflags" if rng.random() < 0.7 else "enableflags"
    kinds = mujoco.mjtDisableBit if name == "disableflags" else mujoco.mjtEnableBit
    bits = [int(bit) for key, bit in kinds.__members__.items() if not key.startswith("mjN")]
    before = int(getattr(model.opt, name))
    setattr(model.opt, name, before ^ int(rng.choice(bits)))
    return Edit(f"opt.{name}", lambda: setattr(model.opt, name, before))


def _state(rng: np.random.Generator, model: Any, data: Any) -> Edit | None:
    """A number of the state or of what drives it."""
    name = str(rng.choice(["qpos", "qvel", "ctrl", "xfrc_applied", "qfrc_applied", "mocap_pos"]))
    array = getattr(data, name)
    if not array.size:
        return None
    row = int(rng.integers(len(array)))
    spread = {"qpos": 0.05, "qvel": 20.0, "mocap_pos": 0.05}.get(name, 10.0)
    shape = np.shape(array[row])
    return _array(data, name, row, array[row] + rng.normal(size=shape) * between(rng, 1e-3, spread))


def _kind(rng: np.random.Generator, model: Any, data: Any) -> Edit | None:
    """Another kind of geom, of the same numbers."""
    row, kinds = int(rng.integers(model.ngeom)), mujoco.mjtGeom
    numbers = [int(getattr(kinds, f"mjGEOM_{kind}")) for kind in _KINDS]
    if int(model.geom_type[row]) not in numbers:
        return None
    model.geom_size[row] = np.maximum(model.geom_size[row], 1e-3)
    return _array(model, "geom_type", row, int(rng.choice(numbers)))


def _switch(rng: np.random.Generator, model: Any, data: Any) -> Edit | None:
    if not model.neq:
        return None
    row = int(rng.integers(model.neq))
    return _array(data, "eq_active", row, not data.eq_active[row])


def _begin(rng: np.random.Generator, model: Any, data: Any) -> Edit | None:
    """A new start, rarely: from the reference pose, thrown in any direction."""
    if rng.random() < 0.7:
        return None
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION)
    state = np.zeros(size)
    mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
    mujoco.mj_resetData(model, data)
    data.qvel[:] = rng.normal(size=model.nv) * between(rng, 0.1, 10)

    def undo() -> None:
        mujoco.mj_setState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)

    return Edit("reset", undo)
