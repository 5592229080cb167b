"""Steps without tunnelling."""

from __future__ import annotations

import copy
import functools
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
from tauguard.contacts.guard.engine import PHYSICS, REFUSED, addresses
from tauguard.contacts.guard.followed_fields import (
    followed_fields,
    numbers,
    refuse_structure,
    refuse_values,
    structure,
)
from tauguard.contacts.guard.mocap import pulled
from tauguard.contacts.guard.report import Cut, Pair, StepReport, partner_name
from tauguard.contacts.guard.tunnelling import TunnellingEvents
from tauguard.findings import ArgumentError
from tauguard.models.mujoco_defects import warn_of_sparse_newton

#: Settings of the native part; "held" pairs are those whose approach the solver stops.
SETTINGS = {
    "beyond": 1e-5,  # a cut sub-step ends this deep, so that MuJoCo lists the contact [m]
    "room": 1.25,  # margin of a held pair divided by its approach in the failed attempt
    "smallest": 1 / 64,  # sub-steps of at most this fraction of the step are not cut further
    "watched": 10,  # number of accepted steps after a rollback in which energy is counted
    "look": 16,  # largest number of steps between two tests whether pairs have separated
    "allowed": 0.01,  # energy that contacts may add, as a fraction of the initial kinetic energy
    "deeper_geom": 1 / 8,  # longest sub-step in which a held pair may get deeper [step]
    "deeper_flex": 1 / 2,  # the same for pairs with a flex
    "turned": 1.0,  # rotation in a step above which full turns are counted [rad]
}


class GuardedStepper:
    """``mj_step`` without tunnelling: covered partners do not pass through each other.

    A step has these stages:

    1. A plain step is accepted, with the bits of ``mj_step``, unless a pair becomes too deep or
       touches and separates without a contact in MuJoCo's list.
    2. Otherwise the state is rolled back. The step is taken in sub-steps: one up to the touch, and
       others in which the solver stops the approach; these impacts are inelastic, with the
       friction of Coulomb's law. A sub-step that still fails is halved.
    3. If this does not help, the partners move rigidly together in the sub-step: the velocity
       changes by as little as possible, in the metric of the inertia (rigid impact zones: Provot
       1997; Bridson, Fedkiw and Anderson 2002). If even then some pass through, all stand still.

    Between two steps everything in ``model`` and ``data`` may be changed; :meth:`step` uses the
    change or refuses it. The path on which an edit moves a geom is not checked. After an error of
    MuJoCo or an exception in ``each``, the state before the step is restored. Copies, deep copies
    and unpickled guards continue with the same bits; a shallow copy shares model and data.

    The model is only read, so many guards, each with its own MjData, may share one in any number of
    threads. Sub-steps use a copy of it. Callbacks in Python (``mjcb_control`` and others) get this
    copy as ``model`` in sub-steps; what they write to it is lost.

    Args:
        model: MjModel.
        data: The MjData to step.
        checkers: The covered pairs: ``rigid`` for geoms with geoms, ``cloth`` for flexes with
            geoms, other flexes and themselves. :attr:`uncovered` lists the other pairs.
        most: Largest number of calls of ``mj_step`` in one step; at this number stage 3 follows.

    Raises:
        ArgumentError: an unknown checker, ``most`` below 2, or a model that :meth:`step` refuses.
    """

    def __init__(
        self,
        model: Any,
        data: Any,
        checkers: Sequence[str] = ("cloth", "rigid"),
        most: int = 40,
    ) -> None:
        """Check the model, and make the native guard."""
        if most < 2:
            raise ArgumentError(f"most {most}: expected 2 or more calls of mj_step")
        self._rigid, self._cloth = names(checkers)
        self._model, self._data, self._most = model, data, most
        warn_of_sparse_newton(model)
        self._start()

    def _start(self) -> None:
        model = self._model
        _refuse(model, self._data)
        end = mujoco.MjData(model)
        settings = {**SETTINGS, "most": self._most}
        other = mujoco.MjData(model) if model.nmocap else end
        held = (model, self._data, end, other)
        found = addresses(*held)
        self._flags = [(found["disableflags"], 4)]
        self._physics = [
            (found[name], np.array(getattr(model.opt, name)).nbytes) for name in PHYSICS
        ]
        self._guard = Guard(found, settings, held)
        self._plain_reports: dict[int, StepReport] = {}  # of steps without rollback, by contacts
        self._built = structure(model)
        self._cover()

    def _cover(self) -> None:
        """Pass the present pairs and shapes of the model to the native guard."""
        model = self._model
        self._guard.clear()
        covered = Covered(model, self._guard, self._rigid, self._cloth)
        self._pairs, self._uncovered = tuple(covered.pairs), tuple(covered.uncovered)
        for sheet in sheets_of(model):
            self._guard.sheet(sheet)
        self._guard.spins(_turning(model))
        self._guard.pulled(pulled(model))
        self._tunnelling = None
        if covered.sheets:
            first = len(covered.pairs) - len(covered.sheets)
            self._tunnelling = TunnellingEvents(model, covered.sheets, first)
        self._meter: EnergyMeter | None = None
        self._guard.start(self._tunnelling is not None)
        self._guard.follow(followed_fields(model, self._flags), numbers(model, self._physics))

    def _follow(self) -> None:
        """Apply changes of the model since the last step, or refuse them (``ArgumentError``)."""
        refuse_structure(self._model, self._built)
        _refuse(self._model, self._data)
        if self._guard.changed():
            self._cover()

    def __getstate__(self) -> dict[str, Any]:
        """Model, data and the memory of earlier steps."""
        self._follow()
        names = ("_model", "_data", "_rigid", "_cloth", "_most")
        return {name: getattr(self, name) for name in names} | {"saved": self._guard.saved()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore model, data and memory."""
        saved = state.pop("saved")
        self.__dict__.update(state)
        self._start()
        self._guard.restore(saved)

    @property
    def model(self) -> Any:
        """The model. Another model, also a recompiled one, needs a new guard."""
        return self._model

    @property
    def data(self) -> Any:
        """The data that is stepped."""
        return self._data

    @property
    def most(self) -> int:
        """Largest number of calls of ``mj_step`` in one step."""
        return self._most

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """The covered pairs."""
        return self._pairs

    def partners(self, pair: Pair) -> tuple[str, str]:
        """Names of the partners of a pair of :attr:`pairs` or of a report.

        Returns:
            Names such as ``geom 'cup'``, ``geom 3 (of body 'arm')`` without a name, or ``flex 2``.
        """
        first, second = (partner_name(self.model, partner) for partner in pair)
        return first, second

    @property
    def uncovered(self) -> tuple[Pair, ...]:
        """Pairs that MuJoCo tests and the guard does not cover.

        These are all pairs with height fields or signed distance fields, pairs of flexes unless
        both are two-dimensional, and pairs that ``checkers`` excludes.
        """
        return self._uncovered

    @property
    def sunk(self) -> tuple[Pair, ...]:
        """Pairs whose partners were already deep in each other at the start of a step.

        The cause is an edit or the scene itself. Such a pair is not guarded until it has separated,
        so it may separate on either side without a report.
        """
        return self._named(self._guard.sunk())

    def step(self, each: Callable[[], None] | None = None) -> StepReport:
        """Advance by one ``model.opt.timestep``.

        Args:
            each: Called at the end of every sub-step, with ``data`` at this time. A plain step that
                is accepted does not call it.

        Raises:
            ArgumentError: a timestep that is not finite or not above 0; the flags ``ipc``,
                ``speculative`` or ``sleep``, with which a step cannot be rolled back; the
                integrator RK4; an unknown friction cone; a contact filter (``mjcb_contactfilter``);
                a mocap pose, mass, contact parameter or other number of the model that is not
                finite; a negative mass or size; an unknown geom type; an edited address, count or
                id of the model's structure. The state is unchanged.
            mujoco.FatalError: an error of MuJoCo; the state before the step is restored.
            RuntimeError: called during a step of this guard, by another thread or in a callback.
        """
        contacts = self._guard.step(self, each)
        if contacts < 0:
            return self._report()
        if contacts not in self._plain_reports:
            self._plain_reports[contacts] = StepReport(1, contacts)
        return self._plain_reports[contacts]

    def reset(self) -> None:
        """Start again at the present state, with mocap bodies at their present poses.

        The memory of earlier steps is cleared. If ``data.time`` is changed between two steps, mocap
        bodies also start at their present poses.
        """
        self._guard.reset()

    def close(self) -> None:
        """Clear the memory of earlier steps. The model was only read, so it needs no repair."""
        self._guard.reset()

    def __enter__(self) -> GuardedStepper:
        """The guard itself; leaving the block calls :meth:`close`."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Call :meth:`close`."""
        self.close()

    def _named(self, numbers: Sequence[int]) -> tuple[Pair, ...]:
        return tuple(sorted([self._pairs[k] for k in numbers])) if numbers else ()

    def _report(self) -> StepReport:
        steps, contacts, cuts, passed, zones, unaided, still, added, states = self._guard.report()
        return StepReport(
            steps,
            contacts,
            tuple([Cut(time, self._pairs[pair]) for time, pair in cuts]),
            self._named(passed),
            self._named(zones),
            unaided,
            still,
            added,
            None if states is None else functools.partial(self._balance, states),
        )

    def _balance(self, states: bytes) -> EnergyBalance:
        if self._meter is None:
            self._meter = EnergyMeter(self.model)
        first, last = np.frombuffer(states).reshape(2, -1)
        return self._meter.between(first, last)

    def _bound_copy(self) -> int:
        """The address of a copy of the model that callbacks in Python may get."""
        self._copy = copy.copy(self._model)
        return int(self._copy._address)

    def _tunnelling_events(self, x_t1: Array) -> list[tuple[int, list[int], float]]:
        assert self._tunnelling is not None
        return self._tunnelling.find(self.data.flexvert_xpos, x_t1.reshape(-1, 3))


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
        raise ArgumentError(f"timestep {step}: expected a finite number above 0")
    for name, bit in REFUSED.items():
        if model.opt.enableflags & bit:
            raise ArgumentError(
                f"option flag {name}: a guarded step cannot be rolled back with it; disable it"
            )
    if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
        raise ArgumentError("integrator RK4: expected Euler, implicit, implicitfast or discrete")
    if model.opt.cone not in [int(cone) for cone in mujoco.mjtCone.__members__.values()]:
        raise ArgumentError(f"cone {model.opt.cone}: MuJoCo crashes with it; expected 0 or 1")
    if mujoco.get_mjcb_contactfilter() is not None:
        raise ArgumentError(
            "mjcb_contactfilter: a guard cannot know which pairs the filter rejects; unset it"
        )
    refuse_values(model)
    for name in ("mocap_pos", "mocap_quat"):
        rows = getattr(data, name)
        for row in np.flatnonzero(~np.isfinite(rows).all(axis=1)).tolist():
            raise ArgumentError(f"{name}: row {row} is {rows[row].tolist()}, not finite")
