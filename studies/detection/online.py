"""Computing time of one sample: simulation and detection in batch, then each method online.

scikit-learn's ``SVR.predict`` gets the same windows as the kernel sum, one row per call. Its time
includes a kernel row that NumPy computes, which is faster than scikit-learn's callable kernels.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from studies.framework import per, time_in_turn
from tauguard.arrays import Array
from tauguard.report import Row

if TYPE_CHECKING:
    from tauguard.detectors import CollisionAlarm
    from tauguard.detectors.scores.kernel import KernelMachine, SrqRegressor
    from tauguard.traces import Trace


#: Fractions of the support vectors that reduced sets keep.
SHARES = (0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.75)
PERIOD = 1000.0  #: period of a controller at 1 kHz [us]
GOAL = 100.0  #: largest wanted median time of a sample [us]
#: Methods of a quick run.
QUICK = ("moving-thresholds", "residual-thresholds", "srq-svr")
#: False alarms per hour that thresholds aim at.
PER_HOUR = 10.0

#: What the columns of each table mean.
NOTES = {
    "real time": "processor time of one core per sample at 1 kHz [us], of collision-free motion: "
    "simulation, the plain observer, and the rest of the shipped detector (tracking, features, "
    "400 support vectors, threshold). times: real time / time of all together. peer: "
    "MuJoCo's own rollout of the bare arm in the same run. difference_to_online: largest "
    "difference of the scores.",
    "step": "wall time of one sample of the whole detector (observer, features, SVR), one thread "
    "[us]; over_a_period: number of samples that took over 1 ms; difference_to_batch: largest "
    "difference of the scores.",
    "kernel": "one window of the SVR alone: all support vectors, then fewer. The peer is "
    "scikit-learn's predict with a kernel row by NumPy, which is faster than its callable kernels. "
    "error: difference of the output from that of all vectors. Effects on missed collisions are "
    "not measured.",
}


@dataclass(frozen=True)
class Extent:
    """How much is trained on and timed."""

    slices: int  #: training slices with collisions
    free: int  #: training slices without collisions
    samples: int  #: number of timed samples
    single: int  #: rows that scikit-learn predicts, one per call
    seconds: float  #: duration of the motion that is timed from scene to alarm [s]
    repeats: int  #: how often this motion is timed


def motions(extent: Extent, seed: int) -> tuple[list[Trace], Trace]:
    """Training traces of a simulated arm, and a motion with collisions that is not among them."""
    from studies.detection.motions import TRAINING_SPEEDS
    from tauguard.datasets.plans import TRAINING_PAYLOADS, free_episodes, struck_episodes
    from tauguard.envs import simulate
    from tauguard.models import Mismatch

    arm = Mismatch(seed=500 + seed)
    payloads = TRAINING_PAYLOADS[:: max(1, 15 // extent.slices)]
    planned = struck_episodes(3 * seed, extent.slices, 5, TRAINING_SPEEDS, payloads, arm)
    planned += free_episodes(3 * seed + 1, extent.free, 30.0, TRAINING_SPEEDS, payloads, arm)
    unseen = struck_episodes(3 * seed + 2, 1, 8, (40.0,), (1500.0,), arm)
    return [simulate(episode) for episode in planned], simulate(unseen[0])


def timed(calls: Callable[[int], object], count: int) -> Array:
    """Microseconds of ``calls(k)`` for every k below ``count``."""
    spent = np.empty(count, dtype=np.int64)
    for k in range(count):
        begin = time.perf_counter_ns()
        calls(k)
        spent[k] = time.perf_counter_ns() - begin
    return spent / 1e3


def spread(spent: Array) -> Row:
    """Median and quartiles [us]."""
    low, median, high = (float(x) for x in np.percentile(spent, (25, 50, 75)))
    return {"median": median, "low": low, "high": high}


def step_row(alarm: CollisionAlarm, trace: Trace, samples: int) -> Row:
    """Row ``step``: time of a sample in observer, payload estimate, method and threshold."""
    count = min(samples, len(trace.t))
    score, dt = alarm.scores(trace)[:count], [None, *np.diff(trace.t[:count])]
    rows = list(zip(trace.q[:count], trace.qd[:count], trace.current[:count], dt, strict=True))
    stream = alarm.stream()
    spent = timed(lambda k: stream.step(*rows[k]), count)[500:]
    return {
        "study": "step",
        "detector": alarm.detector.name,
        "samples": count,
        "us": spread(spent),
        "us_p99": float(np.percentile(spent, 99)),
        "us_max": float(spent.max()),
        "over_a_period": int((spent > PERIOD).sum()),
        "difference_to_batch": difference_online(alarm, trace, score),
        "met": bool(np.median(spent) <= GOAL),
    }


def difference_online(alarm: CollisionAlarm, trace: Trace, score: Array) -> float:
    """Largest difference between ``score``, (N,), and the online scores of N samples."""
    stream, online = alarm.stream(), np.empty_like(score)
    steps = (None, *np.diff(trace.t[: len(score)]))
    for k, dt in enumerate(steps):
        stream.step(trace.q[k], trace.qd[k], trace.current[k], dt)
        online[k] = stream.score
    return float(np.abs(online - score).max())


def real_time_row(alarm: CollisionAlarm, seed: int, seconds: float, repeats: int) -> Row:
    """Row ``real time``: time per sample on one core, from simulation to alarm."""
    from dataclasses import replace

    from threadpoolctl import threadpool_limits

    from oracles.bare_physics import rollout_along
    from tauguard.datasets.plans import free_episodes
    from tauguard.detectors import observe
    from tauguard.envs import Simulation, simulate
    from tauguard.models import Mismatch

    (episode,) = free_episodes(3 * seed + 2, 1, seconds, (40.0,), (1500.0,), Mismatch(seed=500))
    trace, arm = simulate(episode), alarm.detector.arm
    tau = arm.drive_gain * trace.current
    calls: dict[str, Callable[[], object]] = {
        "simulation": lambda: simulate(episode),
        "observer": lambda: observe(arm.robot, trace.t, trace.q, trace.qd, tau, threads=1),
        "detection": lambda: alarm.detect(replace(trace)),  # a copy: estimates are cached by trace
        "peer": rollout_along(Simulation(episode).motion),
    }
    with threadpool_limits(1):
        taken = time_in_turn(calls, repeats, time.process_time)
        found = alarm.detect(replace(trace))
    us = {name: per(time, len(trace.t), 1e6) for name, time in taken.items()}
    rest = {n: us["detection"][n] - us["observer"]["median"] for n in ("median", "low", "high")}
    total = us["simulation"]["median"] + us["detection"]["median"]
    return {
        "study": "real time",
        "detector": alarm.detector.name,
        "simulation_us": us["simulation"],
        "observer_us": us["observer"],
        "detector_us": rest,
        "total_us": total,
        "times": 1e3 / total,
        "peer_us": us["peer"],
        "difference_to_online": difference_online(alarm, trace, found.score[:5000]),
    }


def peer(regressor: SrqRegressor) -> Callable[[Array], Array]:
    """scikit-learn's own ``predict`` of the fitted SVR on one window, shape (1, size)."""
    svr, vectors = regressor.svr_, regressor.machine_.vectors
    row = np.zeros((1, svr.shape_fit_[0]))
    columns, scale = svr.support_, 1 / regressor.sigma**2

    def predict(window: Array) -> Array:
        gap = vectors - window
        row[0, columns] = (1 + scale * np.einsum("ij,ij->i", gap, gap)) ** -2.0
        value: Array = svr.predict(row)
        return value

    return predict


def kernel_rows(regressor: SrqRegressor, windows: Array, single: int, seed: int) -> list[Row]:
    """Rows ``kernel``: times of the sum over all vectors, of scikit-learn, and of reduced sets."""
    rng = np.random.default_rng([seed, 9])
    own = np.ascontiguousarray(windows[rng.integers(len(windows), size=single)])
    value = np.empty(single)
    slices = [own[k : k + 1] for k in range(single)]
    theirs, machine = peer(regressor), regressor.machine_
    full, total = machine(windows), len(machine.vectors)
    rows = []
    for model in (machine, *(machine.reduced(max(1, round(s * total))) for s in SHARES)):
        call = _one_window(model, slices)
        timed(call, min(200, single))
        ours = timed(call, single)
        row: Row = {"study": "kernel", "support_vectors": len(model.vectors)}
        row |= {"us": spread(ours), "us_p99": float(np.percentile(ours, 99))}
        again = timed(lambda k: value.__setitem__(k, theirs(slices[k])[0]), single)
        row |= {"sklearn_us": spread(again), "speedup": float(np.median(again) / np.median(ours))}
        row["difference_to_sklearn"] = float(np.abs(model(own) - value).max())
        error = np.abs(model(windows) - full)
        row |= {"error_rms": float(np.sqrt(np.mean(error**2))), "error_max": float(error.max())}
        rows.append(row)
    return sorted(rows, key=lambda r: -int(r["support_vectors"]))


def _one_window(model: KernelMachine, slices: list[Array]) -> Callable[[int], object]:
    """The kernel sum at the k-th window, one thread."""
    kernel, out = model.native, np.empty(1)
    return lambda k: kernel.rows(slices[k], out, 1)


def measure(quick: bool, seed: int) -> list[Row]:
    """Rows ``real time`` (scene to alarm), ``step`` (methods), ``kernel`` (fewer vectors)."""
    from tauguard.detectors import DETECTORS, SrqSvr, make_detector
    from tauguard.detectors.alarms.training import held_out, train
    from tauguard.detectors.calibration.nominal import nominal_design
    from tauguard.detectors.scores.kernel import SrqRegressor

    extent = Extent(3, 4, 8_000, 500, 10.0, 3) if quick else Extent(15, 20, 27_000, 5000, 60.0, 9)
    traces, trace = motions(extent, seed)
    arm = nominal_design()
    rows: list[Row] = []
    for name in QUICK if quick else DETECTORS:
        alarm = train(make_detector(name), traces, arm, PER_HOUR)
        if name == "srq-svr":
            rows.append(real_time_row(alarm, seed, extent.seconds, extent.repeats))
        rows.append(step_row(alarm, trace, extent.samples))
    rows.sort(key=lambda row: row["study"] != "real time")
    full: list[SrqRegressor] = []

    class Keeping(SrqSvr):
        def learn(self, x: Array, y: Array) -> KernelMachine:
            full.append(SrqRegressor(self.sigma, self.C, self.epsilon).fit(x, y))
            return full[-1].machine_

    fitted = Keeping(vectors=0, windows=900 if quick else SrqSvr.windows).fit(
        held_out(traces)[0], arm
    )
    signal = fitted.front.scaled(trace, fitted.scaling)
    windows = fitted.shape.of(signal, np.arange(len(signal)))
    return rows + kernel_rows(full[-1], windows, extent.single, seed)
