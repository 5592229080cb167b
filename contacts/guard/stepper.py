"""Steps that let nothing through: plain where that holds, redone with the approach stopped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import TracebackType
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.contacts.guard.account import Account, Entry
from tauguard.contacts.guard.arrest import arrest
from tauguard.contacts.guard.balance import Balance, Books
from tauguard.contacts.guard.report import Cut, StepReport
from tauguard.contacts.guard.rows import PUSH, Rows
from tauguard.contacts.guard.stiffening import Pair, Stiffening
from tauguard.contacts.guard.verdict import Hit, Verdict, names

Array = NDArray[np.float64]

#: How far beyond the touch a cut piece goes, so that MuJoCo finds the contact [m].
BEYOND = 1e-5
#: Margins are so many times what the pair travelled in the attempt that failed.
ROOM = 1.25
#: A step is never cut into pieces shorter than this share of it.
SMALLEST = 1 / 64
#: Energy is watched for so many steps that stand after one that was redone.
WATCHED = 10
#: Whether pairs have parted is looked up at least every so many steps.
LOOK = 16
#: Shares of its way that a piece with too much energy goes instead, until it has not.
SLOWER = (0.7, 0.5, 0.25, 0.1, 0.0)
#: Pieces down to this share of a step are tried before a pair that is held may become deeper
#: without passing through: of two geoms, and of a flex.
DEEPER = {"geom": 1 / 8, "flex": 1 / 2}


class GuardedStepper:
    """``mj_step`` that lets no pair pass through itself.

    A step is first tried as it is and stands, with the bits of ``mj_step``, unless the verdict
    (:class:`~tauguard.contacts.guard.verdict.Verdict`) finds a pair that becomes too deep or parts
    again unseen. Then the state is restored, the pair made stiff until it parts, and the step
    redone in pieces with the approach stopped by the solver
    (:class:`~tauguard.contacts.guard.rows.Rows`): up to the touch, and from there on. A piece that
    still fails is halved; where that does not help, the partners are stopped against one another
    (:func:`~tauguard.contacts.guard.arrest.arrest`).

    Args:
        model: the scene's. Its ``opt.timestep``, margins and contact parameters are changed within
            a step and put back; ``stiff`` ones when their pair parts.
        data: what is stepped.
        checkers: which pairs are covered, as the checkers of that name: ``rigid`` geoms against
            geoms, ``cloth`` flexes against geoms, one another and themselves. Height fields and
            signed distance fields are not.
        stiff: whether the contacts of pairs that were redone are made stiff.
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
        self._verdict = Verdict(model, data, rigid, cloth)
        self._stiffening = Stiffening(model)
        self._rows = Rows(model, data, self._stiffening)
        self._account = Account(model, data, self._verdict.end)
        self._books: Books | None = None
        self._stiff = stiff
        self._guarded: set[Pair] = set()
        self._quiet: dict[int, StepReport] = {}  # by the number of contacts
        self._watched, self._since, self._contacts = 0, 0, 0
        self._kind = mujoco.mjtState.mjSTATE_INTEGRATION
        self._first = np.empty(mujoco.mj_stateSize(model, self._kind))
        self._saved = np.empty_like(self._first)

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """Those that are covered; of flexes among themselves only what may cross."""
        return tuple(self._verdict.pairs)

    @property
    def stiffened(self) -> tuple[Pair, ...]:
        """Pairs whose contact parameters differ from the scene's at present."""
        return self._stiffening.pairs()

    def step(self) -> StepReport:
        """Advance by one ``model.opt.timestep``."""
        model, data = self.model, self.data
        mujoco.mj_getState(model, data, self._first, self._kind)
        velocity = data.qvel.copy() if self._watched else None
        mujoco.mj_step(model, data)
        hits = self._verdict.judge()
        lost: tuple[Pair, ...] = ()
        if hits:
            lost = tuple(hit.pair for hit in hits if hit.lost)
            hits = self._unseen([hit for hit in hits if not hit.lost])
        if not hits and (velocity is None or self._solvent(velocity)):
            return (
                replace(self._stands(data.ncon), passed=lost) if lost else self._stands(data.ncon)
            )
        self._watched = WATCHED
        whole = float(model.opt.timestep)
        try:
            return _Redo(self, hits, lost, whole).run(fresh=velocity is None)
        finally:
            self.model.opt.timestep = whole

    def _stands(self, contacts: int) -> StepReport:
        """The report of a step that stands as ``mj_step`` made it."""
        self._watched = max(self._watched - 1, 0)
        if self._guarded:
            self._since += 1
            if contacts != self._contacts or self._since >= LOOK:
                self._since, self._contacts = 0, contacts
                if restored := self._release():
                    return StepReport(1, contacts, restored=restored)
        if contacts not in self._quiet:
            self._quiet[contacts] = StepReport(1, contacts)
        return self._quiet[contacts]

    def close(self) -> None:
        """Put every contact parameter back."""
        for pair in self._stiffening.pairs():
            self._stiffening.restore(pair)
        self._guarded.clear()
        self._watched = 0

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

    def _unseen(self, hits: list[Hit]) -> list[Hit]:
        """Without pairs that only brushed and whose contact MuJoCo listed."""
        if not any(hit.brushed for hit in hits):
            return hits
        listed = self._listed()
        return [hit for hit in hits if not (hit.brushed and hit.pair in listed)]

    def _solvent(self, velocity: Array) -> bool:
        """Whether a plain step gives no more energy than contacts may; then it is booked."""
        entry = self._entry(velocity, float(self.model.opt.timestep))
        if self._account.overdrawn(entry):
            return False
        self._account.book(entry)
        return True

    def _entry(self, velocity: Array, length: float) -> Entry:
        return self._account.entry(velocity, length, self._verdict.x_t1)

    def _listed(self) -> set[Pair]:
        """Pairs that MuJoCo lists a contact of."""
        contact = self.data.contact
        rows = {
            *zip(map(tuple, contact.geom.tolist()), map(tuple, contact.flex.tolist()), strict=True)
        }
        return {_pair(geom, flex) for geom, flex in rows}

    def _release(self) -> tuple[Pair, ...]:
        """Let go of the pairs that have parted; those whose parameters are as before again."""
        if not self._guarded:
            return ()
        parted = self._guarded - self._listed()
        self._guarded -= parted
        return tuple(pair for pair in sorted(parted) if self._stiffening.restore(pair))


class _Redo:
    """One step of a guard that did not stand, in pieces."""

    def __init__(
        self, guard: GuardedStepper, hits: list[Hit], lost: tuple[Pair, ...], whole: float
    ) -> None:
        self.g, self.whole = guard, whole
        self.steps, self.contacts = 1, 0
        self.cuts: list[Cut] = []
        self.passed = set(lost)
        self.arrested: set[Pair] = set()
        self.speeds: dict[Pair, float] = {}
        self.added, self.push = 0.0, PUSH / whole
        self.hits = hits
        self.end = 0.0

    def run(self, fresh: bool) -> StepReport:
        """The whole step; ``fresh`` opens the account of energy anew."""
        g, data = self.g, self.g.data
        first = g._first.copy()
        self._restore(first)
        if fresh:
            g._account.open(data.qvel)
        self.end = data.time + self.whole
        if not self.hits:  # only pushed out too fast
            self.speeds = dict.fromkeys(g._guarded, 0.0)
            self.push = 0.0
        rest = self.whole
        length = self._shorter(self.hits, self.whole, self.whole)
        while rest > 0:
            length = min(length, rest)
            length = self._piece(length)
            rest = rest - length if length < rest * (1 - 1e-9) else 0.0
            length = rest
        data.time = self.end
        return StepReport(
            self.steps,
            self.contacts,
            tuple(self.cuts),
            g._release(),
            tuple(sorted(self.passed)),
            tuple(sorted(self.arrested)),
            self.added,
            self._balance(first),
        )

    def _piece(self, length: float) -> float:
        """Go on by ``length`` or less, however many attempts it takes; how far it went."""
        g, data = self.g, self.g.data
        mujoco.mj_getState(g.model, data, g._saved, g._kind)
        velocity, qpos = data.qvel.copy(), data.qpos.copy()
        while True:
            margins = {p: ROOM * v * length + BEYOND for p, v in self.speeds.items()}
            g._rows.step(length, margins, self.push)
            self.steps += 1
            found = g._verdict.judge()
            self.passed |= {hit.pair for hit in found if hit.lost}
            hits = g._unseen([hit for hit in found if not hit.lost])
            entry = g._entry(velocity, length)
            rich = g._account.overdrawn(entry)
            fails = not self._bearable(hits, length)
            if not fails and not rich:
                break
            if length <= SMALLEST * self.whole or self.steps >= g.most:
                entry = self._last_resort(velocity, qpos, length, hits, entry)
                break
            self._restore(g._saved)
            if fails:
                length = self._shorter(hits, length, self.whole)
            elif self.push:
                self.push = 0.0
            else:
                length *= 0.5
        self.contacts = max(self.contacts, int(data.ncon))
        g._account.book(entry)
        self.added += max(entry.gain, 0.0)
        return length

    def _bearable(self, hits: list[Hit], length: float) -> bool:
        """Whether nothing passes through, nor becomes deeper unless a shorter piece was tried."""
        return all(
            not hit.passed
            and hit.pair in self.speeds
            and length <= DEEPER[hit.pair[0][0]] * self.whole * 1.000001
            for hit in hits
        )

    def _last_resort(
        self, velocity: Array, qpos: Array, length: float, hits: list[Hit], entry: Entry
    ) -> Entry:
        """The work ran out: stop what passes through, then slow down what has too much energy."""
        g, data = self.g, self.g.data

        def judge() -> list[Hit]:
            return [hit for hit in g._verdict.judge() if hit.passed]

        through = [hit for hit in hits if hit.passed]
        if through:
            stopped = arrest(g.model, data, qpos, length, through, judge)
            self.arrested |= {hit.pair for hit in stopped}
            entry = g._entry(velocity, length)
        whole = data.qvel.copy()
        for share in SLOWER:
            if not g._account.overdrawn(entry):
                break
            self.arrested |= set(self.speeds)
            data.qpos[:], data.qvel[:] = qpos, share * whole
            mujoco.mj_integratePos(g.model, data.qpos, data.qvel, length)
            if share and judge():
                continue
            entry = g._entry(velocity, length)
        return entry

    def _shorter(self, hits: list[Hit], length: float, whole: float) -> float:
        """How long the next attempt is; its pairs join those that are held."""
        g, share, fresh = self.g, 1.0, False
        for hit in hits:
            held = hit.pair in self.speeds
            fresh |= not held
            self.speeds[hit.pair] = max(self.speeds.get(hit.pair, 0.0), hit.way / length)
            rigid = hit.pair[0][0] == "geom"
            if not held and rigid and hit.time > 0:
                share = min(share, hit.time + BEYOND / max(hit.way, BEYOND))
        if not fresh and hits:
            share = 0.5
        for pair in dict.fromkeys(hit.pair for hit in hits):
            g._guarded.add(pair)
            stiffened = g._stiff and g._stiffening.stiffen(pair)
            self.cuts.append(Cut(g.data.time + share * length, pair, stiffened))
        return max(share * length, min(length, SMALLEST * whole * 0.5))

    def _restore(self, state: Array) -> None:
        mujoco.mj_setState(self.g.model, self.g.data, state, self.g._kind)

    def _balance(self, first: Array) -> Any:
        g = self.g
        last = np.empty_like(first)
        mujoco.mj_getState(g.model, g.data, last, g._kind)

        def balance() -> Balance:
            if g._books is None:
                g._books = Books(g.model)
            return g._books.between(first, last)

        return balance


def _pair(geom: tuple[int, ...], flex: tuple[int, ...]) -> Pair:
    first, second = (
        ("geom", g) if g >= 0 else ("flex", f) for g, f in zip(geom, flex, strict=True)
    )
    return (first, second) if first <= second else (second, first)


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
