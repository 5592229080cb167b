"""One scene by every method, and what became of it; kept in a file, so that a run can go on."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

import mujoco
import numpy as np

from oracles.energy import EnergyGain
from oracles.tunnelling import Tunnelling
from studies.contacts.draws import Thrown, scenes
from tauguard.contacts import GuardedStepper
from tauguard.contacts.scenes.impacts import MODES

#: Every so many scenes are also played with fixed steps, which take most of the time.
FINE_EVERY = 4
#: With steps below that the referee looks only this often [s].
LOOK = 5e-4


@dataclass(frozen=True)
class Played:
    """One scene by one method."""

    held: bool
    exhausted: bool
    arrested: bool
    touched: bool  #: the guard redid a step
    energy: float
    seconds: float  #: of the processor, for stepping alone
    calls: float  #: of ``mj_step`` for each step
    velocity: list[float]  #: of the first body at the end [m/s]
    added: float = 0.0  #: the most energy by which redone steps changed it in sum; 0 with drives


@dataclass(frozen=True)
class Line:
    """One scene by every method."""

    timestep: float  #: of all but the fixed steps [s]
    speed: float  #: of the thrown body at the start [m/s]
    runs: dict[str, Played]  #: by method
    fine: dict[float, Played]  #: by fixed step; empty where none was tried

    @property
    def first(self) -> float | None:
        """The largest of the fixed steps that holds with all finer ones that were tried [s]."""
        return max((step for step, run in self.fine.items() if run.held), default=None)


def lines(
    family: str,
    seed: int,
    count: int,
    methods: Sequence[str],
    fixed: Sequence[float],
    keep: Path | None,
) -> Iterator[Line]:
    """Play the first ``count`` scenes of a family; those that ``keep`` holds are read."""
    path = None
    if keep is not None:
        keep.mkdir(parents=True, exist_ok=True)
        path = keep / f"guard-{family}-{seed}-{len(methods)}-{len(fixed)}.jsonl"
    done = _whole_lines(path) if path is not None and path.exists() else []
    for text in done[:count]:
        yield _read(text)
    for k, scene in enumerate(scenes(family, seed, max(0, count - len(done)), len(done))):
        runs = {method: played(scene, method, scene.timestep) for method in methods}
        fine = {} if (len(done) + k) % FINE_EVERY else fine_runs(scene, fixed)
        line = Line(scene.timestep, scene.speed, runs, fine)
        if path is not None:
            with path.open("a") as file:
                file.write(json.dumps(asdict(line)) + "\n")
        yield line


def _whole_lines(path: Path) -> list[str]:
    """The file's lines; a last one that was cut off while it was written is taken away."""
    text = path.read_text()
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        path.write_text(whole)
    return whole.splitlines()


def _read(text: str) -> Line:
    """A line of the file."""
    values = json.loads(text)
    return Line(
        values["timestep"],
        values["speed"],
        {method: Played(**run) for method, run in values["runs"].items()},
        {float(step): Played(**run) for step, run in values["fine"].items()},
    )


def fine_runs(scene: Thrown, fixed: Sequence[float]) -> dict[float, Played]:
    """Stiff fixed steps, from fine to coarse, up to the first that does not hold.

    The finest of all is tried only where the next one does not hold.
    """
    out: dict[float, Played] = {}
    finest, *coarser = sorted(fixed)
    for step in coarser:
        out[step] = played(scene, "plain", step, stiff=True)
        if not out[step].held:
            break
    if not coarser or not out[coarser[0]].held:
        out[finest] = played(scene, "plain", finest, stiff=True)
    return out


@contextmanager
def unwarned() -> Iterator[None]:
    """MuJoCo prints and logs nothing: that plain steps diverge is what is studied here."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda message: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


@unwarned()
def played(scene: Thrown, method: str, timestep: float, stiff: bool = False) -> Played:
    """Play ``scene`` to its end: ``method`` is ``guarded`` or one of MuJoCo's modes."""
    model, data = scene.start(timestep, MODES.get(method, 0), stiff)
    tunnelling, energy = Tunnelling(model, data), EnergyGain(model, data, scene.given)
    guard = GuardedStepper(model, data) if method == "guarded" else None
    every = max(1, round(LOOK / timestep))
    steps = round(scene.seconds / timestep) + 1
    spent, begin, calls, exhausted, arrested, touched = 0.0, 0.0, 0, False, False, False
    change, added = 0.0, 0.0

    def observe() -> None:
        energy.observe(data)
        tunnelling.observe(data)

    def each() -> None:
        nonlocal begin
        paused = time.thread_time()
        observe()
        begin += time.thread_time() - paused

    for k in range(steps):
        if scene.move is not None:
            scene.move(data, data.time + timestep)
        begin = time.thread_time()
        report = None
        if guard is None:
            mujoco.mj_step(model, data)
        else:
            report = guard.step(each)
            calls += report.steps
            exhausted |= report.exhausted
            arrested |= bool(report.impact_zones)
            touched |= report.steps > 1
        spent += time.thread_time() - begin
        if report is not None and report.balance is not None and not model.nu:
            change += float(np.diff(report.balance.energy.sum(axis=1))[0]) / energy.unit
            added = max(added, change)
        if k % every == every - 1 or k == steps - 1:
            observe()
            if not np.isfinite(energy.most):
                break
    velocity = np.zeros(6)
    mujoco.mj_objectVelocity(
        model, data, mujoco.mjtObj.mjOBJ_GEOM, model.geom(scene.geom).id, velocity, 0
    )
    held = not tunnelling.pairs and bool(np.isfinite(energy.most))
    return Played(
        held,
        exhausted,
        arrested,
        touched,
        float(energy.most),
        spent,
        calls / steps,
        velocity[3:].tolist(),
        added,
    )
