"""A hanging or stretched cloth: MuJoCo's two-dimensional flex."""

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.findings import ArgumentError
from tauguard.models.checks import above_zero, not_negative

Vector = tuple[float, float, float]

#: Fixed vertices: none, the upper edge, the two upper corners, or all four edges.
PINS = ("none", "edge", "corners", "frame")

#: Rayleigh damping of an elastic sheet's stiffness [s].
RAYLEIGH = 1e-5


@dataclass(frozen=True)
class Cloth:
    """A square cloth of ``count`` x ``count`` vertices in its own x-y plane, edges along x and y.

    A step with a cloth of about 20 x 20 takes a hundred times as long as one with the arm alone.
    """

    count: int = 15  #: vertices along each side
    size: float = 0.6  #: side [m]
    mass: float = 0.2  #: [kg]
    radius: float = 1e-3  #: half the thickness in contacts [m]
    position: Vector = (0.7, 0.0, 0.8)  #: position of the centre [m]
    quat_wxyz: tuple[float, float, float, float] = (0.5, 0.5, 0.5, 0.5)
    """Orientation; by default the sheet is vertical, its normal along the world's x, its y up."""
    pinned: str = "edge"  #: one of :data:`PINS`
    damping: float = 0.01  #: damping of the edges [1/s]; not used for an elastic sheet
    young: float | None = None
    """Young's modulus of an elastic sheet of thickness 2 ``radius`` [Pa], Poisson's ratio 0.3.

    It needs the integrator ``discrete``. ``None``: edges that hold their length by constraints.
    """
    solref: tuple[float, float] = (0.003, 1.0)  #: MuJoCo's contact parameters
    self_collide: bool = False

    def __post_init__(self) -> None:
        """Check the values: ``ArgumentError`` names the one that is out of range."""
        if not (isinstance(self.count, int) and 2 <= self.count <= 200):
            raise ArgumentError(f"Cloth.count {self.count}: expected a whole number from 2 to 200")
        above_zero(self, "size", "mass", "radius")
        not_negative(self, "damping")
        if self.young is not None:
            above_zero(self, "young")
        if self.pinned not in PINS:
            raise ArgumentError(f"Cloth.pinned {self.pinned!r}: expected one of {', '.join(PINS)}")

    def pins(self) -> list[int]:
        """Indices of the fixed vertices; ``i * count + j`` is the i-th along x and j-th along y."""
        n = self.count
        i, j = np.divmod(np.arange(n * n), n)
        held = {
            "none": np.zeros(n * n, dtype=bool),
            "edge": j == n - 1,
            "corners": (j == n - 1) & ((i == 0) | (i == n - 1)),
            "frame": (i == 0) | (i == n - 1) | (j == 0) | (j == n - 1),
        }
        return [int(k) for k in np.flatnonzero(held[self.pinned])]


def add_cloth(spec: mujoco.MjSpec, cloth: Cloth) -> None:
    """Add the flex ``cloth_sheet`` to the world of ``spec``; it collides with the arm only."""
    spec.attach(
        mujoco.MjSpec.from_string(_text(cloth)),
        frame=spec.worldbody.add_frame(pos=cloth.position, quat=cloth.quat_wxyz),
        prefix="cloth_",
    )


def add_sheet(
    spec: mujoco.MjSpec,
    points: NDArray[np.float64],
    faces: NDArray[np.int32],
    mass: float,
    radius: float,
    young: float,
) -> None:
    """Add an elastic sheet of any shape, pinned nowhere, as the flex ``garment_sheet``.

    Args:
        spec: a spec with the integrator ``discrete``.
        points: Vertices at rest in the world frame. Shape (V, 3), m.
        faces: Shape (F, 3).
        mass: [kg].
        radius: half the thickness in contacts [m].
        young: Young's modulus [Pa]; Poisson's ratio is 0.3.
    """
    text = f"""<mujoco><worldbody><body name="frame">
      <flexcomp name="sheet" type="direct" dim="2" mass="{mass!r}" radius="{radius!r}"
        point="{_numbers(points)}" element="{_numbers(faces)}" rgba="0.35 0.5 0.75 1">
        {_elastic(young, radius)}
        <contact contype="2" conaffinity="1" condim="3" selfcollide="none" solref="0.003 1"/>
      </flexcomp></body></worldbody></mujoco>"""
    part = mujoco.MjSpec.from_string(text)
    spec.attach(part, frame=spec.worldbody.add_frame(), prefix="garment_")


def flex_elements(model: Any, flex: int) -> NDArray[np.int32]:
    """The simplices of a flex of a compiled model, shape (E, corners).

    They are indices into the vertices of all flexes.
    """
    corners = int(model.flex_dim[flex]) + 1
    start, count = int(model.flex_elemdataadr[flex]), int(model.flex_elemnum[flex])
    local = model.flex_elem[start : start + corners * count].reshape(-1, corners)
    return np.ascontiguousarray(local + model.flex_vertadr[flex], dtype=np.int32)


def _numbers(values: NDArray[Any]) -> str:
    return " ".join(map(repr, values.ravel().tolist()))


def _text(cloth: Cloth) -> str:
    spacing = cloth.size / (cloth.count - 1)
    pins = " ".join(map(str, cloth.pins()))
    pin = f'<pin id="{pins}"/>' if pins else ""
    own = "auto" if cloth.self_collide else "none"
    return f"""<mujoco><worldbody><body name="frame">
      <flexcomp name="sheet" type="grid" dim="2" count="{cloth.count} {cloth.count} 1"
        spacing="{spacing!r} {spacing!r} {spacing!r}" mass="{cloth.mass!r}"
        radius="{cloth.radius!r}" rgba="0.35 0.5 0.75 1">
        {_elasticity(cloth)}
        <contact contype="2" conaffinity="1" condim="3" selfcollide="{own}"
          solref="{cloth.solref[0]!r} {cloth.solref[1]!r}"/>
        {pin}
      </flexcomp></body></worldbody></mujoco>"""


def _elasticity(cloth: Cloth) -> str:
    if cloth.young is None:
        return f'<edge equality="true" damping="{cloth.damping!r}"/>'
    return _elastic(cloth.young, cloth.radius)


def _elastic(young: float, radius: float) -> str:
    return (
        f'<elasticity elastic2d="stretch" young="{young!r}" poisson="0.3" '
        f'thickness="{2 * radius!r}" damping="{RAYLEIGH!r}"/>'
    )
