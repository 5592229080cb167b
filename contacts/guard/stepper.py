"""Steps that let nothing through: plain steps, or sub-steps in which the solver stops approach."""

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
from tauguard.contacts.guard.engine import INTEGRATION, addresses
from tauguard.contacts.guard.impact_zone import Hit, impact_zone
from tauguard.contacts.guard.mocap import pulled
from tauguard.contacts.guard.report import Cut, Pair, StepReport, partner_name
from tauguard.contacts.guard.tunnelling import TunnellingEvents, elements

#: What the native part goes by.
SETTINGS = {
    "beyond": 1e-5,  # how far beyond the touch a cut sub-step goes, so that MuJoCo finds it [m]
    "room": 1.25,  # margins over what the pair travelled in the attempt that failed
    "smallest": 1 / 64,  # a step is never cut into sub-steps shorter than this fraction of it
    "push": 0.2,  # fraction of a depth that is pushed out in each step
    "watched": 10,  # energy is counted for so many steps that stand after a rollback
    "look": 16,  # whether pairs have parted is looked up at least every so many steps
    "allowed": 0.01,  # energy budget: fraction of the first kinetic energy that contacts may add
    "deeper_geom": 1 / 8,  # sub-steps above this fraction may not deepen a held pair
    "deeper_flex": 1 / 2,  # the same of a flex
    "turned": 1.0,  # rotation in a step above which its whole turns are counted [rad]
}


class GuardedStepper:
    """``mj_step`` that lets no pair pass through itself.

    A plain step is tried first. It is accepted, with the bits of ``mj_step``, unless the verdict
    finds a pair that becomes too deep or that touches and parts unseen. Otherwise the state is
    rolled back, the pair made stiff until it parts, and the step taken in sub-steps: one up to the
    touch, and from there on sub-steps in which the solver stops the approach. A sub-step that still
    fails is halved; where that does not help, the partners move rigidly together
    (:func:`~tauguard.contacts.guard.impact_zone.impact_zone`). All but the last runs in C++.

    Args:
        model: the scene's. Its ``opt.timestep``, margins and contact parameters are changed within
            a step and put back; ``stiff`` ones when their pair parts.
        data: what is stepped.
        checkers: which pairs are covered, as the checkers of that name: ``rigid`` geoms against
            geoms, ``cloth`` flexes against geoms, one another and themselves. :attr:`uncovered`
            lists what may touch and is not.
        stiff: whether the contacts of pairs that caused a rollback are made stiff.
        most: calls of ``mj_step`` that one step may cost before partners are stopped.

    Raises:
        ValueError: another name, a model with ``ipc``, ``speculative`` or ``sleep`` (their state or
            distances cannot be taken back), the integrator RK4, or ``most`` below 2.
    """

    def __init__(
        self,
        model: Any,
        data: Any,
        checkers: Sequence[str] = ("cloth", "rigid"),
        stiff: bool = True,
        most: int = 40,
    ) -> None:
        """Copy the shapes and make room for one saved state."""
        _refuse(model)
        if most < 2:
            raise ValueError(f"most {most}: expected 2 or more steps")
        rigid, cloth = names(checkers)
        self.model, self.data, self.most = model, data, most
        end = mujoco.MjData(model)
        settings = {**SETTINGS, "stiff": float(stiff), "most": float(most)}
        other = mujoco.MjData(model) if model.nmocap else end
        held = (model, data, end, other)
        self._guard = Guard(addresses(*held), settings, held)
        covered = Covered(model, self._guard, rigid, cloth)
        self._pairs, self._uncovered = tuple(covered.pairs), tuple(covered.uncovered)
        for sheet in sheets_of(model):
            self._guard.sheet(*sheet.rows())
        self._guard.spins(_turning(model))
        self._guard.pulled(pulled(model))
        self._elements = [elements(model, flex) for flex in range(model.nflex)]
        self._tunnelling = None
        if covered.sheets:
            first = len(covered.pairs) - len(covered.sheets)
            self._tunnelling = TunnellingEvents(model, covered.sheets, first)
        self._guard.start(self._tunnelling is not None)
        self._meter: EnergyMeter | None = None
        self._quiet: dict[int, StepReport] = {}  # by the number of contacts

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """Those that are covered."""
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
        """Pairs that may touch by MuJoCo's rules and that no promise is made of.

        These are height fields and signed distance fields against anything, flexes against flexes
        unless both are of triangles, and what ``checkers`` leaves out.
        """
        return self._uncovered

    @property
    def stiffened(self) -> tuple[Pair, ...]:
        """Pairs whose contact parameters differ from the scene's at present."""
        return self._named(self._guard.stiffened())

    def step(self, each: Callable[[], None] | None = None) -> StepReport:
        """Advance by one ``model.opt.timestep``.

        Args:
            each: called at the end of every sub-step of a step that was cut, ``data`` being there;
                a step that stands whole does not call it.
        """
        contacts = self._guard.step(self, each)
        if contacts < 0:
            return self._report()
        if contacts not in self._quiet:
            self._quiet[contacts] = StepReport(1, contacts)
        return self._quiet[contacts]

    def reset(self) -> None:
        """Take the present state as new: mocap bodies are where they were put.

        Contact parameters are put back and nothing is known of earlier steps. A change of
        ``data.time`` between two steps does the same for the mocap poses at the next one.
        """
        self._guard.reset()

    def close(self) -> None:
        """Put every contact parameter back."""
        self._guard.close()

    def __enter__(self) -> GuardedStepper:
        """Itself; leaving the block calls :meth:`close`."""
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
        """Stop the partners of these rows from the positions at that address on.

        Also the work that mocap bodies did by it [J].
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
    """Degrees of freedom that turn a body."""
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


def _refuse(model: Any) -> None:
    flags = mujoco.mjtEnableBit
    for name, bit in (
        ("ipc", flags.mjENBL_IPC),
        ("speculative", flags.mjENBL_SPECULATIVE),
        ("sleep", flags.mjENBL_SLEEP),
    ):
        if model.opt.enableflags & bit:
            raise ValueError(f"option flag {name}: a guarded step cannot take it back; disable it")
    if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
        raise ValueError("integrator RK4: expected Euler, implicit, implicitfast or discrete")
