"""Places of things that were asked for by name; a check that episodes begin without contact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import mujoco
import numpy as np

from tauguard.models import BodyProxy, Cloth, Person, Scene, Table, cura6

#: The lines on which body regions cross: position, direction and length in units of the arm's
#: reach.
LINES = {
    "hand": ((0.55, 0.0, 0.40), (0.0, 1.0, 0.0)),
    "lower_arm": ((0.70, 0.10, 0.30), (1.0, 0.0, 0.0)),
    "upper_arm": ((0.75, -0.10, 0.45), (1.0, 0.3, 0.0)),
    "chest": ((0.95, 0.0, 0.45), (0.2, 1.0, 0.0)),
}
#: Any other region's.
OTHER_LINE = ((0.85, 0.0, 0.50), (0.0, 1.0, 0.0))
#: Distance of a person's hips from the arm [reach], and the least distance [m].
OPPOSITE, NEAREST_PERSON = 0.9, 0.6
#: Reach of the arm for which tables, cloths and second arms are placed in metres [m].
USUAL_REACH = 1.146
#: Names of a second arm's parts begin with this.
SECOND = "arm2_"
#: A thing that overlaps the arm is moved by this distance [m], at most this number of times.
STEP, MOVES = 0.05, 16


class StartsInContact(ValueError):
    """An episode cannot begin because the arm overlaps something; ``kind`` is what it overlaps."""

    def __init__(self, kind: str, link: str, other: str, depth: float) -> None:
        """Name the pair."""
        self.kind = kind
        super().__init__(
            f"the episode begins in contact: {link} is {1000 * depth:.1f} mm inside {other}; "
            "expected a place that the arm leaves free at home"
        )


@dataclass(frozen=True)
class Layout:
    """Places of the things that were asked for by name."""

    reach: float  #: of the arm [m]
    own: bool = True  #: the arm of the package, for which places are stated in metres
    moved: Mapping[str, float] = field(default_factory=dict)
    """How far each kind of thing moves to be clear of the arm [m]: "person" and "cloth" away from
    the base, "table" down, "second arm" away."""

    @classmethod
    def of(cls, bare: Scene, reach: float, moved: Mapping[str, float]) -> Layout:
        """Of an arm with a reach."""
        return cls(reach, bare.facts.name in cura6.NAMES, moved)

    @property
    def scale(self) -> float:
        """Of lengths that are stated for the package's arm."""
        return 1.0 if self.own else self.reach / USUAL_REACH

    def crossing(self, region: str) -> BodyProxy:
        """A body region on its line through the workspace."""
        position, direction = LINES.get(region, OTHER_LINE)
        x, y, z = (self.reach * c for c in position)
        return BodyProxy(region, position=(x, y, z), direction=direction)

    def opposite(self) -> Person:
        """A person at work opposite the arm, within its reach."""
        return Person(position=(max(OPPOSITE * self.reach, NEAREST_PERSON), 0.0))

    def person(self, someone: Person) -> Person:
        """Farther from the arm, where that is needed."""
        far = self.moved.get("person", 0.0)
        if not far:
            return someone
        away = -far * np.array([np.cos(someone.facing), np.sin(someone.facing)])
        x, y = (np.array(someone.position) + away).tolist()
        return replace(someone, position=(x, y))

    def table(self, board: Table) -> Table:
        """A table for this arm."""
        if self.scale == 1.0 and not self.moved.get("table"):
            return board
        x, y, z = (self.scale * c for c in board.position)
        a, b, c = (self.scale * c for c in board.half_extents)
        return Table((x, y, z - self.moved.get("table", 0.0)), (a, b, c))

    def cloth(self, sheet: Cloth) -> Cloth:
        """A cloth for this arm."""
        if self.scale == 1.0 and not self.moved.get("cloth"):
            return sheet
        x, y, z = (self.scale * c for c in sheet.position)
        place = (x + self.moved.get("cloth", 0.0), y, z)
        return replace(sheet, position=place, size=self.scale * sheet.size)

    def second_arm(self, place: tuple[float, float, float]) -> tuple[float, float, float]:
        """Where a second arm stands, in the first one's frame [m]."""
        x, y, z = (self.scale * c for c in place)
        return x + self.moved.get("second arm", 0.0), y, z


class Usual:
    """The places of things that were asked for by name, unless a task defines others."""

    @classmethod
    def proxy(cls, region: str, bare: Scene, layout: Layout) -> BodyProxy:
        """A body region that was asked for by name."""
        return layout.crossing(region)

    @classmethod
    def person(cls, bare: Scene, layout: Layout) -> Person:
        """Where "person" stands."""
        return layout.opposite()


def check_clear(
    scene: Scene, model: mujoco.MjModel, scratch: mujoco.MjData, data: mujoco.MjData
) -> None:
    """Whether the arm of a state overlaps nothing.

    Args:
        scene: what is simulated.
        model: the scene's, or a variant of it.
        scratch: data of the model, overwritten.
        data: the state.

    Raises:
        StartsInContact: it does; the deepest overlap.
    """
    for name in ("qpos", "mocap_pos", "mocap_quat"):
        getattr(scratch, name)[:] = getattr(data, name)
    mujoco.mj_fwdPosition(model, scratch)
    if not scratch.ncon:
        return
    contacts, links = scratch.contact, set(scene.link_bodies.tolist())
    bodies = np.where(contacts.geom >= 0, model.geom_bodyid[contacts.geom], -1)
    arm = np.isin(bodies, list(links))
    depth = np.where(arm.any(axis=1), -contacts.dist, -np.inf)
    k = int(np.argmax(depth))
    if depth[k] <= 0:
        return
    side = int(np.argmax(arm[k]))
    other = 1 - side
    link = model.body(int(bodies[k, side])).name
    geom, flex = int(contacts.geom[k, other]), int(contacts.flex[k, other])
    if geom < 0:
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX, flex) or "cloth"
    else:
        name = model.geom(geom).name or model.body(int(bodies[k, other])).name
    kinds = {"person_": "person", "table": "table", SECOND: "second arm"}
    kind = next((kinds[start] for start in kinds if name.startswith(start)), name)
    if geom < 0:
        kind = "cloth"
    elif kind == name and link.startswith(SECOND):  # the first arm's base
        kind = "second arm"
    raise StartsInContact(kind, link, name, float(depth[k]))
