"""Guarded scenes whose model is edited between steps, judged by the tunnelling oracle."""

from __future__ import annotations

import copy
import pickle
import warnings
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from os import sched_getaffinity
from typing import Any

import mujoco
import numpy as np

from oracles.tunnelling import Tunnelling, may_touch
from scenes import FAMILIES
from scenes.edits import Edit, edit
from tauguard.contacts import GuardedStepper

#: Most steps of a scene.
MOST = 300
#: Families of which a scene takes seconds: one scene for so many of the others.
RARE = {
    "crowd": 20,
    "distance_field": 10,
    "cup": 4,
    "sheets": 4,
    "cloth": 2,
    "mill": 2,
    "solids": 4,
}
#: How often something is edited: as a fraction of the steps.
RATES = (0.0, 0.02, 0.1, 0.3)
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION


class Run:
    """One scene: guarded, with edits between steps, or plain without edits."""

    def __init__(self, family: str, seed: int, number: int, guarded: bool = True) -> None:
        place = list(FAMILIES).index(family)
        self.rng = np.random.default_rng([seed, place, number])
        self.scene = FAMILIES[family](self.rng)
        rate = 0.02 if family == "crowd" else float(self.rng.choice(RATES))
        self.rate = rate if guarded else 0.0
        self.model, self.data = self.scene.start(self.scene.timestep)
        self.guard = GuardedStepper(self.model, self.data) if guarded else None
        self.counts: Counter[str] = Counter(scenes=1)
        self.silent: list[str] = []
        self.edits: list[str] = []
        self._told: set[tuple[str, str]] = set()
        self._open: list[tuple[str, str]] = []
        self._judge: Tunnelling | None = None
        self.restart()

    def play(self) -> Run:
        """All steps."""
        steps = min(MOST, round(self.scene.seconds / self.scene.timestep) + 1)
        for self.at in range(steps):
            if not self._step():
                break
        self._close()
        return self

    def restart(self) -> None:
        """The oracle follows from here on; what passed before is settled."""
        self._told, self._open = set(), []
        try:
            self._judge = Tunnelling(self.model, self.data)
        except Exception:  # shapes that are none, which the guard has to refuse
            self._judge = None

    def _step(self) -> bool:
        made: Edit | None = None
        poses = self.data.mocap_pos.copy(), self.data.mocap_quat.copy()
        last = self.data.time
        if self.rng.random() < self.rate:
            made = edit(self.rng, self.model, self.data)
            self.counts["edits"] += 1
            self.edits.append(f"{self.at} {made.name}")
            if made.name != "mocap_pos":  # a mocap body sweeps its path
                self.restart()
        elif self.rng.random() < 0.01:
            self._exchange()
        if self.scene.move is not None:
            self.scene.move(self.data, self.data.time + self.scene.timestep)
        if made is not None and made.name == "reset" and self.data.time != last:
            self.restart()  # as the guard does: mocap bodies do not sweep from where they were
        before = self._bits()
        if self.guard is None:
            mujoco.mj_step(self.model, self.data)
            return bool(np.isfinite(self.data.qpos).all()) and self._observe(None)
        time = self.data.time + self.model.opt.timestep
        try:
            report = self.guard.step(self._seen)
        except (ValueError, mujoco.FatalError) as error:
            self.counts["refused"] += 1
            if self._bits() != before:
                self.silent.append(f"{self.at}: {error}: the state is another one")
            if made is None:
                self.silent.append(f"{self.at}: refused without an edit: {error}")
                return False
            made.undo()
            self.data.mocap_pos[:], self.data.mocap_quat[:] = poses
            self.restart()
            return True
        if made is not None:
            self._known_pairs()
        if self._judge is None:
            self.silent.append(f"{self.at}: {self.edits[-1]} is a shape that was not refused")
            return False
        went = self.data.time == time and np.isfinite(self.data.qpos).all()
        self.counts["steps"] += 1
        self.counts["redone"] += report.steps > 1
        self.counts["exhausted"] += report.exhausted
        if not went:
            if self.guard.pairs and not report.exhausted:
                self.silent.append(f"{self.at}: numbers that are not finite")
            return False
        return self._observe(report)

    def _exchange(self) -> None:
        """Go on with a copy, or with a model that was compiled again."""
        if self.guard is None or self.model.nplugin:
            return
        how = int(self.rng.integers(4))
        if how == 0:
            self.guard = copy.deepcopy(self.guard)
        elif how == 3:
            self._share()
        elif how == 1:
            self.guard = pickle.loads(pickle.dumps(self.guard))
        else:
            self.guard.close()
            h, now = self.model.opt.timestep, self.data.time
            model, data = self.scene.spec.recompile(self.model, self.data)
            model.opt.timestep, data.time = h, now
            self.guard = GuardedStepper(model, data)
        self.counts["exchanged"] += 1
        self.model, self.data = self.guard.model, self.guard.data
        self.restart()

    def _share(self) -> None:
        """Another guard steps the same model for a while, from a state of its own."""
        data = mujoco.MjData(self.model)
        data.qpos[:], data.qvel[:] = self.scene.qpos, -2 * self.scene.qvel
        try:
            other = GuardedStepper(self.model, data)
            for _ in range(10):
                other.step()
            other.close()
        except (ValueError, mujoco.FatalError):
            self.counts["refused"] += 1
        self.counts["shared"] += 1

    def _bits(self) -> bytes:
        state = np.empty(mujoco.mj_stateSize(self.model, _STATE))
        mujoco.mj_getState(self.model, self.data, state, _STATE)
        return state.tobytes()

    def _seen(self) -> None:
        if self._judge is not None:
            self._judge.observe(self.data)

    def _known_pairs(self) -> None:
        assert self.guard is not None
        rows = {(("geom", int(a)), ("geom", int(b))) for a, b in may_touch(self.model, False)}
        missing = rows - {*self.guard.pairs} - {*self.guard.uncovered}
        if missing:
            self.silent.append(f"{self.at}: pairs {sorted(missing)[:3]} are not known")

    def _observe(self, report: Any) -> bool:
        """Whether all is well: what passed is reported in this step or in the next."""
        assert self._judge is not None
        self._judge.observe(self.data)
        if self.guard is not None:  # what an edit put into one another is named, and not followed
            self._told |= {self._names(pair) for pair in self.guard.sunk}
        if report is not None and report.passed:
            assert self.guard is not None
            self._told |= {self._names(pair) for pair in report.passed}
        self.counts["undecided"] += self._judge.undecided
        self._judge.undecided = 0
        self._open, late = [], [pair for pair in self._open if pair not in self._told]
        if late:
            self.silent.append(f"{self.at}: {late} passed")
            return False
        found = [tuple(sorted(pair)) for pair in self._judge.pairs]
        if found:
            self.counts["passed"] += 1
            told = self._told
            self.restart()
            self._told, self._open = told, found  # type: ignore[assignment]
        return True

    def _close(self) -> None:
        late = [pair for pair in self._open if pair not in self._told]
        if late:
            self.silent.append(f"last: {late} passed")

    def _names(self, pair: Any) -> tuple[str, str]:
        names = [self.model.geom(n).name if kind == "geom" else "flex" for kind, n in pair]
        first, second = sorted(names)
        return first, second


def play(job: tuple[str, int, int]) -> tuple[Counter[str], list[str]]:
    """One guarded scene, and one in ten plain: counts, and what was silent."""
    family, seed, number = job
    warnings.simplefilter("ignore")
    mujoco.set_mju_user_warning(lambda message: None)
    run = Run(family, seed, number).play()
    if number % 10 == 0:
        plain = Run(family, seed, number, guarded=False).play()
        run.counts.update(plain=1, plain_lost=bool(plain.silent or plain.counts["passed"]))
    return run.counts, [f"{family} {seed} {number} step {text}" for text in run.silent]


def scenes(seed: int, count: int, first: int = 0) -> list[tuple[str, int, int]]:
    """Jobs of all families in turn, from round ``first`` on."""
    jobs: list[tuple[str, int, int]] = []
    number = first
    while len(jobs) < count:
        jobs += [(name, seed, number) for name in FAMILIES if number % RARE.get(name, 1) == 0]
        number += 1
    return jobs[:count]


def played(seed: int, count: int) -> tuple[Counter[str], list[str]]:
    """Every job, by as many processes as there are processors for this one."""
    total: Counter[str] = Counter()
    silent: list[str] = []
    workers, context = len(sched_getaffinity(0)), get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        for counts, texts in pool.map(play, scenes(seed, count), chunksize=4):
            total.update(counts)
            silent += texts
    return total, silent
