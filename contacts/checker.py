"""The interface of contact checkers, which find the contacts between two states."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any, Protocol, runtime_checkable

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array, in_a_line
from tauguard.contacts._contacts import all_finite, carried
from tauguard.findings import ArgumentError

Index = NDArray[np.int32]

#: Kinds of partners of a contact: MuJoCo's geom types, and flexes.
KINDS = (
    "plane",
    "hfield",
    "sphere",
    "capsule",
    "ellipsoid",
    "cylinder",
    "box",
    "mesh",
    "sdf",
    "flex",
)


#: Fields of MjData that determine the kinematics of a state.
POSE = int(
    mujoco.mjtState.mjSTATE_QPOS
    | mujoco.mjtState.mjSTATE_MOCAP_POS
    | mujoco.mjtState.mjSTATE_MOCAP_QUAT
)


_NO_VERTICES = np.zeros((0, 3))


@dataclass(frozen=True, eq=False)
class State:
    """Positions and velocities of the scene at one instant.

    Two states define a path. A point y of a body moves as ``xpos + t dx + exp(t [w]x) xmat y``, t
    in [0, 1], where dx is the difference of both xpos and w is the shortest rotation vector from
    one xmat to the other (as in ``mj_integratePos`` with a free joint). Flex vertices move
    linearly. Checkers and the ground truth report contacts on this path.

    Attributes:
        time: [s].
        qpos: Shape (nq,), m and rad.
        qvel: Shape (nv,), m/s and rad/s.
        xpos: Origins of the bodies. Shape (nbody, 3), m.
        xmat: Rotations of the bodies, by rows. Shape (nbody, 9).
        geom_xpos: Centres of the geoms. Shape (ngeom, 3), m.
        geom_xmat: Rotations of the geoms, by rows. Shape (ngeom, 9).
        flexvert_xpos: Vertices of the flexes. Shape (nflexvert, 3), m.
    """

    time: float
    qpos: Array
    qvel: Array
    xpos: Array
    xmat: Array
    geom_xpos: Array
    geom_xmat: Array
    flexvert_xpos: Array

    @classmethod
    def of(cls, model: Any, data: Any, scratch: Any = None) -> State:
        """The state of ``data``, with the kinematics of ``data.qpos``; ``data`` is not changed.

        ``mj_step`` leaves ``data.xpos`` and the other poses at their values of the start of the
        step. So the kinematics are computed again, in ``scratch``.

        Args:
            model: MjModel.
            data: MjData.
            scratch: Another MjData of the model, which is overwritten. ``None`` makes one, which is
                slow in a loop.
        """
        scratch = mujoco.MjData(model) if scratch is None else scratch
        mujoco.mj_copyState(model, data, scratch, POSE)
        mujoco.mj_kinematics(model, scratch)
        if not model.nflex:
            vertices = _NO_VERTICES
        elif model.flex_interp.any():
            mujoco.mj_comPos(model, scratch)
            mujoco.mj_flex(model, scratch)
            vertices = scratch.flexvert_xpos.copy()
        else:
            vertices = carried(scratch.xpos, scratch.xmat, model.flex_vertbodyid, model.flex_vert)
        return cls(
            time=float(data.time),
            qpos=data.qpos.copy(),
            qvel=data.qvel.copy(),
            xpos=scratch.xpos.copy(),
            xmat=scratch.xmat.copy(),
            geom_xpos=scratch.geom_xpos.copy(),
            geom_xmat=scratch.geom_xmat.copy(),
            flexvert_xpos=vertices,
        )


def checked(name: str, state: State, bodies: int, vertices: int = 0) -> State:
    """Check that the poses of ``state`` are finite and of the model's size, and return it.

    Raises:
        ArgumentError: a wrong shape, or an entry that is not finite; the message names the field
            and the first bad row.
    """
    xpos, xmat, x = state.xpos, state.xmat, state.flexvert_xpos
    if (
        xpos.shape == (bodies, 3)
        and xmat.shape == (bodies, 9)
        and (not vertices or x.shape == (vertices, 3))
        and all_finite(xpos, xmat, x if vertices else xpos)
    ):
        return state
    shapes = {"xpos": (bodies, 3), "xmat": (bodies, 9)}
    if vertices:
        shapes["flexvert_xpos"] = (vertices, 3)
    for field_name, shape in shapes.items():
        value = getattr(state, field_name)
        if value.shape != shape:
            raise ArgumentError(f"{name}.{field_name}: shape {value.shape}, the model has {shape}")
        if not np.isfinite(value).all():
            row = int(np.argmin(np.isfinite(value).all(axis=1)))
            raise ArgumentError(
                f"{name}.{field_name}: row {row} is {value[row].tolist()}, not finite"
            )
    return state


@dataclass(frozen=True, eq=False)
class Contacts:
    """Contacts of one step, one per row.

    Attributes:
        time: Fraction of the step in [0, 1]; 0 for contacts that exist at the start. Shape (K,).
        geom: Geom id of each partner, -1 for a flex. Shape (K, 2).
        flex: Flex id of each partner, -1 for a geom. Shape (K, 2).
        feature: Vertex, edge or element of each partner, numbered by the checker (the checker
            ``mujoco``: ``contact.elem``, else ``contact.vert``); -1 if not given. Shape (K, 2).
        point: Contact point, world frame; NaN if unknown. Shape (K, 3), m.
        normal: Unit vector from the first partner to the second; NaN if unknown. Shape (K, 3).
        distance: Signed distance of the surfaces at ``time``, negative in penetration. Shape (K,),
            m.
    """

    time: Array
    geom: Index
    flex: Index
    feature: Index
    point: Array
    normal: Array
    distance: Array

    __repr__ = in_a_line

    def __post_init__(self) -> None:
        """Check the shapes; an ``ArgumentError`` names the field with the error."""
        count = np.shape(self.time)[0] if np.ndim(self.time) == 1 else -1
        for name, dtype, tail in _COLUMNS:
            given = getattr(self, name)
            value = np.asarray(given, dtype=dtype)
            if value.shape != (count, *tail):
                raise ArgumentError(f"{name}: shape {value.shape}, expected {('K', *tail)}")
            if value is not given:
                object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.time)

    @classmethod
    def empty(cls) -> Contacts:
        """No contacts; every call returns the same object."""
        return _EMPTY

    @classmethod
    def concatenate(cls, parts: Sequence[Contacts]) -> Contacts:
        """The rows of all ``parts`` in their order."""
        parts = [part for part in parts if len(part)]
        if not parts:
            return cls.empty()
        if len(parts) == 1:
            return parts[0]
        names = [field.name for field in fields(cls)]
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))

    def where(self, rows: NDArray[Any]) -> Contacts:
        """The contacts of ``rows``, a mask or indices."""
        return Contacts(*(getattr(self, field.name)[rows] for field in fields(self)))


_COLUMNS: tuple[tuple[str, type[np.generic], tuple[int, ...]], ...] = (
    ("time", np.float64, ()),
    ("geom", np.int32, (2,)),
    ("flex", np.int32, (2,)),
    ("feature", np.int32, (2,)),
    ("point", np.float64, (3,)),
    ("normal", np.float64, (3,)),
    ("distance", np.float64, ()),
)
_EMPTY = Contacts(*(np.zeros((0, *tail), dtype=dtype) for _, dtype, tail in _COLUMNS))


@runtime_checkable
class Checker(Protocol):
    """Finds the contacts of a step. A factory ``factory(model, **options)`` makes a checker.

    Attributes:
        name: The registered name.
        covers: Pairs of :data:`KINDS` that the checker can test, ordered by :func:`pair_kind`.
    """

    name: str
    covers: frozenset[tuple[str, str]]

    def check(self, before: State, after: State) -> Contacts:
        """The contacts on the path between both states, which :class:`State` defines."""
        ...


Factory = Callable[..., Checker]
_FACTORIES: dict[str, Factory] = {}


def reported(one: Checker, before: State, after: State) -> Contacts:
    """The contacts that the checker ``one`` reports for the step.

    Raises:
        TypeError: ``one.check`` did not return :class:`Contacts`.
    """
    found: object = one.check(before, after)
    if not isinstance(found, Contacts):
        raise TypeError(
            f"checker {one.name!r}: check returned {type(found).__name__}, expected Contacts "
            "(Contacts.empty() if nothing touches)"
        )
    return found


def register(name: str, factory: Factory, *, replace: bool = False) -> None:
    """Register a checker under ``name``.

    Args:
        name: Name of the checker.
        factory: ``factory(model, **options)`` returns a :class:`Checker`.
        replace: Whether to replace an existing factory of this name.

    Raises:
        ArgumentError: an empty name, a name that is in use, or a factory that is not callable.
    """
    if not name:
        raise ArgumentError("name: empty, expected the name of a checker")
    if not callable(factory):
        raise ArgumentError(f"factory: {factory!r} cannot be called; expected factory(model, ...)")
    if not replace and _FACTORIES.get(name, factory) is not factory:
        raise ArgumentError(
            f"checker {name!r}: already registered; choose another name, or pass replace=True"
        )
    _FACTORIES[name] = factory


def registered() -> tuple[str, ...]:
    """Names of all registered checkers."""
    return tuple(_FACTORIES)


def checker(name: str, model: Any, **options: Any) -> Checker:
    """The checker ``name`` for ``model``.

    Raises:
        ArgumentError: an unknown checker or option (the message lists the known ones), a geom that
            this checker cannot handle, a checker without ``name``, ``covers`` or ``check``, or an
            item of ``covers`` that is no pair of kinds in the order of :func:`pair_kind`.
    """
    if name not in _FACTORIES:
        raise ArgumentError(f"checker {name!r}: expected one of {', '.join(_FACTORIES) or 'none'}")
    factory = _FACTORIES[name]
    try:
        inspect.signature(factory).bind(model, **options)
    except TypeError as error:
        known = list(inspect.signature(factory).parameters)[1:]
        raise ArgumentError(
            f"checker {name!r}: {error}; its options are {', '.join(known) or 'none'}"
        ) from None
    made = factory(model, **options)
    for needed in ("name", "covers", "check"):
        if not hasattr(made, needed):
            raise ArgumentError(
                f"checker {name!r}: it has no {needed}; see tauguard.contacts.Checker"
            )
    for pair in made.covers:
        if len(pair) != 2 or pair_kind(*pair) != tuple(pair):
            raise ArgumentError(
                f"checker {name!r}: covers {pair!r}; expected pairs of kinds as "
                "tauguard.contacts.pair_kind gives them"
            )
    return made


def pair_kind(a: str, b: str) -> tuple[str, str]:
    """Two kinds in the order of :data:`KINDS`.

    Raises:
        ArgumentError: an unknown kind.
    """
    for kind in (a, b):
        if kind not in KINDS:
            raise ArgumentError(f"kind {kind!r}: expected one of {', '.join(KINDS)}")
    return (a, b) if KINDS.index(a) <= KINDS.index(b) else (b, a)


def geom_kinds(model: Any) -> list[str]:
    """The kind of each geom: one of :data:`KINDS`."""
    return [
        mujoco.mjtGeom(int(kind)).name.removeprefix("mjGEOM_").lower() for kind in model.geom_type
    ]
