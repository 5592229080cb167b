"""Steps without tunnelling: plain steps, or sub-steps in which the solver stops the approach."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.contacts._contacts import Guard
from tauguard.contacts.guard.covered import Covered, names
from tauguard.contacts.guard.energy_budget import EnergyBalance, EnergyMeter, sheets_of
from tauguard.contacts.guard.engine import INTEGRATION, PHYSICS, REFUSED, addresses
from tauguard.contacts.guard.followed_fields import (
    followed_fields,
    numbers,
    refuse_structure,
    refuse_values,
    structure,
)
from tauguard.contacts.guard.impact_zone import Hit, impact_zone
from tauguard.contacts.guard.mocap import pulled
from tauguard.contacts.guard.report import Cut, Pair, StepReport, partner_name
from tauguard.contacts.guard.tunnelling import TunnellingEvents, elements
from tauguard.models.mujoco_defects import warn_of_sparse_newton

#: Settings of the native part.
SETTINGS = {
    "beyond": 1e-5,  # how far beyond the touch a cut sub-step goes, so that MuJoCo finds it [m]
    "room": 1.25,  # margins over what the pair travelled in the attempt that failed
    "smallest": 1 / 64,  # sub-steps up to this fraction of the step are not cut further
    "push": 0.2,  # fraction of a depth that is pushed out in each step
    "watched": 10,  # number of accepted steps after a rollback in which energy is counted
    "look": 16,  # number of steps after which separation of pairs is checked at the latest
    "allowed": 0.01,  # energy budget: fraction of the first kinetic energy that contacts may add
    "deeper_geom": 1 / 8,  # sub-steps above this fraction may not deepen a held pair
    "deeper_flex": 1 / 2,  # the same for a flex
    "turned": 1.0,  # rotation in a step above which its whole turns are counted [rad]
}


class GuardedStepper:
    """``mj_step`` that lets no pair pass through itself.

    Between two steps everything in ``model`` and ``data`` may be changed. The next step uses the
    change, or refuses it by name. The path of a geom that an edit moves is not checked. An error of
    MuJoCo's or an exception in ``each`` restores the state before the step. Copies, deep copies and
    unpickled guards continue with the same bits; a plain copy shares model and data.

    A plain step is tried first. It is accepted, with the bits of ``mj_step``, unless the verdict
    finds a pair that becomes too deep or that touches and separates unseen. Otherwise the state is
    rolled back and the pair is made stiff until it separates. The step is then taken in sub-steps:
    one up to the touch, and others in which the solver stops the approach. A sub-step that still
    fails is halved. If that does not help, the partners move rigidly together
    (:func:`~tauguard.contacts.guard.impact_zone.impact_zone`).

    Args:
        model: the scene's. Its ``opt.timestep``, margins and contact parameters are changed within
            a step and restored; those of ``stiff`` pairs are restored when the pair separates.
        data: the MjData to step.
        checkers: names of checkers, whose pairs are covered: ``rigid`` geoms against geoms,
            ``cloth`` flexes against geoms, other flexes and themselves. :attr:`uncovered` lists the
            pairs that may touch and are not covered.
        stiff: whether the contacts of pairs that caused a rollback are made stiff.
        most: calls of ``mj_step`` that one step may cost before partners are stopped.

    Raises:
        ValueError: another name, ``most`` below 2, or a model that :meth:`step` refuses.
    """

    def __init__(
        self,
        model: Any,
        data: Any,
        checkers: Sequence[str] = ("cloth", "rigid"),
        stiff: bool = True,
        most: int = 40,
    ) -> None:
        """Copy the shapes and allocate one saved state."""
        if most < 2:
            raise ValueError(f"most {most}: expected 2 or more steps")
        self._rigid, self._cloth = names(checkers)
        self._model, self._data, self._stiff, self._most = model, data, stiff, most
        warn_of_sparse_newton(model)
        self._start()

    def _start(self) -> None:
        """Make the native guard."""
        model = self._model
        _refuse(model, self._data)
        end = mujoco.MjData(model)
        settings = {**SETTINGS, "stiff": float(self._stiff), "most": float(self._most)}
        other = mujoco.MjData(model) if model.nmocap else end
        held = (model, self._data, end, other)
        found = addresses(*held)
        self._flags = [(found["disableflags"], 4)]
        self._physics = [
            (found[name], np.array(getattr(model.opt, name)).nbytes) for name in PHYSICS
        ]
        self._guard = Guard(found, settings, held)
        self._quiet: dict[int, StepReport] = {}  # by the number of contacts
        self._built = structure(model)
        self._cover()

    def _cover(self) -> None:
        """Give the native guard the model's present pairs and shapes."""
        model = self._model
        self._guard.clear()
        covered = Covered(model, self._guard, self._rigid, self._cloth)
        self._pairs, self._uncovered = tuple(covered.pairs), tuple(covered.uncovered)
        for sheet in sheets_of(model):
            self._guard.sheet(sheet)
        self._guard.spins(_turning(model))
        self._guard.pulled(pulled(model))
        self._elements = [elements(model, flex) for flex in range(model.nflex)]
        self._tunnelling = None
        if covered.sheets:
            first = len(covered.pairs) - len(covered.sheets)
            self._tunnelling = TunnellingEvents(model, covered.sheets, first)
        self._meter: EnergyMeter | None = None
        self._guard.start(self._tunnelling is not None)
        self._guard.follow(followed_fields(model, self._flags), numbers(model, self._physics))

    def _follow(self) -> None:
        """Follow the changes since the last step, or refuse them."""
        refuse_structure(self._model, self._built)
        _refuse(self._model, self._data)
        if self._guard.changed():
            self._cover()

    def __getstate__(self) -> dict[str, Any]:
        """Model, data and the memory of earlier steps."""
        self._follow()
        names = ("_model", "_data", "_rigid", "_cloth", "_stiff", "_most")
        return {name: getattr(self, name) for name in names} | {"saved": self._guard.saved()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore model, data and memory."""
        saved = state.pop("saved")
        self.__dict__.update(state)
        self._start()
        self._guard.restore(saved)

    @property
    def model(self) -> Any:
        """The scene's model. Another model, also a recompiled one, needs a new guard."""
        return self._model

    @property
    def data(self) -> Any:
        """The data that is stepped."""
        return self._data

    @property
    def most(self) -> int:
        """Calls of ``mj_step`` that one step may cost before partners are stopped."""
        return self._most

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """The covered pairs."""
        return self._pairs

    def partners(self, pair: Pair) -> tuple[str, str]:
        """Names of both partners of a pair, as :attr:`pairs` and the reports hold them.

        Returns:
            ``geom 'cup'``, or ``geom 3 (of body 'arm')`` where it has no name; the same of flexes.
        """
        first, second = (partner_name(self.model, partner) for partner in pair)
        return first, second

    @property
    def uncovered(self) -> tuple[Pair, ...]:
        """Pairs that may touch by MuJoCo's rules and are not covered.

        These are height fields and signed distance fields against anything, flexes against flexes
        unless both are of triangles, and pairs that ``checkers`` excludes.
        """
        return self._uncovered

    @property
    def sunk(self) -> tuple[Pair, ...]:
        """Pairs that were deep in one another when one of them last moved.

        The cause is an edit or the scene itself. Such a pair is not followed until it has
        separated, so it may leave on either side unreported.
        """
        return self._named(self._guard.sunk())

    @property
    def stiffened(self) -> tuple[Pair, ...]:
        """Pairs whose contact parameters differ from the scene's at present."""
        return self._named(self._guard.stiffened())

    def step(self, each: Callable[[], None] | None = None) -> StepReport:
        """Advance by one ``model.opt.timestep``.

        Args:
            each: called at the end of every sub-step of a step that was cut, with ``data`` at that
                time; a step that is accepted whole does not call it.

        Raises:
            ValueError: a timestep that is not finite or not above 0; the flags ``ipc``,
                ``speculative`` or ``sleep`` (their state or distances cannot be rolled back); the
                integrator RK4; an unknown friction cone; a contact filter
                (``mjcb_contactfilter``); a mocap pose that is not finite; a shape that is none;
                a mass, contact parameter or other number of the model that is not finite, a
                negative mass; an edited address, count or id by which the model is built. Nothing
                was stepped.
            mujoco.FatalError: an error of MuJoCo's; the state before the step is restored.
            RuntimeError: called within a step of this guard: by another thread, or in a callback.
        """
        contacts = self._guard.step(self, each)
        if contacts < 0:
            return self._report()
        if contacts not in self._quiet:
            self._quiet[contacts] = StepReport(1, contacts)
        return self._quiet[contacts]

    def reset(self) -> None:
        """Start anew at the present state, with mocap bodies at their given poses.

        Contact parameters are restored and the memory of earlier steps is cleared. A change of
        ``data.time`` between two steps does the same for the mocap poses at the next one.
        """
        self._guard.reset()

    def close(self) -> None:
        """Put every contact parameter back."""
        self._guard.close()

    def __enter__(self) -> GuardedStepper:
        """The guard itself; leaving the block calls :meth:`close`."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Put every contact parameter back."""
        self.close()

    def _named(self, numbers: Sequence[int]) -> tuple[Pair, ...]:
        return tuple(sorted(self._pairs[k] for k in numbers))

    def _report(self) -> StepReport:
        steps, contacts, cuts, restored, passed, zones, added, first = self._guard.report()
        return StepReport(
            steps,
            contacts,
            tuple(Cut(time, self._pairs[pair], stiff) for time, pair, stiff in cuts),
            self._named(restored),
            self._named(passed),
            self._named(zones),
            added,
            None if first is None else self._balance(first),
        )

    def _balance(self, first: Array) -> Callable[[], EnergyBalance]:
        last = np.empty_like(first)
        mujoco.mj_getState(self.model, self.data, last, INTEGRATION)

        def balance() -> EnergyBalance:
            if self._meter is None:
                self._meter = EnergyMeter(self.model)
            return self._meter.between(first, last)

        return balance

    def _tunnelling_events(self, x_t1: Array) -> list[tuple[int, list[int], float]]:
        assert self._tunnelling is not None
        return self._tunnelling.find(self.data.flexvert_xpos, x_t1.reshape(-1, 3))

    def _impact_zone(self, rows: list[Any], qpos: int, length: float) -> tuple[list[int], float]:
        """Stop the partners of these rows, starting from the positions at the given address.

        Returns also the work that mocap bodies did through these contacts [J].
        """
        size = ctypes.c_double * self.model.nq
        start = np.array(size.from_address(qpos))

        def judge() -> list[Hit]:
            return [self._hit(row) for row in self._guard.passing()]

        hits = [self._hit(row) for row in rows]
        stopped, work = impact_zone(self.model, self.data, start, length, hits, judge)
        pairs = dict.fromkeys(hit.pair for hit in stopped)
        return [self._pairs.index(pair) for pair in pairs], work

    def _hit(self, row: tuple[int, bool, list[int], list[int]]) -> Hit:
        number, _, features, corners = row
        pair = self._pairs[number]
        if not corners and pair[0][0] == "flex":
            corners = np.unique(self._elements[pair[0][1]][features]).tolist()
        return Hit(pair, np.array(corners, dtype=np.int32))


def _turning(model: Any) -> NDArray[np.int32]:
    """Indices of the rotational degrees of freedom."""
    kinds, out = mujoco.mjtJoint, []
    for joint in range(model.njnt):
        dof, kind = int(model.jnt_dofadr[joint]), model.jnt_type[joint]
        if kind == kinds.mjJNT_FREE:
            out += [dof + 3, dof + 4, dof + 5]
        elif kind == kinds.mjJNT_BALL:
            out += [dof, dof + 1, dof + 2]
        elif kind == kinds.mjJNT_HINGE:
            out.append(dof)
    return np.array(out, dtype=np.int32)


def _refuse(model: Any, data: Any) -> None:
    step = model.opt.timestep
    if not 0 < step < np.inf:
        raise ValueError(f"timestep {step}: expected a finite number above 0")
    for name, bit in REFUSED.items():
        if model.opt.enableflags & bit:
            raise ValueError(
                f"option flag {name}: a guarded step cannot be rolled back with it; disable it"
            )
    if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
        raise ValueError("integrator RK4: expected Euler, implicit, implicitfast or discrete")
    if model.opt.cone not in [int(cone) for cone in mujoco.mjtCone.__members__.values()]:
        raise ValueError(f"cone {model.opt.cone}: MuJoCo crashes with it; expected 0 or 1")
    if mujoco.get_mjcb_contactfilter() is not None:
        raise ValueError(
            "mjcb_contactfilter: a guard cannot know which pairs it rejects; remove it"
        )
    refuse_values(model)
    for name in ("mocap_pos", "mocap_quat"):
        rows = getattr(data, name)
        for row in np.flatnonzero(~np.isfinite(rows).all(axis=1)).tolist():
            raise ValueError(f"{name}: row {row} is {rows[row].tolist()}, not finite")
