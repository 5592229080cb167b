"""A piece of a step in which the solver stops the approach of chosen pairs before they are deep."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.contacts.guard.stiffening import Pair, Stiffening

Array = NDArray[np.float64]

#: Share of a depth that a piece may push out for each whole step that it lasts.
PUSH = 0.2
#: Time constant of a row that the integrator ``discrete`` is to resolve within the step [s].
RIGID = 1e-6


class Rows:
    """Steps with contact rows of their own.

    The margins of the chosen pairs are as wide as the pair may travel, so that MuJoCo lists every
    place in which they are about to meet. Between ``mj_step1`` and ``mj_step2`` each of their rows
    gets the velocity that it is to have at the end: for a gap d and a piece of length h no faster
    than d / h towards each other, and in overlap none. The solver then finds the least change of
    velocity (in the metric of the inertia) that obeys; as all these velocities allow standing
    still, that change takes energy and never adds any, except for what pushes an overlap out.

    Args:
        model: MjModel; its margins are changed within a piece and put back.
        data: MjData.
        stiffening: Says what carries the parameters of a pair.
    """

    def __init__(self, model: Any, data: Any, stiffening: Stiffening) -> None:
        """Note which integrator takes which edits."""
        self._model, self._data, self._place = model, data, stiffening.place
        self._geoms = np.zeros(model.ngeom + 1, dtype=bool)  # the last stands for "no geom"
        self._flexes = np.zeros(model.nflex + 1, dtype=bool)

    def step(self, length: float, margins: Mapping[Pair, float], push: float) -> None:
        """One ``mj_step`` of ``length`` [s].

        Args:
            length: Becomes ``opt.timestep``.
            margins: The chosen pairs, and how far each may travel [m].
            push: Greatest speed at which an overlap is pushed out, as a rate of its depth [1/s].
        """
        model, data = self._model, self._data
        model.opt.timestep = length
        saved = [(array, place, array[place].copy()) for array, place in self._places(margins)]
        flags = int(model.opt.disableflags)
        discrete = model.opt.integrator == mujoco.mjtIntegrator.mjINT_DISCRETE
        try:
            self._widen(margins, discrete)
            if discrete:
                model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_REFSAFE)
            mujoco.mj_step1(model, data)
            self._aim(length, push, discrete)
            mujoco.mj_step2(model, data)
        finally:
            model.opt.disableflags = flags
            for array, place, value in reversed(saved):
                array[place] = value

    def _places(self, margins: Mapping[Pair, float]) -> list[tuple[Any, int]]:
        model = self._model
        out: list[tuple[Any, int]] = []
        for pair in margins:
            kind, number = self._place(pair)
            out.append((getattr(model, f"{kind}_margin"), number))
            out.append((getattr(model, f"{kind}_solref"), number))
        return out

    def _widen(self, margins: Mapping[Pair, float], discrete: bool) -> None:
        model = self._model
        self._geoms[:] = self._flexes[:] = False
        for pair, margin in margins.items():
            kind, number = self._place(pair)
            array = getattr(model, f"{kind}_margin")
            array[number] = max(float(array[number]), margin)
            if discrete:
                getattr(model, f"{kind}_solref")[number] = (RIGID, 1.0)
            if kind == "flex":
                self._flexes[number] = True
            elif kind == "geom":
                self._geoms[number] = True
            else:
                self._geoms[[model.pair_geom1[number], model.pair_geom2[number]]] = True

    def _aim(self, length: float, push: float, discrete: bool) -> None:
        """Give the rows of chosen contacts their velocities."""
        data = self._data
        if not data.ncon or not data.nefc:
            return
        contact = data.contact
        chosen = (self._geoms[contact.geom] | self._flexes[contact.flex]).any(axis=1)
        chosen &= contact.efc_address >= 0
        if not chosen.any():
            return
        first, dim, distance = (
            contact.efc_address[chosen],
            contact.dim[chosen],
            contact.dist[chosen],
        )
        speed = np.where(distance > 0, -distance / length, np.maximum(-distance * push, 0.0))
        pyramids = self._model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL
        count = np.where(dim == 1, 1, 2 * (dim - 1)) if pyramids else np.ones_like(dim)
        rows = np.repeat(first, count) + np.arange(count.sum())
        rows -= np.repeat(np.cumsum(count) - count, count)
        now = data.efc_vel
        # Both edges of a pyramid's first direction have the normal speed in their middle.
        normal = np.where(
            count > 1, 0.5 * (now[first] + now[first + np.minimum(count, 2) - 1]), now[first]
        )
        # Friction acts where they touch; across a gap only what goes along the normal is stopped.
        slip = now[rows] - np.repeat(normal, count)
        aim = np.repeat(speed, count) + np.where(np.repeat(distance, count) > 0, slip, 0.0)
        if discrete:
            data.efc_margin[rows] = data.efc_pos[rows] + length * aim
        else:
            data.efc_aref[rows] = (aim - now[rows]) / length
