"""Places of things that were asked for by name; a check that episodes begin without contact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import mujoco
import numpy as np

from tauguard.arrays import Array
from tauguard.models import BodyProxy, Cloth, Person, Scene, Table, cura6
from tauguard.models.scene import people_parts

Vector = tuple[float, float, float]

#: Line on which each body region crosses the workspace: position [times the reach], direction.
LINES = {
    "hand": ((0.55, 0.0, 0.40), (0.0, 1.0, 0.0)),
    "lower_arm": ((0.70, 0.10, 0.30), (1.0, 0.0, 0.0)),
    "upper_arm": ((0.75, -0.10, 0.45), (1.0, 0.3, 0.0)),
    "chest": ((0.95, 0.0, 0.45), (0.2, 1.0, 0.0)),
}
#: The line of any other region.
OTHER_LINE = ((0.85, 0.0, 0.50), (0.0, 1.0, 0.0))
#: Distance of a person's hips from the arm [reach], and the least distance [m].
OPPOSITE, NEAREST_PERSON = 0.9, 0.6
#: Reach of the package's arm [m]; the places of tables, cloths and second arms are stated for it.
USUAL_REACH = 1.146
#: Names of a second arm's parts begin with this.
SECOND = "arm2_"
#: Step by which an overlapping thing (a table, person, ...) is moved [m]; longer for a long arm.
STEP = 0.05
MOVES = 16  #: largest number of these steps
#: If the first joint is higher above the floor than this [reach], the arm stands on a pedestal.
SHOULDER = 0.5
#: Height of the first joint above the floor, if the arm works below that joint [reach].
HANGING = 1.1
#: People may overlap a table or an object by this depth [m].
LEANING = 0.01
#: Spacing of checked places along an object's path, and clearance for people's sway [m].
ALONG, ROOM = 0.05, 0.1
#: A base within this distance of the origin counts as at the origin [reach].
CENTRED = 0.1


class StartsInContact(ValueError):
    """An episode cannot begin because two bodies overlap; ``kind`` says what must be moved."""

    def __init__(self, kind: str, link: str, other: str, depth: float) -> None:
        """Name the pair."""
        self.kind = kind
        super().__init__(
            f"the episode begins in contact: {link} is {1000 * depth:.1f} mm inside {other}; "
            "expected a place that is free while the arm is at home"
        )


@dataclass(frozen=True)
class Layout:
    """Places of body regions, people, tables, cloths and second arms around an arm."""

    reach: float  #: the arm's reach [m]
    own: bool = True  #: whether the arm is the package's, for which places are stated in metres
    moved: Mapping[str, float] = field(default_factory=dict)
    """How far each kind is moved to be clear of the arm [m]: "table" down, "person", "cloth",
    "second arm" and body regions away from the base."""
    base: Vector = (0.0, 0.0, 0.0)  #: place of the arm's base on its floor [m]
    quarter: int = 0  #: direction in which the arm works: 0: x, 1: y, 2: -x, 3: -y

    @classmethod
    def of(cls, bare: Scene, reach: float, moved: Mapping[str, float]) -> Layout:
        """The layout of an arm from its place and from the direction that it faces at home."""
        if bare.facts.name in cura6.NAMES:
            return cls(reach, True, moved)
        model, data = bare.model, mujoco.MjData(bare.model)
        data.qpos[bare.qpos_adr] = bare.home
        mujoco.mj_kinematics(model, data)
        first = data.xanchor[model.joint(bare.joint_names[0]).id]
        x, y, up = data.xpos[bare.link_bodies[-1]] - first
        low = float(first[2]) - reach * (SHOULDER if up > -CENTRED * reach else HANGING)
        away = np.hypot(*first[:2]) > CENTRED * reach
        quarter = round(float(np.arctan2(y, x)) / (np.pi / 2)) % 4
        return cls(
            reach,
            False,
            moved,
            (*(first[:2].tolist() if away else (0.0, 0.0)), max(low, min(0.0, float(first[2])))),
            quarter if np.hypot(x, y) > CENTRED * reach else 0,
        )

    @property
    def yaw(self) -> float:
        """Angle about z of the direction that the arm faces [rad]."""
        return self.quarter * np.pi / 2

    def turn(self, direction: Vector) -> Vector:
        """Transform a direction from the arm's frame to the world."""
        x, y, z = direction
        x, y = ((x, y), (-y, x), (-x, -y), (y, -x))[self.quarter]
        return x, y, z

    def at(self, place: Vector) -> Vector:
        """Transform a place from the arm's frame to the world [m]."""
        x, y, z = self.turn(place)
        return x + self.base[0], y + self.base[1], z + self.base[2]

    def ahead(self, place: Array) -> tuple[float, float]:
        """How far a place in the world is ahead of the arm's base, and to its left [m]."""
        x, y = float(place[0]) - self.base[0], float(place[1]) - self.base[1]
        return ((x, y), (y, -x), (-x, -y), (-y, x))[self.quarter]

    @property
    def scale(self) -> float:
        """Factor for lengths that are stated for the package's arm."""
        return 1.0 if self.own else self.reach / USUAL_REACH

    def crossing(self, region: str) -> BodyProxy:
        """A body region on its line through the workspace."""
        position, direction = LINES.get(region, OTHER_LINE)
        x, y, z = (self.reach * c for c in position)
        place = (x + self.moved.get(region, 0.0), y, z)
        return BodyProxy(region, position=self.at(place), direction=self.turn(direction))

    def someone(self, ahead: float, left: float, facing: float, **about: Any) -> Person:
        """A person at a place [m] who faces a direction [rad], both in the arm's frame."""
        x, y, z = self.at((ahead, left, 0.0))
        floor = z + Person.floor if self.base[2] else Person.floor
        return Person(position=(x, y), facing=facing + self.yaw, floor=floor, **about)

    def opposite(self) -> Person:
        """A person at work opposite the arm, within its reach."""
        return self.someone(max(OPPOSITE * self.reach, NEAREST_PERSON), 0.0, np.pi)

    def person(self, someone: Person) -> Person:
        """``someone``, farther from the arm by ``moved["person"]``."""
        far = self.moved.get("person", 0.0)
        if not far:
            return someone
        away = -far * np.array([np.cos(someone.facing), np.sin(someone.facing)])
        x, y = (np.array(someone.position) + away).tolist()
        return replace(someone, position=(x, y))

    def table(self, board: Table) -> Table:
        """``board``, scaled and placed for this arm."""
        if self.own and not self.moved.get("table"):
            return board
        x, y, z = (self.scale * c for c in board.position)
        a, b, c = (self.scale * c for c in board.half_extents)
        extents = (b, a, c) if self.quarter % 2 else (a, b, c)
        return Table(self.at((x, y, z - self.moved.get("table", 0.0))), extents)

    def cloth(self, sheet: Cloth) -> Cloth:
        """``sheet``, scaled and placed for this arm."""
        if self.own and not self.moved.get("cloth"):
            return sheet
        x, y, z = (self.scale * c for c in sheet.position)
        place, quat = self.at((x + self.moved.get("cloth", 0.0), y, z)), np.zeros(4)
        mujoco.mju_mulQuat(quat, self.quat, sheet.quat_wxyz)
        w, i, j, k = quat.tolist()
        return replace(sheet, position=place, size=self.scale * sheet.size, quat_wxyz=(w, i, j, k))

    @property
    def quat(self) -> Array:
        """The arm's frame in the world, w x y z."""
        return np.array([np.cos(self.yaw / 2), 0.0, 0.0, np.sin(self.yaw / 2)])

    def apart(self, distance: float) -> float:
        """How far ahead a second arm stands [m]."""
        return self.scale * distance + self.moved.get("second arm", 0.0)

    def second_arm(self, distance: float) -> Vector:
        """Place of a second arm that faces the first [m]; its frame is turned by pi about z."""
        x, y, _ = self.at((self.apart(distance), 0.0, 0.0))
        return x + self.base[0], y + self.base[1], 0.0


class Usual:
    """The places of body regions and people given by name; a task can define others."""

    @classmethod
    def proxy(cls, region: str, bare: Scene, layout: Layout) -> BodyProxy:
        """The body region of this name."""
        return layout.crossing(region)

    @classmethod
    def person(cls, bare: Scene, layout: Layout) -> Person:
        """Where "person" stands."""
        return layout.opposite()


def check_clear(
    scene: Scene, model: mujoco.MjModel, scratch: mujoco.MjData, data: mujoco.MjData
) -> None:
    """Check that the arm overlaps nothing, and that people overlap no table or object.

    Args:
        scene: the simulated scene.
        model: the scene's model, or a variant of it.
        scratch: data of the model, overwritten.
        data: the state.

    Raises:
        StartsInContact: two bodies overlap; the message names them and the depth.
    """
    for name in ("qpos", "mocap_pos", "mocap_quat"):
        getattr(scratch, name)[:] = getattr(data, name)
    mujoco.mj_fwdPosition(model, scratch)
    _check_people(scene, model, scratch)
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
        name = _name(model, geom)
    kinds = {"person": "person", "table": "table", SECOND: "second arm"}
    kind = next((kinds[start] for start in kinds if name.startswith(start)), name)
    if geom < 0:
        kind = "cloth"
    elif kind == name and link.startswith(SECOND):  # the first arm's base
        kind = "second arm"
    raise StartsInContact(kind, link, name, float(depth[k]))


def things_around(scene: Scene, model: mujoco.MjModel) -> list[int]:
    """The geoms of the table and of objects. People do not collide with them in the simulation."""
    spec = scene.spec
    around = [model.geom("table").id] if spec.table is not None else []
    bodies = [model.body(obj.name).id for obj in spec.objects if obj.touchable]
    on = enumerate(model.geom_bodyid.tolist())
    return around + [g for g, body in on if any(carried(model, body, by) for by in bodies)]


def blocked_ground(scene: Scene) -> Array:
    """Areas that people avoid: smallest x and y, largest x and y of each geom [m], (k, 4)."""
    model, data = scene.model, mujoco.MjData(scene.model)
    mujoco.mj_forward(model, data)
    paths = {model.body(o.name).id: np.array(o.path)[:, 1:3] for o in scene.spec.objects if o.path}
    low = min((p.floor for p in scene.spec.people), default=0.0)
    high = max((p.floor + p.stature for p in scene.spec.people), default=0.0)
    rows = []
    for geom in things_around(scene, model):
        body, turned = int(model.geom_bodyid[geom]), data.geom_xmat[geom].reshape(3, 3)
        middle = data.geom_xpos[geom] + turned @ model.geom_aabb[geom, :3]
        half = np.abs(turned) @ model.geom_aabb[geom, 3:]
        if middle[2] - half[2] < high and middle[2] + half[2] > low:
            here = data.xpos[body, :2]
            places = middle[:2] + paths.get(body, here[None]) - here
            rows.append([*(places.min(axis=0) - half[:2]), *(places.max(axis=0) + half[:2])])
    return np.array(rows).reshape(-1, 4)


def _check_people(scene: Scene, model: mujoco.MjModel, placed: mujoco.MjData) -> None:
    """Check that people overlap no table or object, and stand in no object's path.

    The arms of people give way to moving objects, so they may be in a path.
    """
    spec, around = scene.spec, things_around(scene, model)
    paths = {model.body(o.name).id: o.places(ALONG) for o in spec.objects if o.path}
    for part in people_parts(spec) if around else ():
        own = model.geom(part.name).id
        yields = part.segment.region in ("upper_arm", "lower_arm", "hand")
        for geom in around:
            body = int(model.geom_bodyid[geom])
            start, at = placed.xpos[body].copy(), placed.geom_xpos[geom].copy()
            passes, name = body in paths and not yields, _name(model, geom)
            room = ROOM if passes else 0.0
            for place in paths[body] if passes else start[None]:
                placed.geom_xpos[geom] = at + place - start
                depth = room - mujoco.mj_geomDistance(model, placed, own, geom, 0.2, None)
                if depth > LEANING:
                    name += f" as it comes by, with {1000 * room:.0f} mm around it" if room else ""
                    raise StartsInContact("person", part.name, name, float(depth))
            placed.geom_xpos[geom] = at


def _name(model: mujoco.MjModel, geom: int) -> str:
    """Name of the geom's body; for a geom of the world its own name."""
    body = int(model.geom_bodyid[geom])
    return str(model.body(body).name if body else model.geom(geom).name)


def carried(model: mujoco.MjModel, body: int, by: int) -> bool:
    """Whether ``body`` is the body ``by`` or one of its descendants."""
    while body > by:
        body = int(model.body_parentid[body])
    return body == by
