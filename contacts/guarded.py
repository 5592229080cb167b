"""Steps that cannot tunnel: a step is cut where a checker finds a contact that it would pass by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import TracebackType
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.contacts.approach import Approach
from tauguard.contacts.balance import Balance, Books
from tauguard.contacts.checker import Checker, Contacts, State, asked, checker
from tauguard.contacts.stiffening import Pair, Stiffening

Array = NDArray[np.float64]

#: How far beyond the touch a cut step goes, so that MuJoCo finds the contact [m]. Less than the
#: error of a shortened step would leave a gap; more is depth that the contact then pushes out.
BEYOND = 1e-5
#: Share of the depth at which a normal turns over (:meth:`Approach.bound`) that a step may
#: end with; a new contact that would be deeper is cut at its first touch.
DEEP = 0.8
#: A contact that was there before and becomes deeper than that is cut in halves, but only where
#: this step alone adds that share.
GROWTH = 0.1
#: From this share on, a step that adds even as little as the second one is cut, so that a soft
#: contact cannot creep through in many small steps.
LAST, CREEP = 0.9, 1e-3
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
    contacts: int  #: that MuJoCo listed, the most in any piece of the step that stood
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
        most: calls of ``mj_step`` that one step may cost, beside those that ``fine`` asks for.
        fine: pieces into which a step is split while a pair that had to be cut still touches. The
            guard holds a contact at any step; what the contact then does is as coarse as the step.

    Raises:
        ValueError: an unknown checker, a model with ``ipc``, ``speculative`` or ``sleep`` (their
            state or distances cannot be taken back), the integrator RK4, ``most`` below 2 or
            ``fine`` below 1.
    """

    def __init__(
        self,
        model: Any,
        data: Any,
        checkers: Sequence[str | Checker] = ("cloth", "rigid"),
        stiff: bool = True,
        most: int = 24,
        fine: int = 1,
    ) -> None:
        """Make the checkers and room for one saved state."""
        _refuse(model)
        if most < 2:
            raise ValueError(f"most {most}: expected 2 or more steps")
        if fine < 1:
            raise ValueError(f"fine {fine}: expected 1 or more pieces")
        self.model, self.data, self.most, self.fine = model, data, most + fine, fine
        self.checkers = [checker(c, model) if isinstance(c, str) else c for c in checkers]
        self._scratch = mujoco.MjData(model)
        self._approach = Approach(model)
        self._books = Books(model)
        self._stiffening = Stiffening(model)
        self._stiff = stiff
        self._guarded: set[Pair] = set()
        self._last: State | None = None
        self._kind = mujoco.mjtState.mjSTATE_INTEGRATION
        self._saved = np.empty(mujoco.mj_stateSize(model, self._kind))

    @property
    def stiffened(self) -> tuple[Pair, ...]:
        """Pairs whose contact parameters differ from the scene's at present."""
        return self._stiffening.pairs()

    def step(self) -> StepReport:
        """Advance by one ``model.opt.timestep``.

        Raises:
            ValueError: a checker reports a contact whose point, time or distance is not finite. Its
                normal may be unknown (NaN): then the direction of approach stands for it.
        """
        whole, end = float(self.model.opt.timestep), self.data.time + self.model.opt.timestep
        rest, length = whole, self._piece(whole, whole)
        steps, contacts, exhausted, cuts, first = 0, 0, False, list[Cut](), None
        before = self._now()
        try:
            while rest > 0:
                self._save()
                self.model.opt.timestep = length
                mujoco.mj_step(self.model, self.data)
                steps += 1
                after = State.of(self.model, self.data, self._scratch)
                cut = self._cut(before, after)
                if cut is not None and steps < self.most and length > SMALLEST * whole:
                    first = self._saved.copy() if first is None else first
                    self._restore()
                    share, pair, depth = cut
                    length = max(share * length, SMALLEST**2 * whole)
                    self._guarded.add(pair)
                    stiffened = self._stiff and self._stiffening.stiffen(pair)
                    cuts.append(Cut(self.data.time + length, pair, depth, stiffened))
                    continue
                exhausted |= cut is not None
                contacts = max(contacts, self.data.ncon)
                rest = rest - length if length < rest else 0.0
                length, before = self._piece(rest, whole), after
        finally:
            self.model.opt.timestep = whole
        if steps > 1:
            self.data.time = end
            before = replace(before, time=end)
        self._last = before
        balance = None if first is None else self._balance(first)
        return StepReport(steps, contacts, tuple(cuts), self._release(), exhausted, balance)

    def _piece(self, rest: float, whole: float) -> float:
        """How far to go next: all the rest, or a piece of the step while guarded pairs touch."""
        piece = whole / self.fine
        return piece if self._guarded and rest > 1.000001 * piece else rest

    def close(self) -> None:
        """Put every contact parameter back."""
        for pair in self._stiffening.pairs():
            self._stiffening.restore(pair)
        self._guarded.clear()

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

    def _now(self) -> State:
        """The state of the data: the last step's end, unless somebody has changed it since."""
        last, data = self._last, self.data
        if (
            last is not None
            and not self.model.nmocap
            and last.time == data.time
            and last.qpos.tobytes() == data.qpos.tobytes()
            and last.qvel.tobytes() == data.qvel.tobytes()
        ):
            return last
        return State.of(self.model, data, self._scratch)

    def _save(self) -> None:
        mujoco.mj_getState(self.model, self.data, self._saved, self._kind)

    def _restore(self) -> None:
        mujoco.mj_setState(self.model, self.data, self._saved, self._kind)

    def _cut(self, before: State, after: State) -> tuple[float, Pair, float] | None:
        """Where the step should be cut (share of it), for which pair, how deep it would be."""
        held = _touching(self.data)
        new = [
            one
            for checker in self.checkers
            for one in self._new(_placed(checker, before, after), held, before, after)
        ]
        return min(new) if new else self._sinking(held, before, after)

    def _new(
        self, found: Contacts, held: Contacts, before: State, after: State
    ) -> list[tuple[float, Pair, float]]:
        """Contacts within the step that it would pass by."""
        if not len(found):
            return []
        way, core = self._approach.bound(found, before, after)
        known = self._keys(held)
        fresh = np.array([key not in known for key in self._rows(found)])
        matter = fresh | ((way > DEEP * core) & (found.time > 0))
        if not matter.any():
            return []
        found, fresh, core = found.where(matter), fresh[matter], core[matter]
        found, unknown = self._approach.oriented(found, before, after)
        depth = self._approach.depth(found, before, after)
        passed = depth > DEEP * core
        parting = fresh & ((depth <= 0) | unknown)
        if parting.any():
            ends = self._keys(self._ends(after))
            passed |= parting & np.array([key not in ends for key in self._rows(found)])
        if not passed.any():
            return []
        speed = np.maximum(self._approach.speed(found, before, after), 1e-12)
        share = found.time + BEYOND / speed
        # What touches at the very end is there when the next step starts.
        chosen = np.flatnonzero(passed & (share < 1))
        pairs = pairs_of(found.where(chosen))
        return [(float(share[k]), p, float(depth[k])) for k, p in zip(chosen, pairs, strict=True)]

    def _sinking(
        self, held: Contacts, before: State, after: State
    ) -> tuple[float, Pair, float] | None:
        """A contact that was there before and becomes too deep: halve the step."""
        if not len(held):
            return None
        way, core = self._approach.bound(held, before, after)
        near = way - held.distance > DEEP * core
        if not near.any():
            return None
        held, core = held.where(near), core[near]
        depth = self._approach.depth(held, before, after)
        growth = depth + held.distance
        sinks = (depth > DEEP * core) & (growth > GROWTH * core)
        sinks |= (depth > LAST * core) & (growth > CREEP * core)
        if not sinks.any():
            return None
        k = int(np.argmax(np.where(sinks, depth, -np.inf)))
        return 0.5, pairs_of(held)[k], float(depth[k])

    def _rows(self, contacts: Contacts) -> list[int]:
        """A number for the two partners of each row."""
        ids = np.where(contacts.geom >= 0, contacts.geom, self.model.ngeom + contacts.flex)
        count = self.model.ngeom + self.model.nflex
        rows: list[int] = (ids.max(axis=1).astype(np.int64) * count + ids.min(axis=1)).tolist()
        return rows

    def _keys(self, contacts: Contacts) -> set[int]:
        return set(self._rows(contacts)) if len(contacts) else set()

    def _ends(self, after: State) -> Contacts:
        """MuJoCo's contacts at the end of the step."""
        scratch = self._scratch  # its kinematics are those of ``after``
        mujoco.mj_comPos(self.model, scratch)
        mujoco.mj_flex(self.model, scratch)
        mujoco.mj_collision(self.model, scratch)
        return _touching(scratch)

    def _release(self) -> tuple[Pair, ...]:
        """Let go of the pairs that have parted; those whose parameters are as before again."""
        if not self._guarded:
            return ()
        parted = self._guarded - set(pairs_of(_touching(self.data)))
        self._guarded -= parted
        return tuple(pair for pair in sorted(parted) if self._stiffening.restore(pair))

    def _balance(self, first: Array) -> Balance:
        last = np.empty_like(first)
        mujoco.mj_getState(self.model, self.data, last, self._kind)
        return self._books.between(first, last)


def _placed(one: Checker, before: State, after: State) -> Contacts:
    """What a checker says of the step, each contact with its point, time and distance."""
    found = asked(one, before, after)
    if not len(found):
        return found
    known = np.isfinite(found.point).all(axis=1)
    known &= np.isfinite(found.time) & np.isfinite(found.distance)
    if not known.all():
        row = int(np.argmin(known))
        raise ValueError(
            f"checker {one.name!r}: the contact of {pairs_of(found)[row]} has the point "
            f"{found.point[row].tolist()} at {found.time[row]:g} of the step, distance "
            f"{found.distance[row]:g} m; a guarded step needs finite ones (its normal may be NaN)"
        )
    return found


def _touching(data: Any) -> Contacts:
    """The contacts in ``data``, at time 0 of the step that follows them."""
    if not data.ncon:
        return Contacts.empty()
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


def pairs_of(contacts: Contacts) -> list[Pair]:
    """The partners of each row, sorted."""
    rows = zip(contacts.geom.tolist(), contacts.flex.tolist(), strict=True)
    return [_pair(geom, flex) for geom, flex in rows]


def _pair(geom: list[int], flex: list[int]) -> Pair:
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
