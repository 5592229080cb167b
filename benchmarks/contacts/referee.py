"""Whether something has passed through, judged from outside: by points, planes and solid angles."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.benchmarks.contacts.thrown import Thrown
from tauguard.contacts import State
from tauguard.contacts.guard.balance import sheets_of

Array = NDArray[np.float64]

#: Places on the way of a step at which a cloth is looked at.
LOOKS = 32


class Referee:
    """Follows a scene step by step.

    Plates and walls: no point of a moving body's skeleton crosses the middle plane of a box, within
    its outline less its thickness, on the straight way of a step. Head-on bodies: the centres do
    not change sides. Cloth: the solid angle under which the body's centre sees it does not jump.

    Attributes:
        passed: Whether something has passed through so far.
        energy: The most that kinetic, potential and elastic energy have been in all, less the
            potential and elastic one of the start, over the kinetic one of the start.
    """

    def __init__(self, scene: Thrown, model: Any, data: Any) -> None:
        """Look at the first state."""
        self._scene, self._model, self._data = scene, model, data
        self._scratch = mujoco.MjData(model)
        self._sheets = sheets_of(model)
        walls = [g for g in range(model.ngeom) if model.geom(g).name.startswith(("plate", "wall"))]
        self._walls = [(g, *_slab(model, g)) for g in walls]
        self._bodies = {model.geom(name).id: x for name, x in scene.skeletons.items()}
        self.passed, self.energy, self._sides = False, 1.0, 0.0
        self._state = State.of(model, data, self._scratch)
        self._start, self._kinetic = self._energies()
        if model.nflex:
            self._triangles = model.flex_elem.reshape(-1, 3)
            self._sides = self._angle(self._state, self._state, 0.0)

    def look(self) -> None:
        """Look at the state after one more step."""
        if not np.isfinite(self._data.qpos).all():
            self.passed, self.energy = True, np.inf
            return
        before, self._state = self._state, State.of(self._model, self._data, self._scratch)
        if self._model.nflex:
            self._look_at_cloth(before)
        elif self._scene.family == "pair":
            self._look_at_pair(before)
        else:
            self._look_at_walls(before)
        if not self._model.nu:
            total = sum(self._energies()) - self._start
            self.energy = max(self.energy, total / self._kinetic)

    def _look_at_walls(self, before: State) -> None:
        for wall, axis, half in self._walls:
            for geom, points in self._bodies.items():
                a, b = (self._seen(s, geom, points, wall) for s in (before, self._state))
                share = a[:, axis] / np.where(a[:, axis] == b[:, axis], 1, a[:, axis] - b[:, axis])
                where = np.abs(a + share[:, None] * (b - a)) < half - half[axis]
                where[:, axis] = True
                crosses = a[:, axis] * b[:, axis] < 0
                self.passed |= bool((crosses & where.all(axis=1)).any())

    def _seen(self, state: State, geom: int, points: Array, wall: int) -> Array:
        """Points of a geom in the frame of another."""
        x = points @ state.geom_xmat[geom].reshape(3, 3).T + state.geom_xpos[geom]
        return np.asarray((x - state.geom_xpos[wall]) @ self._turned(state, wall))

    def _turned(self, state: State, wall: int) -> Array:
        turn = state.geom_xmat[wall].reshape(3, 3)
        if self._model.geom_type[wall] != mujoco.mjtGeom.mjGEOM_MESH:
            return np.asarray(turn)
        return np.asarray(state.xmat[self._model.geom_bodyid[wall]].reshape(3, 3))

    def _look_at_pair(self, before: State) -> None:
        one, other = self._bodies
        a, b = (s.geom_xpos[other] - s.geom_xpos[one] for s in (before, self._state))
        way = b - a
        share = float(np.clip(-(a @ way) / max(float(way @ way), 1e-300), 0, 1))
        near = float(np.linalg.norm(a + share * way))
        self.passed |= near < 0.1 * float(self._model.geom_size[[one, other], 0].sum())

    def _look_at_cloth(self, before: State) -> None:
        for share in np.linspace(0, 1, LOOKS + 1)[1:]:
            side = self._angle(before, self._state, float(share))
            self.passed ^= bool(abs(side - self._sides) > 2 * np.pi)
            self._sides = side

    def _angle(self, before: State, after: State, share: float) -> float:
        """The solid angle of the cloth from the body's centre; jumps by 4 pi where it passes."""
        geom = next(iter(self._bodies))
        x = before.flexvert_xpos + share * (after.flexvert_xpos - before.flexvert_xpos)
        at = before.geom_xpos[geom] + share * (after.geom_xpos[geom] - before.geom_xpos[geom])
        a, b, c = (x[self._triangles] - at).transpose(1, 2, 0)
        la, lb, lc = (np.sqrt((v * v).sum(axis=0)) for v in (a, b, c))
        top = (a * np.cross(b, c, axis=0)).sum(axis=0)
        bottom = la * lb * lc + (a * b).sum(0) * lc + (b * c).sum(0) * la + (c * a).sum(0) * lb
        return float(2 * np.arctan2(top, bottom).sum())

    def _energies(self) -> tuple[float, float]:
        """Potential and elastic, and kinetic energy [J]."""
        model, scratch = self._model, self._scratch
        scratch.qvel[:] = self._data.qvel
        mujoco.mj_fwdPosition(model, scratch)
        mujoco.mj_energyPos(model, scratch)
        mujoco.mj_energyVel(model, scratch)
        stretch = sum(sheet.energy(scratch.flexvert_xpos) for sheet in self._sheets)
        return float(scratch.energy[0]) + stretch, float(scratch.energy[1])


def _slab(model: Any, geom: int) -> tuple[int, Array]:
    """The thin axis of a box and its half sizes [m]; of a mesh, of its own box."""
    half = model.geom_size[geom]
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = int(model.geom_dataid[geom])
        begin, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
        half = np.abs(model.mesh_vert[begin : begin + count] @ turn.reshape(3, 3).T).max(axis=0)
    return int(np.argmin(half)), half
