"""A real UR10e: residuals, false alarms and semi-real collisions on logs that training never saw.

``residual``: root mean square of the plain observer's residual per joint on each log under the
calibration from the other unloaded ones (observer 20/s, published drive gains); the loaded log with
its load untold, told (its mass; the centre is identified on the log's first half, the second half
is judged) and tracked. ``alarms``: every log judged by a detector from all the others.
``smallest``: the smallest semi-real contact on one joint that 95 % of trials find, on held-out logs.

The data (see the README) are those of Mamedov et al. 2020; set TAUGUARD_DATA to a folder that holds
``ur10e/``. What was chosen by looking at these logs: the terms of the allowances and that friction
is their floor. The numbers in them, thresholds included, come from the training logs alone.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tauguard.benchmarks.report import Row
from tauguard.datasets import read_log
from tauguard.datasets.drives import UR10E
from tauguard.detectors import ArmModel, RobotNumbers, Unknowns, poisson_rate
from tauguard.detectors.assessment import left_out, residual_rms
from tauguard.detectors.free_motion import FreeMotionDetector
from tauguard.detectors.identification import Load, Recording, identify
from tauguard.detectors.semi_real import moments, smallest_found
from tauguard.models import pin_model
from tauguard.traces import Trace

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: What a log's name says of its load.
LOADS: dict[str, Load | None] = {
    "ur-20_01_13-load_2600": Load(2.6),
    "ur-20_01_31-load": None,
}
SPLIT = 0.5  # share of the loaded log on which the centre of a told load is identified


@dataclass(frozen=True)
class Data:
    """The logs by name."""

    arm: ArmModel
    moving: dict[str, Recording]  #: excitation and single-joint motion
    standing: dict[str, Recording]  #: standstill poses


def available() -> Path | None:
    """The folder of the logs, None where they are absent."""
    folder = Path(os.environ.get("TAUGUARD_DATA", "data")) / "ur10e"
    return folder if (folder / "ur10e.urdf").is_file() else None


def load(folder: Path) -> Data:
    """Read the logs."""

    def recordings(kind: str) -> dict[str, Recording]:
        found = {}
        for path in sorted((folder / kind).glob("*.csv")):
            trace = read_log(path, "ur10e").trace
            found[path.stem] = Recording(trace, LOADS.get(path.stem, Load()))
        return found

    robot = RobotNumbers.from_pin(pin_model(folder / "ur10e.urdf"))
    moving = recordings("free") | recordings("jointwise")
    return Data(ArmModel(robot, np.array(UR10E.gain)), moving, recordings("validation"))


def run(quick: bool, seed: int) -> list[Row]:
    """All rows; one that says so where the data are absent."""
    folder = available()
    if folder is None:
        return [{"study": "real", "log": "no UR10e data: set TAUGUARD_DATA"}]
    data = load(folder)
    return [*residual_rows(data), *detector_rows(data, quick, seed)]


def residual_rows(data: Data) -> list[Row]:
    """Held-out residuals, without a load, and with one that is untold, told or tracked."""
    excitation = {
        name: r for name, r in data.moving.items() if "joint" not in name and name not in LOADS
    }
    held = dict(zip(excitation, left_out(data.arm, list(excitation.values())), strict=True))
    rows = [_rms_row(name, "none", rms) for name, rms in held.items()]
    pooled = np.sqrt(np.mean(np.square(list(held.values())), axis=0))
    rows.append(_rms_row("all without a load", "none", pooled))
    arm = identify(data.arm, list(excitation.values())).arm
    for name in LOADS:
        if name not in data.moving:
            continue
        first, second = _halves(data.moving[name].trace)
        rows.append(_rms_row(name, "untold", residual_rms(arm, second)))
        tracked = Unknowns(offset=0.0)
        rows.append(_rms_row(name, "tracked", residual_rms(arm, second, unknowns=tracked)))
        recordings = [*excitation.values(), Recording(first, LOADS[name])]
        told = identify(data.arm, recordings)
        robot = told.arm.robot
        inertial = robot.inertial.copy()
        inertial[-1] += told.loads[-1]
        carrying = ArmModel(robot.with_inertial(inertial), told.arm.drive_gain, told.arm.friction)
        how = "told" if LOADS[name] else f"found {told.loads[-1, 0]:.2f} kg"
        rows.append(_rms_row(name, how, residual_rms(carrying, second)))
    return rows


def _halves(trace: Trace) -> tuple[Trace, Trace]:
    from dataclasses import replace

    cut = int(SPLIT * len(trace.t))
    first, second = (
        replace(trace, t=trace.t[s], q=trace.q[s], qd=trace.qd[s], current=trace.current[s])
        for s in (slice(None, cut), slice(cut, None))
    )
    return first, second


def _rms_row(log: str, how: str, rms: np.ndarray) -> Row:
    return {"study": "residual", "log": log, "load": how} | {
        f"j{k} rms N m": float(v) for k, v in enumerate(rms, 1)
    }


def detector_rows(data: Data, quick: bool, seed: int) -> list[Row]:
    """False alarms and smallest contacts under detectors that never saw the log."""
    names = list(data.moving)
    chosen = [names[2], names[6], names[-2]] if quick else names
    trials, blows = (2, ((0.1, "blow"),)) if quick else (3, ((0.1, "blow"), (0.3, "push")))
    rows: list[Row] = []
    count, seconds = 0, 0.0
    found: dict[tuple[float, str, int], list[float]] = {}
    for turn, name in enumerate(chosen):
        train = [r for other, r in data.moving.items() if other != name]
        detector = FreeMotionDetector().fit(train, data.arm)
        judged = {name: data.moving[name]} | (data.standing if turn == 0 else {})
        for log, recording in judged.items():
            row, alarms, judged_seconds = _alarm_row(detector, log, recording.trace)
            rows.append(row)
            count, seconds = count + alarms, seconds + judged_seconds
        if name not in LOADS:
            _smallest(detector, data.moving[name].trace, trials, blows, seed + turn, found)
    rate = poisson_rate(count, seconds / 3600)
    rows.append(
        {
            "study": "alarms",
            "log": "all",
            "seconds": seconds,
            "alarms": count,
            "alarms/h at most": rate["high"],
        }
    )
    for (duration, shape, joint), peaks in sorted(found.items()):
        rows.append(
            {
                "study": "smallest",
                "contact": f"{shape} {duration:g} s",
                "joint": joint + 1,
                "N m (95 % found)": float(np.quantile(peaks, 0.95, method="higher")),
                "N m (median)": float(np.median(peaks)),
                "trials": len(peaks),
            }
        )
    return rows


def _alarm_row(detector: FreeMotionDetector, log: str, trace: Trace) -> tuple[Row, int, float]:
    detection = detector.detect(trace)
    settled = trace.t - trace.t[0] >= detector.settle
    rest = detector.rests(trace)[settled]
    seconds = float(settled.sum() * trace.dt)
    row: Row = {
        "study": "alarms",
        "log": log,
        "seconds": seconds,
        "alarms": len(detection.alarms),
        "joint-seconds at rest": float(rest.sum() * trace.dt),
        "highest score": float(detection.score[settled].max()),
    }
    return row, len(detection.alarms), seconds


def _smallest(
    detector: FreeMotionDetector,
    trace: Trace,
    trials: int,
    blows: tuple[tuple[float, str], ...],
    seed: int,
    found: dict[tuple[float, str, int], list[float]],
) -> None:
    """Adds the smallest contacts found on each joint in motion."""
    gain, rests = detector.arm.drive_gain, detector.rests(trace)
    for joint in range(rests.shape[1]):
        starts = moments(~rests[:, joint], trace.t, trials, 1000 * seed + joint)
        for duration, shape in blows:
            peaks = smallest_found(
                lambda t: detector.detect(t).alarm,
                trace,
                gain,
                joint,
                starts,
                seconds=duration,
                shape=shape,
            )
            found.setdefault((duration, shape, joint), []).extend(peaks)


def draw(rows: list[Row], figure: Figure) -> None:
    """Residuals by log, and the smallest contacts by joint."""
    left, right = figure.subplots(1, 2)
    for row in rows:
        if row["study"] == "residual":
            values = [row[f"j{k} rms N m"] for k in range(1, 7)]
            left.semilogy(range(1, 7), values, "o-", label=f"{row['log']} ({row['load']})")
    left.set(xlabel="joint", ylabel="residual RMS [N m]")
    if left.lines:
        left.legend(fontsize=6)
    smallest = [row for row in rows if row["study"] == "smallest"]
    for contact in dict.fromkeys(str(row["contact"]) for row in smallest):
        own = [row for row in smallest if row["contact"] == contact]
        right.semilogy(
            [row["joint"] for row in own],
            [row["N m (95 % found)"] for row in own],
            "o-",
            label=contact,
        )
    right.set(xlabel="joint", ylabel="smallest contact found in 95 % of trials [N m]")
    if right.lines:
        right.legend()
