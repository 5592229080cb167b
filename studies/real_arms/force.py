"""Forces of pushes, estimated by a detector and simulated by a twin, beside a force sensor.

A UR5 stands still and is pushed at the tool, where a sensor measures the force. Detector and twin
come from its logs without contact. A row of table ``force`` compares one alarm with the sensor:
peak, impulse and contact time as ``detect --at-tool`` gives them, from the beginning of the contact
(perhaps before the alarm) to the end of the alarm. A row of ``pushed twin`` is one push: the twin
has the arm's pose and gets the sensor's force, and its joint torques are compared with the arm's.

How the sensor was mounted is not documented. Its rotation relative to the flange is fitted to the
joint torques of every second push; rows say which. Its lever is not fitted, because in the one pose
of all pushes it cannot be told from the drives' gains. The error of the sensor is not documented;
its baseline was removed, and forces below 2 N do not count as a push.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.benchmark.arms import ARMS, files, initial_arm, is_there, logs
from tauguard.benchmark.contacts import BEGINS, ENDS, sensor_spans
from tauguard.detectors import ArmModel, Diagnoser, Diagnosis
from tauguard.detectors.alarms.alarm import CollisionAlarm
from tauguard.detectors.calibration.recording import Load
from tauguard.detectors.diagnosis.contact_force import link_poses, point_jacobians
from tauguard.detectors.scores.free_motion import CONFIRMATION, FreeMotion
from tauguard.models import Friction, arm_surface
from tauguard.report import Row
from tauguard.traces import Trace
from tauguard.twin import fit_twin
from tauguard.twin.play import modelled

Array = NDArray[np.float64]

#: Arm and log with a sensor.
ARM, LOG = "ur5", "no10_standing_force"
#: Least force of a strong push in the medians [N].
STRONG = 20.0
#: The currents of a push are compared with those in this time before it [s].
BEFORE = 0.1
NOTES = {
    "force": "pushes at the tool, with --at-tool; low, high: 90 % interval; sensor: in the "
    "diagnosis's window, from the beginning of the contact to the end of the alarm. Joints that "
    "move by themselves after a push raise alarms without a force, which have no row.",
    "pushed twin": "change of the drives' torques at the sensor's peak, for the three joints "
    "with the largest change [N m]; missed: norm of the difference over the norm of the arm's "
    "change; fitted: the sensor's rotation was fitted to this push, so only the other rows are a "
    "test.",
    "errors": "median of |found / sensor - 1|, and of `missed` of the pushed twin.",
}


def measure(quick: bool, seed: int) -> list[Row]:
    """All rows, or one row that says that the data are absent."""
    arm = ARMS[ARM]
    if not is_there(arm):
        return [{"study": "force", "log": f"no logs: run `tauguard data fetch {ARM}`"}]
    free = [log for log, _ in logs(ARM, "free")]
    fitted = FreeMotion().fit(free, initial_arm(arm)).carrying(Load())
    trace = next(log.trace for log, _ in logs(ARM, "contact") if log.name == LOG)
    force = sensor()
    found = CollisionAlarm(fitted, 1.0, CONFIRMATION).detect(trace).alarms
    surface, _ = arm_surface(arm.file, fitted.arm.robot.joint_names)
    causes = Diagnoser.of(fitted.arm, surface, True).diagnose(trace, found)
    size = np.linalg.norm(force, axis=1)
    spans = sensor_spans(trace.t, size)
    rows = [row for cause in causes if (row := _beside(trace.t, size, cause)) is not None]
    limit = np.full(fitted.arm.robot.joints, np.inf)
    twin = fit_twin(fitted.arm, [log.trace for log in free], limit)
    rows += pushed(fitted.arm, twin.drive.friction, trace, force, spans)
    return [*rows, *_errors(rows)]


def sensor() -> Array:
    """Force of the log [N], in the sensor's frame, shape (T, 3)."""
    file = next(path for path in files(ARMS[ARM], "contact") if path.stem == LOG)
    table = np.genfromtxt(file, delimiter=",", names=True)
    return np.stack([table[f"F{axis}"] for axis in "xyz"], axis=1)


def _beside(t: Array, size: Array, cause: Diagnosis) -> Row | None:
    """A diagnosis beside the sensor's values; None if the sensor shows no push."""
    severity = cause.severity
    look = (t >= cause.since) & (t <= cause.until)
    if size[look].max() < BEGINS:
        return None
    peak, impulse = severity.peak, severity.impulse
    return {
        "study": "force",
        "alarm s": float(cause.alarm.start - t[0]),
        "sensor N": float(size[look].max()),
        "found N": peak.value,
        "low N": peak.low,
        "high N": peak.high,
        "sensor N s": float(np.trapezoid(size[look], t[look])),
        "found N s": impulse.value,
        "low N s": impulse.low,
        "high N s": impulse.high,
        "sensor s": float((size[look] > ENDS).mean() * (cause.until - cause.since)),
        "found s": severity.torque.seconds,
        "joint": int(np.abs(severity.torque.peak).argmax()) + 1,
    }


def pushed(
    arm: ArmModel,
    friction: Friction | None,
    trace: Trace,
    force: Array,
    spans: list[tuple[int, int]],
) -> list[Row]:
    """Change of the drives' torques in each push, of the arm and of the pushed twin."""
    from scipy.optimize import least_squares
    from scipy.spatial.transform import Rotation

    alone = modelled(arm, friction, np.ones(len(arm.drive_gain)), trace)
    measured, size = trace.current * arm.drive_gain, np.linalg.norm(force, axis=1)
    tops = [first + int(np.argmax(size[first:last])) for first, last in spans]
    quiet = [slice(f - round(BEFORE / trace.dt), f - 1) for f, _ in spans]
    seen, still = (
        np.array([x[top] - x[q].mean(axis=0) for top, q in zip(tops, quiet, strict=True)])
        for x in (measured, alone)
    )
    poses = [link_poses(arm.robot, trace.q[top]) for top in tops]
    last = np.array([arm.robot.joints - 1])
    jacobians = [point_jacobians(arm.robot, p, last, p.origin[-1:])[0] for p in poses]

    def simulated(turn: Array) -> Array:
        own = Rotation.from_rotvec(turn).as_matrix()
        torques = [
            j.T @ (p.rotation[-1] @ own @ force[top])
            for j, p, top in zip(jacobians, poses, tops, strict=True)
        ]
        return np.asarray(still - np.array(torques))

    scale = 1 + np.abs(seen).max(axis=0)
    fits = [
        least_squares(lambda x: ((simulated(x) - seen)[::2] / scale).ravel(), start, loss="soft_l1")
        for start in Rotation.random(8, random_state=0).as_rotvec()
    ]
    twin = simulated(min(fits, key=lambda fit: float(fit.cost)).x)
    rows: list[Row] = []
    for k, (first, _) in enumerate(spans):
        row: Row = {"study": "pushed twin", "at s": float(trace.t[first] - trace.t[0])}
        row |= {"sensor N": float(size[tops[k]]), "fitted": k % 2 == 0}
        for j in np.argsort(-np.abs(seen).max(axis=0))[:3]:
            row |= {f"arm {j + 1}": seen[k, j], f"twin {j + 1}": twin[k, j]}
        off = np.linalg.norm(seen[k] - twin[k]) / np.linalg.norm(seen[k])
        rows.append(row | {"missed": float(off)})
    return rows


def _errors(rows: list[Row]) -> list[Row]:
    """A row of medians for each of peak, impulse and the pushed twin."""
    own = [row for row in rows if row["study"] == "force"]
    force = np.array([row["sensor N"] for row in own])
    found: list[Row] = []
    for name, unit in (("peak", "N"), ("impulse", "N s")):
        truth, value, low, high = (
            np.array([row[f"{what} {unit}"] for row in own])
            for what in ("sensor", "found", "low", "high")
        )
        error = np.abs(value / truth - 1)
        row = _medians(name, error, force) | {
            "interval holds": int(((low <= truth) & (truth <= high)).sum()),
            "interval's width": float(np.median(high / low)),
        }
        found.append(row)
    test = [row for row in rows if row["study"] == "pushed twin" and not row["fitted"]]
    missed, force = (np.array([row[key] for row in test]) for key in ("missed", "sensor N"))
    return [*found, _medians("pushed twin", missed, force)]


def _medians(of: str, error: Array, force: Array) -> Row:
    row: Row = {"study": "errors", "of": of, "rows": len(error)}
    strong = error[force > STRONG]
    return row | {
        "median error": float(np.median(error)) if len(error) else None,
        f"above {STRONG:g} N": float(np.median(strong)) if len(strong) else None,
    }


def draw(rows: list[Row], figure: Any) -> None:
    """Peak forces found over the sensor's peaks, with intervals."""
    own = [row for row in rows if row["study"] == "force"]
    truth, value, low, high = (
        np.array([row[f"{what} N"] for row in own]) for what in ("sensor", "found", "low", "high")
    )
    axes = figure.subplots()
    axes.errorbar(truth, value, yerr=[value - low, high - value], fmt="o", capsize=3)
    ends = [0.0, 1.1 * float(high.max(initial=1.0))]
    axes.plot(ends, ends, color="0.7", lw=0.8)
    axes.set_xlabel("sensor's peak [N]")
    axes.set_ylabel("peak force found, 90 % interval [N]")
