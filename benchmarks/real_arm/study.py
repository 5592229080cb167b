"""A real UR10e: residuals, false alarms and semi-real collisions on logs that training never saw.

``residual``: root mean square per joint of the plain observer's residual (20/s, published drive
gains, from the first motion to the last) on each excitation log under a calibration from the other
unloaded ones, beside the published parameters; once more without the last 0.1 s, in which a program
that is cut off brakes all joints within a sample or two. The loaded logs with their load untold,
with it untold and tracked, and told (its centre and inertia, where the mass is unknown that too,
identified on one half of the log, judged on the other; a mass that is told also fixes the gains, as
in ``tauguard calibrate``, and the residual is given in the published gains' newton metres).
``alarms``: the logs are dealt into splits; a detector that
learned from the other splits judges each log, in quick runs once, in full ones under four deals. In
the split ``free only`` it has seen neither single-joint motion nor dwells. ``smallest``: the
smallest semi-real contact on one moving joint that 95 % of trials find, on such unseen logs.
``pushes``: a hand's push at the last link, see :mod:`~tauguard.benchmarks.real_arm.pushes`.

The peer in every row is what needs no training: the plain momentum observer with the published
parameters and thresholds of 1.5 times the largest residual of a log's first 10 seconds.

The data (see the documentation) are those of Mamedov et al. 2020; set TAUGUARD_DATA to a folder
that holds ``ur10e/``. Chosen by looking at these same logs, so that the figures are a little better
than a fresh arm's would be: the columns of the friction model (the slope of 1 rad/s among 0.6, 1
and 1.5), the terms of the allowances, the gain of the detector's observer, its confirmation, how
far (0.3, 0.4 and 0.6 of the joints' noise) and how fast (1, 3, 5 and 10 s) its tracked offset may
go, its prior of the payload (1, 1.5, 2 and 3 kg), how fast payload and friction may change (60, 300
and 1000 s), from how large an innovation it counts less (3, 5, 6, 8, 10, 15 and 30 deviations),
how long a motion counts for a joint at rest (rates of 0.5, 1, 2 and 4/s), how the
joints' ratios become one score (the largest, the root of the sum of the squares, the sum), the
spread of friction weights (0.3, 1, 3 and 10 of a joint's torque), the 0.1 s at the end, and from
what share of unexplained torque a log is refused. Looked at and dropped: corrections 0.05 to 0.5 s
apart, an observer at 30/s, smaller friction deviations, a regime of its own for an arm that has
settled. The numbers in them, thresholds included, come from the training logs alone.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from tauguard.benchmarks.real_arm.pushes import Tried, push_rows, pushed
from tauguard.datasets import read_log
from tauguard.datasets.drives import UR10E
from tauguard.detectors import ArmModel, FrictionModel, RobotNumbers, Unknowns, poisson_rate
from tauguard.detectors.calibration.assessment import left_out, residual_rms
from tauguard.detectors.calibration.identification import identify
from tauguard.detectors.calibration.recording import Load, Recording
from tauguard.detectors.evaluation.semi_real import moments, smallest_found
from tauguard.detectors.methods.free_motion import FreeMotionDetector
from tauguard.detectors.thresholds.quiet_start import watch
from tauguard.models import pin_model
from tauguard.report import Row
from tauguard.traces import Trace

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

#: What a log's name says of its load.
LOADS: dict[str, Load | None] = {"ur-20_01_13-load_2600": Load(2.6), "ur-20_01_31-load": None}
#: What the columns of each table mean.
NOTES = {
    "residual": "root mean squares of the plain observer's residual, of logs that the parameters "
    "were not identified on. The published ones are those of the data's authors, without offsets.",
    "alarms": "a score held for t_c above 1 is an alarm; how far below 1 it stayed is the margin.",
    "false alarms": "each deal judges every log once, by a detector that has not seen it. The peer "
    "needs each log's first 10 s, in which it is not judged.",
    "smallest": "a contact's torque on one joint, added through the dynamics to recorded motion: "
    "the peak that is found in 95 % and in half of the trials.",
    "pushes": "half sines of 0.3 to 1 s at the last link, in any direction, added in the same way; "
    "delays count from where the force is still 0. Nobody reacts: the motion is as recorded.",
}
QUIET = 10.0  #: seconds from which the peer learns its thresholds
STOP = 0.1  #: seconds before a log's last motion in which its program is cut off


@dataclass(frozen=True)
class Data:
    """The logs by name."""

    arm: ArmModel
    moving: dict[str, Recording]  #: excitation and single-joint motion
    standing: dict[str, Recording]  #: standstill poses

    @property
    def excitation(self) -> dict[str, Recording]:
        """Motion of all joints without a load."""
        return {n: r for n, r in self.moving.items() if "joint" not in n and n not in LOADS}


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
        return [{"study": "real arm", "log": "no UR10e logs: set TAUGUARD_DATA to their folder"}]
    data = load(folder)
    return [*residual_rows(data), *detector_rows(data, quick, seed)]


# -- residuals ------------------------------------------------------------------------------------


def residual_rows(data: Data) -> list[Row]:
    """Held-out residuals, without a load, and with one that is untold, tracked or told."""
    logs = data.excitation
    book = FrictionModel.coulomb_viscous(UR10E.coulomb, UR10E.viscous, width=0.02)
    published = replace(data.arm, friction=book)
    held, before = (left_out(data.arm, list(logs.values()), stop=stop) for stop in (0.0, STOP))
    plain = [residual_rms(published, r.trace) for r in logs.values()]
    rows = [_rms("from the other logs", n, "none", h) for n, h in zip(logs, held, strict=True)]
    for how, values in (("from the other logs", held), ("published", plain)):
        rows.append(_rms(how, "all without a load", "none", _pooled(values)))
    cut = _pooled(before)
    rows.append(_rms("from the other logs", f"all, without the last {STOP:g} s", "none", cut))
    arm = identify(data.arm, list(logs.values())).arm
    for name in (n for n in LOADS if n in data.moving):
        told, masses = _told(data, name)
        whole = data.moving[name].trace
        tracked = residual_rms(arm, whole, unknowns=Unknowns(offset=0.0))
        heavy = f"{'told' if LOADS[name] else 'identified'} {np.mean(masses):.2f} kg"
        rows += [
            _rms("from the other logs", name, "untold", residual_rms(arm, whole)),
            _rms("from the other logs", name, "untold, tracked", tracked),
            _rms("from the other logs", name, heavy, _pooled(told)),
            _rms("published", name, "untold", residual_rms(published, whole)),
        ]
    return rows


def _told(data: Data, name: str) -> tuple[list[Array], list[float]]:
    """Residuals of each half of a log whose load the other half identified, and its masses [kg]."""
    logs, load = list(data.excitation.values()), LOADS[name]
    halves = _halves(data.moving[name].trace)
    told, masses = [], []
    for own, other in (halves, halves[::-1]):
        scale = "gains" if load is None else "payload"
        found = identify(data.arm, [*logs, Recording(own, load)], scale=scale)
        published = data.arm.drive_gain / found.arm.drive_gain
        told.append(published * residual_rms(carrying(found.arm, found.loads[-1]), other))
        masses.append(float(found.loads[-1, 0]))
    return told, masses


def carrying(arm: ArmModel, numbers: Array) -> ArmModel:
    """The arm with a load's inertial numbers, shape (10,), added to its last link."""
    inertial = arm.robot.inertial.copy()
    inertial[-1] += numbers
    return replace(arm, robot=arm.robot.with_inertial(inertial))


def _pooled(levels: list[Array]) -> Array:
    out: Array = np.sqrt(np.mean(np.square(levels), axis=0))
    return out


def _halves(trace: Trace) -> tuple[Trace, Trace]:
    cut = len(trace.t) // 2
    first, second = (
        replace(trace, t=trace.t[s], q=trace.q[s], qd=trace.qd[s], current=trace.current[s])
        for s in (slice(None, cut), slice(cut, None))
    )
    return first, second


def _rms(parameters: str, log: str, carried: str, rms: Array) -> Row:
    return {"study": "residual", "log": log, "parameters": parameters, "load": carried} | {
        f"j{k} N m": float(v) for k, v in enumerate(rms, 1)
    }


# -- false alarms and smallest contacts -----------------------------------------------------------


def splits(data: Data, deals: int, seed: int) -> Iterator[tuple[str, list[str]]]:
    """Names of splits and their logs to judge: the rest trains."""
    names = list(data.moving)
    yield "free only", [name for name in names if "joint" in name]
    for deal in range(deals):
        order = names if deal == 0 else list(np.random.default_rng(seed + deal).permutation(names))
        parts = 3 if deals == 1 else 4
        for k in range(parts):
            yield f"{deal + 1}.{k + 1} of {parts}", order[k::parts]


def detector_rows(data: Data, quick: bool, seed: int) -> list[Row]:
    """False alarms and smallest contacts under detectors that never saw the log."""
    trials, deals = (2, 1) if quick else (4, 4)
    blows = ((0.1, "blow"),) if quick else ((0.05, "blow"), (0.1, "blow"), (0.5, "push"))
    rows: list[Row] = []
    found: dict[tuple[float, str, int], list[tuple[float, float]]] = {}
    hands: list[Tried] = []
    dealt = list(splits(data, deals, seed))
    for turn, (split, test) in enumerate(tqdm(dealt, desc="splits", unit="split")):
        train = [r for name, r in data.moving.items() if name not in test]
        detector = FreeMotionDetector().fit(train, data.arm)
        standing = data.standing if split == "free only" or split.split(".")[1][0] == "1" else {}
        judged = {name: data.moving[name] for name in test} | standing
        rows += [
            _alarm_row(data, detector, split, name, r.trace, len(train))
            for name, r in judged.items()
        ]
        struck = [name for name in test if name in data.excitation][: 1 if quick else 2]
        for name in struck:
            _smallest(data, detector, name, trials, blows, seed + turn, found)
        hit = [data.moving[name].trace for name in struck] + [r.trace for r in standing.values()]
        robot = data.arm.robot
        hands += pushed(detector, _peer(data), robot, hit, 6 * trials, QUIET, seed + turn)
    return [*rows, *_totals(rows), *_smallest_rows(found), *push_rows(hands)]


def _alarm_row(
    data: Data, detector: FreeMotionDetector, split: str, name: str, trace: Trace, logs: int
) -> Row:
    detection = detector.detect(trace)
    settled = trace.t - trace.t[0] >= detector.settle
    rest = detector.rests(trace)[settled]
    row: Row = {
        "study": "alarms",
        "split": split,
        "log": name,
        "trained on": logs,
        "seconds": float(settled.sum() * trace.dt),
        "alarms": len(detection.alarms),
        "joint-seconds at rest": float(rest.sum() * trace.dt),
        "highest score held": _held(detector, trace),
        "peer seconds": 0.0,
        "peer alarms": 0,
    }
    if trace.t[-1] - trace.t[0] > QUIET + 1:
        alarm = _peer(data)(trace)
        starts = np.count_nonzero(np.diff(alarm.astype(int)) > 0)
        row["peer seconds"] = float(trace.t[-1] - trace.t[0] - QUIET)
        row["peer alarms"] = int(starts)
    return row


def _held(detector: FreeMotionDetector, trace: Trace) -> float:
    """The highest score that lasts as long as an alarm needs; 1 is the threshold."""
    from tauguard.detectors.thresholds.confirmation import confirmation_samples
    from tauguard.detectors.thresholds.rates import sustained

    samples = confirmation_samples(detector.settings.confirmation, detector.dt)
    score = sustained(detector.scores(trace), samples)
    return float(score[trace.t - trace.t[0] >= detector.settle + 0.1].max())


def _peer(data: Data) -> Callable[[Trace], NDArray[np.bool_]]:
    """Alarms of the plain observer with published parameters, thresholds from quiet seconds."""

    def alarms(trace: Trace) -> NDArray[np.bool_]:
        tau = UR10E.tau(trace.current, trace.qd)
        return watch(trace, data.arm.robot, tau, QUIET).detection.alarm

    return alarms


def _totals(rows: list[Row]) -> list[Row]:
    """Counts of each deal, every log once; the exact 95 % interval's upper end [1/h]."""
    out = []
    deals = dict.fromkeys(str(row["split"]).split(".")[0] for row in rows)
    for deal in deals:
        own = [row for row in rows if str(row["split"]).split(".")[0] == deal]
        seconds, alarms, peer, count = (
            sum(float(row[key]) for row in own)
            for key in ("seconds", "alarms", "peer seconds", "peer alarms")
        )
        out.append(
            {
                "study": "false alarms",
                "deal": deal,
                "seconds": seconds,
                "joint-seconds at rest": sum(float(row["joint-seconds at rest"]) for row in own),
                "alarms": int(alarms),
                "per hour at most": poisson_rate(int(alarms), seconds / 3600)["high"],
                "peer seconds": peer,
                "peer alarms": int(count),
                "peer per hour": 3600 * count / peer,
            }
        )
    return out


def _smallest(
    data: Data,
    detector: FreeMotionDetector,
    name: str,
    trials: int,
    blows: tuple[tuple[float, str], ...],
    seed: int,
    found: dict[tuple[float, str, int], list[tuple[float, float]]],
) -> None:
    """Adds the smallest contacts found on each joint in motion, by the detector and its peer."""
    trace, gain = data.moving[name].trace, data.arm.drive_gain
    rests = detector.rests(trace)
    watched = trace.t > trace.t[0] + QUIET + 1
    methods = (lambda t: detector.detect(t).alarm), _peer(data)
    for joint in range(rests.shape[1]):
        starts = moments(~rests[:, joint] & watched, trace.t, trials, 1000 * seed + joint)
        for seconds, shape in blows:
            pair = [
                smallest_found(m, trace, gain, joint, starts, seconds=seconds, shape=shape)
                for m in methods
            ]
            own = found.setdefault((seconds, shape, joint), [])
            own += [(float(a), float(b)) for a, b in zip(*pair, strict=True)]


def _smallest_rows(found: dict[tuple[float, str, int], list[tuple[float, float]]]) -> list[Row]:
    rows = []
    for (duration, shape, joint), pairs in sorted(found.items()):
        own, peer = np.array(pairs).T
        high, peer_high = (np.quantile(v, 0.95, method="higher") for v in (own, peer))
        rows.append(
            {
                "study": "smallest",
                "contact": f"semi-real {shape} {duration:g} s",
                "joint": joint + 1,
                "N m (95 % found)": float(high),
                "N m (median)": float(np.median(own)),
                "peer N m (95 %)": float(peer_high) if np.isfinite(peer_high) else None,
                "peer N m (median)": float(np.median(peer)),
                "trials": len(pairs),
            }
        )
    return rows


def draw(rows: list[Row], figure: Figure) -> None:
    """Residuals by log, and the smallest contacts by joint."""
    left, right = figure.subplots(1, 2)
    for row in rows:
        if row["study"] == "residual":
            values = [row[f"j{k} N m"] for k in range(1, 7)]
            style = "k--" if row["parameters"] == "published" else "o-"
            label = f"{row['log']}, {row['parameters']} ({row['load']})"
            left.semilogy(range(1, 7), values, style, label=label)
    left.set(xlabel="joint", ylabel="residual RMS [N m]")
    smallest = [row for row in rows if row["study"] == "smallest"]
    for contact in dict.fromkeys(str(row["contact"]) for row in smallest):
        own = [row for row in smallest if row["contact"] == contact]
        joints = [row["joint"] for row in own]
        right.semilogy(joints, [row["N m (95 % found)"] for row in own], "o-", label=contact)
        peer = [row["peer N m (95 %)"] or np.nan for row in own]
        right.semilogy(joints, peer, "k--", label=f"{contact}, peer")
    right.set(xlabel="joint", ylabel="smallest contact found in 95 % of trials [N m]")
    for axes in (left, right):
        if axes.lines:
            axes.legend(fontsize=6)
