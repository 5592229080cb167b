"""Identification of real arms beside figaroh: torque error on logs that took no part.

Every second collision-free log without a load identifies, the others test. The error is the
measured torque of the drives less the model's at the measured motion, whose accelerations come from
a polynomial fit to the velocities (Savitzky-Golay, 0.1 s). The row "robot file" has no
identification: the file's inertias, nominal gains, no friction.

figaroh 1.0 (Apache-2.0) gets the same samples, at most 5,000: its regressor with viscous and static
friction, actuator inertia and offset, its base parameters, and least squares.
"""

from __future__ import annotations

import contextlib
import importlib
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.signal import savgol_filter

from tauguard.arrays import Array
from tauguard.benchmark.arms import ARMS, Arm, initial_arm, is_there, logs
from tauguard.benchmark.judging import SETTLE
from tauguard.detectors import ArmModel, inverse_dynamics
from tauguard.detectors.calibration.log_torques import drive_torque
from tauguard.detectors.scores.free_motion import FreeMotion
from tauguard.models import pin_model
from tauguard.report import Row
from tauguard.traces import Trace
from tauguard.traces.logs import Load, Log

NOTES = {
    "identification": "error: root mean square of the torque error on held-out logs, mean over "
    "joints [N m]; explained: 1 - error^2 / variance of the torque, worst moving joint and median; "
    "parameters: those that the logs determine, of all; ratio: time over tauguard's in this run, "
    "which includes the detector's bounds.",
}
NAMES = ("ur5", "ur10e", "ur3", "kuka_med7")  # the first one in a quick run
#: Most samples of the peer's regressor, and the width of the fit to velocities [s].
SAMPLES, WIDTH = 5000, 0.1
#: A joint moves in a log if its speed exceeds this [rad/s].
MOVES = 0.05

#: Torque error of a log [N m], shape (T, n).
Errors = Callable[[Trace], Array]


def measure(quick: bool, seed: int) -> list[Row]:
    """One row for each arm and tool, or one that says that the data are absent."""
    arms = [ARMS[name] for name in NAMES if is_there(ARMS[name])]
    if not arms:
        return [{"study": "identification", "log": "no logs: run `tauguard data fetch all`"}]
    return [row for arm in (arms[:1] if quick else arms) for row in _arm_rows(arm)]


def _arm_rows(arm: Arm) -> list[Row]:
    every = [log for log, _ in logs(arm.name, "free") if log.load == Load()]
    training, test = every[::2], every[1::2]
    rows: list[Row] = []
    base = 0.0
    with contextlib.suppress(ImportError):  # outside of the measured time
        importlib.import_module("figaroh.tools.regressor")
    for tool, make in {"tauguard": ours, "figaroh": figaroh, "robot file": robot_file}.items():
        begin = time.perf_counter()
        try:
            errors, parameters = make(arm, training)
        except ImportError:
            rows.append(
                {"study": "identification", "arm": arm.name, "tool": "figaroh: not installed"}
            )
            continue
        seconds = time.perf_counter() - begin
        base = base or seconds
        row: Row = {"study": "identification", "arm": arm.name, "tool": tool}
        rows.append(
            row | _score(errors, test) | {"parameters": parameters, "ratio": seconds / base}
        )
    return rows


def _score(errors: Errors, test: list[Log]) -> Row:
    left, torque, moves = [], [], []
    for log in test:
        trace = log.trace
        rows = trace.t - trace.t[0] > SETTLE
        left.append(errors(trace)[rows])
        torque.append((trace.current * initial_gain(log))[rows])
        moves.append(np.abs(trace.qd[rows]).max(axis=0) > MOVES)
    error, tau = np.concatenate(left), np.concatenate(torque)
    explained = 1 - (error**2).mean(axis=0) / tau.var(axis=0)
    moving = explained[np.any(moves, axis=0)]
    return {
        "error": float(np.sqrt((error**2).mean(axis=0)).mean()),
        "explained, worst": float(moving.min()),
        "explained, median": float(np.median(moving)),
    }


def draw(rows: list[Row], figure: Any) -> None:
    """The torque error of every arm and tool."""
    axis = figure.subplots()
    shown = [row for row in rows if "error" in row]
    arms = list(dict.fromkeys(row["arm"] for row in shown))
    tools = list(dict.fromkeys(row["tool"] for row in shown))
    for k, tool in enumerate(tools):
        errors = [row["error"] for row in shown if row["tool"] == tool]
        places = [arms.index(row["arm"]) for row in shown if row["tool"] == tool]
        axis.bar(np.array(places) + 0.25 * (k - 1), errors, 0.25, label=tool)
    axis.set_xticks(range(len(arms)), arms)
    axis.set_ylabel("torque error on held-out logs, mean over joints [N m]")
    if shown:
        axis.legend()


def initial_gain(log: Log) -> Array:
    """The nominal drive gains of a log's arm, shape (n,)."""
    arm = next(arm for arm in ARMS.values() if arm.file == log.robot and not arm.blind)
    return initial_arm(arm).drive_gain


def acceleration(trace: Trace) -> Array:
    """[rad/s^2], shape (T, n)."""
    width = 2 * round(WIDTH / trace.dt / 2) + 1
    out: Array = savgol_filter(trace.qd, width, 3, deriv=1, delta=trace.dt, axis=0)
    return out


def _of_model(arm: ArmModel) -> Errors:
    def errors(trace: Trace) -> Array:
        needed = inverse_dynamics(arm.robot, trace.q, trace.qd, acceleration(trace))
        out: Array = drive_torque(arm, trace) - needed
        return out

    return errors


def ours(arm: Arm, training: list[Log]) -> tuple[Errors, str]:
    """tauguard's calibration."""
    model = FreeMotion().fit(training, initial_arm(arm)).arm
    return _of_model(model), "all, by priors"


def robot_file(arm: Arm, training: list[Log]) -> tuple[Errors, str]:
    """The robot file's inertias alone."""
    return _of_model(initial_arm(arm)), "none"


def figaroh(arm: Arm, training: list[Log]) -> tuple[Errors, str]:
    """figaroh's regressor and base parameters, and least squares."""
    from figaroh.tools.qrdecomposition import QRDecomposer
    from figaroh.tools.regressor import RegressorBuilder, RegressorConfig

    model = pin_model(arm.file)
    robot = SimpleNamespace(model=model, data=model.createData())
    config = RegressorConfig(has_friction=True, has_actuator_inertia=True, has_joint_offset=True)
    builder = RegressorBuilder(robot, config)
    gain = initial_arm(arm).drive_gain

    def regressor(trace: Trace, rows: Any) -> Array:
        motion = trace.q[rows], trace.qd[rows], acceleration(trace)[rows]
        out: Array = builder.build_basic_regressor(*motion, {"act_idxv": range(model.nv)})
        return out.reshape(model.nv, -1, out.shape[1])

    total = sum(len(log.trace.t) for log in training)
    step = max(1, -(-total // SAMPLES))
    chosen = [(log.trace, np.flatnonzero(log.trace.t - log.trace.t[0] > SETTLE)[::step])
              for log in training]  # fmt: skip
    w = np.concatenate([regressor(trace, rows) for trace, rows in chosen], axis=1)
    w = w.reshape(-1, w.shape[-1])
    tau = np.concatenate([(trace.current[rows] * gain) for trace, rows in chosen]).T.ravel()
    names = [f"p{k}" for k in range(w.shape[1])]
    kept = np.flatnonzero((w**2).sum(axis=0) > 1e-6)
    base, _ = QRDecomposer()._identify_base_parameters(w[:, kept], [names[k] for k in kept])
    columns = kept[list(base)]
    phi = np.linalg.lstsq(w[:, columns], tau, rcond=None)[0]

    def errors(trace: Trace) -> Array:
        found = (regressor(trace, slice(None))[:, :, columns] @ phi).T
        out: Array = trace.current * gain - found
        return out

    return errors, f"{len(columns)} of {w.shape[1]}"
