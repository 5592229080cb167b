"""The interface that a library implements to take part, and the known adapters."""

import importlib
from typing import Any, Protocol

from tauguard.findings import ArgumentError
from tauguard.hard_cases.case import KINDS

#: The adapters of the package: name of the library, and module and class of its adapter.
BUILT_IN = {
    "tauguard": "tauguard.hard_cases.libraries.ours:Ours",
    "ipctk": "tauguard.hard_cases.libraries.ipctk_adapter:Ipctk",
    "coal": "tauguard.hard_cases.libraries.coal_adapter:Coal",
    "mujoco": "tauguard.hard_cases.libraries.mujoco_adapter:MuJoCo",
    "mujoco-speculative": "tauguard.hard_cases.libraries.mujoco_adapter:Speculative",
    "explicit-observer": "tauguard.hard_cases.libraries.explicit_observer:ExplicitObserver",
}


class Adapter(Protocol):
    """Interface of a library. Only ``name`` is required; kinds without a method are skipped.

    A case for which a method raises ``NotImplementedError`` is skipped, too.

    The methods and their results::

        vertex_face(x_t0, x_t1) -> time of impact or None     rows v, f0, f1, f2; shape (4, 3)
        edge_edge(x_t0, x_t1) -> time of impact or None       rows a0, a1, b0, b1; shape (4, 3)
        convex_overlap(a, b) -> bool                          corners, shapes (n, 3) and (m, 3)
        convex_sweep(a, b, displacement) -> time or None      b moves, a rests; touching counts
        convex_motion(a, b, motion_a, motion_b) -> time or None   see below
        mesh_distance(vertices_a, faces_a, vertices_b, faces_b) -> float     of closed meshes
        point_in_mesh(vertices, faces, point) -> bool         a point on the surface is inside
        mesh_ray(vertices, faces, origin, direction) -> multiple of the direction, or None
        scene(mjcf, seconds) -> float                         last value of the sensor "answer"
        observer(mjcf, t, q, qd, tau, gain) -> float          last residual of the first joint

    Times are in [0, 1] of the step. A distance is negative where meshes overlap. A motion is a
    dictionary: ``position`` [m] and ``rotation`` (a rotation vector [rad]) of the body's frame at
    the start, ``linear`` [m] and ``angular`` [rad] over the step, at constant rates. A scene starts
    from its first keyframe, if it has one.
    """

    name: str


def adapters(names: tuple[str, ...] = ()) -> list[Adapter]:
    """Adapters by name of a library or by ``module:Class``; by default all installed libraries.

    Raises:
        ArgumentError: a text that is neither a known name nor an importable class, or a class that
            needs arguments, has no ``name`` or has none of the methods.
    """
    if not names:
        return [one for one in map(_installed, BUILT_IN.values()) if one is not None]
    return [_named(name) for name in names]


def _installed(place: str) -> Adapter | None:
    try:
        return _make(place)
    except ImportError:
        return None


def _named(name: str) -> Adapter:
    place = BUILT_IN.get(name, name)
    if ":" not in place:
        raise ArgumentError(
            f"adapter {name!r}: expected one of {', '.join(BUILT_IN)}, or module:Class"
        )
    try:
        return _make(place)
    except ModuleNotFoundError as error:
        where = "; modules are looked for in the working folder and on PYTHONPATH"
        raise ArgumentError(f"adapter {name!r}: {error}{where}") from None
    except (ImportError, AttributeError, TypeError) as error:
        raise ArgumentError(f"adapter {name!r}: {error}") from None


def _make(place: str) -> Adapter:
    module, _, attribute = place.partition(":")
    made: Any = getattr(importlib.import_module(module), attribute)()
    if not isinstance(getattr(made, "name", None), str):
        raise ArgumentError(f"adapter {place!r}: it has no name")
    if not any(hasattr(made, kind) for kind in KINDS):
        raise ArgumentError(f"adapter {place!r}: it has none of the methods {', '.join(KINDS)}")
    adapter: Adapter = made
    return adapter
