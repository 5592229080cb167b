"""Steps that cannot tunnel: a step is cut where a checker finds a contact that it would pass by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.contacts.approach import Approach
from tauguard.contacts.balance import Balance, Books
from tauguard.contacts.checker import Checker, Contacts, State, checker
from tauguard.contacts.stiffening import Pair, Stiffening

Array = NDArray[np.float64]

#: How far beyond the touch a cut step goes, so that MuJoCo finds the contact [m]. Less than the
#: error of a shortened step would leave a gap; more is depth that the contact then pushes out.
BEYOND = 1e-5
#: Share of the depth at which a contact's normal turns over (:meth:`Approach.core`) that a step may
#: end with; a new contact that would be deeper is cut at its first touch.
DEEP = 0.8
#: A contact that was there before and becomes deeper than that is cut in halves, but only where
#: this step alone adds that share.
GROWTH = 0.1
#: A step is never cut into pieces shorter than this share of it.
SMALLEST = 1 / 64


@dataclass(frozen=True)
class Cut:
    """One place where a step was cut."""

    time: float  #: at which the shortened step ended [s]
    pair: Pair  #: whose contact the whole step would have passed by
    depth: float  #: that the pair would have had without resistance; 0 or less: had parted [m]
    stiffened: bool  #: its contact parameters were changed, until the pair parts


@dataclass(frozen=True)
class StepReport:
    """What one guarded step did."""

    steps: int  #: calls of ``mj_step``, those that were taken back included
    cuts: tuple[Cut, ...] = ()
    restored: tuple[Pair, ...] = ()  #: pairs whose contact parameters are as before again
    exhausted: bool = False  #: the work ran out with a cut still due: a miss is possible
    balance: Balance | None = None  #: energy and momentum, where the step was cut


class GuardedStepper:
    """``mj_step`` that passes no contact by.

    Each step is tried whole. It stands unless a checker finds a contact within it that MuJoCo would
    miss (the pair has parted again at the end of the step) or find upside down (the pair would be
    deeper than its own thickness). Then the state is restored, and the scene stepped to the touch
    and a little beyond, where MuJoCo sees the contact; the rest follows under the same rule. A step
    that is not cut gives the same bits as ``mj_step``.

    A soft contact does not stop a fast body within its own radius, whatever the step. A pair that
    had to be cut is therefore made stiff (``stiff``) until it parts; the report says so.

    Args:
        model: the scene's. Its ``opt.timestep`` is changed within a step and put back.
        data: what is stepped.
        checkers: names of registered checkers, or checkers.
        stiff: whether the contacts of pairs that were cut are made stiff.
        most: calls of ``mj_step`` that one step may cost.

    Raises:
        ValueError: an unknown checker, a model with ``ipc``, ``speculative`` or ``sleep`` (their
            state or distances cannot be taken back), the integrator RK4, ``most`` below 2.
    """

    def __init__(
        self,
        model: Any,
        data: Any,
        checkers: Sequence[str | Checker] = ("cloth", "rigid"),
        stiff: bool = True,
        most: int = 24,
    ) -> None:
        """Make the checkers and room for one saved state."""
        _refuse(model)
        if most < 2:
            raise ValueError(f"most {most}: expected 2 or more steps")
        self.model, self.data, self.most = model, data, most
        self.checkers = [checker(c, model) if isinstance(c, str) else c for c in checkers]
        self._scratch = mujoco.MjData(model)
        self._approach = Approach(model)
        self._books = Books(model)
        self._stiffening = Stiffening(model)
        self._stiff = stiff
        self._kind = mujoco.mjtState.mjSTATE_INTEGRATION
        self._saved = np.empty(mujoco.mj_stateSize(model, self._kind))

    @property
    def stiffened(self) -> tuple[Pair, ...]:
        """Pairs whose contact parameters differ from the scene's at present."""
        return self._stiffening.pairs()

    def step(self) -> StepReport:
        """Advance by one ``model.opt.timestep``."""
        whole, end = float(self.model.opt.timestep), self.data.time + self.model.opt.timestep
        rest = length = whole
        steps, exhausted, cuts, first = 0, False, list[Cut](), None
        before = State.of(self.model, self.data, self._scratch)
        try:
            while rest > 0:
                self._save()
                self.model.opt.timestep = length
                mujoco.mj_step(self.model, self.data)
                steps += 1
                after = State.of(self.model, self.data, self._scratch)
                cut = self._cut(before, after)
                if cut is not None and steps < self.most and length > SMALLEST * whole:
                    if first is None:
                        first = self._saved.copy()
                    self._restore()
                    share, pair, depth = cut
                    length = max(share * length, SMALLEST**2 * whole)
                    stiffened = self._stiff and self._stiffening.stiffen(pair)
                    cuts.append(Cut(self.data.time + length, pair, depth, stiffened))
                    continue
                exhausted |= cut is not None
                rest -= length
                length, before = rest, after
        finally:
            self.model.opt.timestep = whole
        if cuts:
            self.data.time = end
        return StepReport(
            steps, tuple(cuts), self._soften(), exhausted, self._balance(first) if cuts else None
        )

    def close(self) -> None:
        """Put every contact parameter back."""
        for pair in self._stiffening.pairs():
            self._stiffening.restore(pair)

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

    def _save(self) -> None:
        mujoco.mj_getState(self.model, self.data, self._saved, self._kind)

    def _restore(self) -> None:
        mujoco.mj_setState(self.model, self.data, self._saved, self._kind)

    def _cut(self, before: State, after: State) -> tuple[float, Pair, float] | None:
        """Where the step should be cut (share of it), for which pair, how deep it would be."""
        held = _touching(self.data)
        found = Contacts.concatenate([c.check(before, after) for c in self.checkers])
        found = found.where(np.asarray(np.isfinite(found.normal).all(axis=1)))
        best = None
        for share, pair, depth in self._new(found, held, before, after):
            if best is None or share < best[0]:
                best = (share, pair, depth)
        if best is None:
            best = self._sinking(held, before, after)
        return best

    def _new(
        self, found: Contacts, held: Contacts, before: State, after: State
    ) -> list[tuple[float, Pair, float]]:
        """Contacts within the step that it would pass by."""
        if not len(found):
            return []
        known = {pair_of(held, k) for k in range(len(held))}
        fresh = np.array([pair_of(found, k) not in known for k in range(len(found))])
        fast = self._approach.bound(found, before, after) > DEEP * self._approach.core(found)
        matter = np.asarray(fresh | (fast & (found.time > 0)))
        found, fresh = found.where(matter), fresh[matter]
        depth = self._approach.depth(found, before, after)
        deep = depth > DEEP * self._approach.core(found)
        parting = fresh & (depth <= 0)
        if parting.any():
            ends = {pair_of(c, k) for c in [self._ends(after)] for k in range(len(c))}
            parting &= np.array([pair_of(found, k) not in ends for k in range(len(found))])
        length = float(self.model.opt.timestep)
        rows = []
        for k in np.flatnonzero(deep | parting):
            speed = max(self._approach.speed(found, int(k), before, after) / length, 1e-9)
            share = float(found.time[k]) + BEYOND / speed / length
            if share < 1:  # what touches at the very end is there when the next step starts
                rows.append((share, pair_of(found, int(k)), float(depth[k])))
        return rows

    def _sinking(
        self, held: Contacts, before: State, after: State
    ) -> tuple[float, Pair, float] | None:
        """A contact that was there before and becomes too deep: halve the step."""
        core = self._approach.core(held)
        near = self._approach.bound(held, before, after) - held.distance > DEEP * core
        held = held.where(np.asarray(near))
        core = self._approach.core(held)
        depth = self._approach.depth(held, before, after)
        sinks = (depth > DEEP * core) & (depth + held.distance > GROWTH * core)
        if not sinks.any():
            return None
        k = int(np.argmax(np.where(sinks, depth, -np.inf)))
        return 0.5, pair_of(held, k), float(depth[k])

    def _ends(self, after: State) -> Contacts:
        """MuJoCo's contacts at the end of the step."""
        scratch = self._scratch  # its kinematics are those of ``after``
        mujoco.mj_comPos(self.model, scratch)
        mujoco.mj_flex(self.model, scratch)
        mujoco.mj_collision(self.model, scratch)
        return _touching(scratch)

    def _soften(self) -> tuple[Pair, ...]:
        """Put back the parameters of pairs that have parted."""
        stiff = self._stiffening.pairs()
        if not stiff:
            return ()
        touching = _touching(self.data)
        pairs = {pair_of(touching, k) for k in range(len(touching))}
        return tuple(p for p in stiff if p not in pairs and self._stiffening.restore(p))

    def _balance(self, first: Array | None) -> Balance:
        assert first is not None
        last = np.empty_like(first)
        mujoco.mj_getState(self.model, self.data, last, self._kind)
        return self._books.between(first, last)


def _touching(data: Any) -> Contacts:
    """The contacts in ``data``, at time 0 of the step that follows them."""
    contact = data.contact
    return Contacts(
        time=np.zeros(len(contact.dist)),
        geom=contact.geom,
        flex=contact.flex,
        feature=contact.elem,
        point=contact.pos,
        normal=contact.frame[:, :3],
        distance=contact.dist,
    )


def pair_of(contacts: Contacts, k: int) -> Pair:
    """The partners of row ``k``, sorted."""
    first, second = sorted(
        ("geom", int(g)) if g >= 0 else ("flex", int(f))
        for g, f in zip(contacts.geom[k], contacts.flex[k], strict=True)
    )
    return first, second


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
