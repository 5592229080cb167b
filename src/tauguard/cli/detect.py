"""``tauguard detect LOG``: collisions in the log of a real arm."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tauguard.datasets import ColumnMap
    from tauguard.datasets.drives import DriveNumbers
    from tauguard.detectors import Diagnosis
    from tauguard.detectors.real_arm.watch import Watch
    from tauguard.traces import Trace


def command(
    log: Annotated[Path, tyro.conf.Positional],
    /,
    robot: Path,
    columns: str | None = None,
    model: Path | None = None,
    quiet: float = 10.0,
    joints: tuple[int, ...] = (),
    gains: tuple[float, ...] = (),
    viscous: tuple[float, ...] = (),
    coulomb: tuple[float, ...] = (),
    observer_gain: float = 20.0,
    confirmation: float = 0.05,
    factor: float = 1.5,
    out: Path | None = None,
    json: Path | None = None,
) -> None:
    """Look for collisions in a log of joint positions, velocities and motor currents.

    With --model a trained detector watches the log. Without one, every joint's threshold is learned
    from the first --quiet seconds, in which nothing may touch the arm, and the rest is watched.

    Args:
        log: CSV file, or MCAP file with sensor_msgs/JointState (currents in effort).
        robot: URDF or MJCF file of the arm alone.
        columns: of a CSV file: a preset (ur10e, ur_rtde) or a JSON file with the fields of
            tauguard.datasets.ColumnMap, such as {"t": "time", "q": ["q1", "q2"], ...}.
        model: a detector that `tauguard train` wrote, for an arm and a rate like the log's.
        quiet: seconds from the beginning that you vouch for.
        joints: whose residuals are looked at, counted from 1 (default: the first four; a model
            brings its own).
        gains: N m per ampere, one a joint (known for the preset ur10e).
        viscous: friction in N m s/rad, one a joint.
        coulomb: friction in N m, one a joint.
        observer_gain: rate of the momentum observer in 1/s.
        confirmation: seconds above the threshold before an alarm.
        factor: threshold over the largest residual of the quiet seconds.
        out: folder for events.json, detect.mcap and detect.rrd.
        json: write the figures here as JSON.
    """
    from tauguard.benchmarks.report import write_json
    from tauguard.datasets import read_log
    from tauguard.detectors import RobotNumbers
    from tauguard.detectors.real_arm.watch import watch
    from tauguard.models import pin_model

    if out is not None and out.exists() and not out.is_dir():
        raise ValueError(f"--out {out}: is a file; expected a folder")
    read = read_log(log, column_map(columns))
    numbers = RobotNumbers.from_pin(pin_model(robot))
    trace = matched(read.trace, numbers.joint_names)
    said: Sequence[Diagnosis] = ()
    notes: tuple[str, ...] = ()
    if model is not None:
        detector, found = watched(model, trace)
        said, notes = explained(detector, trace, found, robot)
    else:
        drive = drive_numbers(columns, gains, viscous, coulomb, len(trace.joint_names))
        tau = drive.tau(trace.current, trace.qd)
        terms = {"gain": observer_gain, "confirmation": confirmation, "factor": factor}
        first_four = range(1, min(4, numbers.joints) + 1)
        found = watch(trace, numbers, tau, quiet, joints=joints or first_four, **terms)
    for note in (*read.notes, *found.notes, *notes):
        print(f"note: {note}")
    result = summary(log, trace, found, said)
    report(result)
    if json is not None:
        write_json(json, result)
    if out is not None:
        leave(out, trace, found, result, robot)


def watched(model: Path, trace: Trace) -> tuple[Any, Watch]:
    """The detector of a model file, of any kind that ``tauguard train`` writes, and what it saw."""
    from tauguard.detectors import load_model
    from tauguard.detectors.real_arm.free_motion_file import is_free_motion, load_free_motion
    from tauguard.detectors.real_arm.watch import watch_free, watch_with

    if is_free_motion(model):
        free = load_free_motion(model)
        return free, watch_free(free, trace)
    detector = load_model(model)
    return detector, watch_with(detector, trace)


def column_map(columns: str | None) -> ColumnMap | str | None:
    """A preset's name as it is; a map from a JSON file."""
    if columns is None or not columns.endswith(".json"):
        return columns
    import json

    from tauguard.datasets import ColumnMap

    try:
        fields = json.loads(Path(columns).read_text())
    except json.JSONDecodeError as error:
        raise ValueError(f"{columns}: not JSON ({error})") from error
    known = [field.name for field in dataclasses.fields(ColumnMap)]
    if not isinstance(fields, dict) or set(fields) - set(known):
        raise ValueError(f"{columns}: expected an object with some of {', '.join(known)}")
    fields = {k: tuple(v) if isinstance(v, list) else v for k, v in fields.items()}
    if "repair" in fields:
        fields["repair"] = frozenset(fields["repair"])
    try:
        return ColumnMap(**fields)
    except TypeError as error:
        raise ValueError(f"{columns}: {error}") from error


def matched(trace: Trace, names: tuple[str, ...]) -> Trace:
    """The trace with the robot's joints in the robot's order.

    Raises:
        ValueError: joints that do not match.
    """
    given = trace.joint_names
    if len(given) != len(names):
        raise ValueError(
            f"the log has {len(given)} joints ({', '.join(given)}), "
            f"the robot {len(names)} ({', '.join(names)})"
        )
    if given == tuple(f"joint_{i}" for i in range(1, len(given) + 1)) or given == names:
        return dataclasses.replace(trace, joint_names=names)
    if set(given) != set(names):
        raise ValueError(f"the log's joints are {', '.join(given)}, the robot's {', '.join(names)}")
    order = [given.index(name) for name in names]
    tables = ("q", "qd", "current", "q_des", "qd_des", "qdd_des")
    moved: dict[str, Any] = {
        name: getattr(trace, name)[:, order] for name in tables if getattr(trace, name) is not None
    }
    return dataclasses.replace(trace, joint_names=names, **moved)


def drive_numbers(
    columns: str | None,
    gains: tuple[float, ...],
    viscous: tuple[float, ...],
    coulomb: tuple[float, ...],
    joints: int,
) -> DriveNumbers:
    """The user's numbers, or those of the preset.

    Raises:
        ValueError: no gains, or not one a joint.
    """
    from tauguard.datasets.drives import DRIVES, DriveNumbers

    preset = DRIVES.get(columns or "")
    if not gains and preset is None:
        raise ValueError(f"--gains: give {joints} numbers, N m of joint torque per ampere")
    if not gains and preset is not None:
        gains = preset.gain
        viscous, coulomb = viscous or preset.viscous, coulomb or preset.coulomb
    if len(gains) != joints:
        raise ValueError(f"--gains: {len(gains)} numbers for {joints} joints")
    return DriveNumbers(gains, viscous, coulomb)


def explained(
    detector: Any, trace: Trace, found: Watch, robot: Path
) -> tuple[Sequence[Diagnosis], tuple[str, ...]]:
    """What each alarm was, where the robot's file has shapes to look for a contact on."""
    from tauguard.detectors import diagnose
    from tauguard.models import link_surface

    try:
        surface = link_surface(robot)
    except ValueError:
        return (), (f"{robot.name} has no collision shapes: links and forces are not looked for",)
    return diagnose(detector, trace, found.detection, surface), ()


def summary(
    log: Path, trace: Trace, found: Watch, said: Sequence[Diagnosis] = ()
) -> dict[str, Any]:
    """The figures of a run, ready for JSON."""
    import numpy as np

    from tauguard.detectors import poisson_rate
    from tauguard.detectors.real_arm.watch import loudest_joint

    watched = float(trace.t[-1] - found.quiet_until)
    events: list[dict[str, Any]] = []
    for alarm in found.detection.alarms:
        joint = loudest_joint(found, alarm.start, alarm.end)
        name = trace.joint_names[joint]
        events.append({"start": alarm.start, "end": alarm.end, "joint": name})
    for event, one in zip(events, said, strict=False):
        event |= {
            "kind": one.kind,
            "kinds": one.kinds,
            "link": one.link,
            "links": one.links.tolist(),
            "force_n": one.force.tolist(),
            "point_m": one.point.tolist(),
            "payload_kg": None if one.collision else one.signs.mass,
        }
    return {
        "name": "detect",
        "log": log.name,
        "joints": list(trace.joint_names),
        "seconds": float(trace.t[-1] - trace.t[0]),
        "watched_seconds": watched,
        "detector": found.detection.detector,
        "score_threshold": found.detection.threshold,
        "thresholds_nm": [v if np.isfinite(v) else None for v in found.thresholds.tolist()],
        "alarms": len(events),
        "alarms_per_hour": 3600 * len(events) / watched,
        "alarms_per_hour_high": poisson_rate(len(events), watched / 3600)["high"],
        "events": events,
    }


def report(result: dict[str, Any]) -> None:
    """The figures for a reader."""
    pairs = zip(result["joints"], result["thresholds_nm"], strict=True)
    used = [f"{name} {value:.1f} N m" for name, value in pairs if value is not None]
    if result["detector"] == "threshold":
        print("thresholds: " + ", ".join(used))
    else:
        print(f"{result['detector']}: score above {result['score_threshold']:.3f} is an alarm")
    for event in result["events"]:
        line = f"alarm {event['start']:.3f} s to {event['end']:.3f} s, most on {event['joint']}"
        print(line + what(event))
    print(
        f"{result['alarms']} alarms in {result['watched_seconds']:.1f} s watched; in a log without "
        "collisions each of them is a false one, at most "
        f"{result['alarms_per_hour_high']:.0f} per hour (95 %)"
    )


def what(event: dict[str, Any]) -> str:
    """What an alarm was, if that is known."""
    if "kind" not in event:
        return ""
    if event["payload_kg"] is not None:
        return f": payload changed by {event['payload_kg']:+.2f} kg, no collision"
    force = sum(value**2 for value in event["force_n"]) ** 0.5
    likely = event["links"][event["link"] - 1]
    return f": {event['kind']}, {force:.0f} N on link {event['link']} (probability {likely:.2f})"


def leave(out: Path, trace: Trace, found: Watch, result: dict[str, Any], robot: Path) -> None:
    """Write events, MCAP and recording into the folder ``out``."""
    from tauguard.benchmarks.report import write_json
    from tauguard.replay import write_rrd
    from tauguard.traces import write_mcap

    out.mkdir(parents=True, exist_ok=True)
    trace = dataclasses.replace(trace, attachments={robot.name: robot.read_text()})
    write_json(out / "events.json", result)
    write_mcap(out / "detect.mcap", trace, found.detection)
    write_rrd(out / "detect.rrd", trace, found.detection, robot)
    print(f"{out}: events.json, detect.mcap, detect.rrd (show it with: rerun {out}/detect.rrd)")
