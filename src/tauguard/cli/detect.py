"""``tauguard detect LOG``: collisions in the log of a real arm."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from tauguard.datasets.columns import AS_IS, Reading
from tauguard.findings import ArgumentError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tauguard.detectors import CollisionAlarm, Diagnosis, RobotNumbers
    from tauguard.detectors.alarms.log_detection import LogDetection
    from tauguard.detectors.diagnosis.severity import ContactTorque, Interval90
    from tauguard.traces import Log, Trace


#: One number per joint; the help does not print the empty default.
PerJoint = Annotated[tuple[float, ...], tyro.conf.arg(help_behavior_hint="")]
#: Meaning of each kind of contact.
KINDS = {
    "transient": "the contact is over",
    "clamp": "it lasts, and the force was against the motion or rose fast",
    "push": "it lasts, and the force was along the motion or rose slowly",
}
#: Below this time, the output says that almost nothing of the log was watched [s].
WATCHED = 1.0
#: Without a model, the detector is trained on this length of the log's beginning [s].
QUIET = 20.0


def command(
    log: Annotated[Path, tyro.conf.Positional],
    /,
    robot: Path,
    columns: str | None = None,
    model: Path | None = None,
    payload: str | None = None,
    torque: bool = False,
    at_tool: bool = False,
    quiet: float | None = None,
    gains: PerJoint = (),
    out: Path | None = None,
    reading: Annotated[Reading, tyro.conf.arg(name="")] = AS_IS,
    json: Path | None = None,
) -> None:
    """Look for collisions in a log of joint positions, velocities and motor currents.

    With --model a trained detector runs on the log. Its states are those of `tauguard listen`:
    free, collision, or fault if the samples are wrong (frozen, missing, of another arm). Without a
    model, the detector of `tauguard train --free` is trained on the first --quiet seconds, in which
    nothing may touch the arm, and then runs on the rest of the log. `tauguard train --free` itself
    uses whole logs and makes a better detector.

    A column called label, contact, collision or touch with the values 0 and 1 is the ground truth.
    The output then states which contacts were detected, the delays, and the false alarms.

    A log is refused if its motion does not explain its torques, for example because currents have a
    wrong unit or sign. A note names joints whose columns seem exchanged or negated.

    Args:
        log: CSV file, or MCAP file with sensor_msgs/JointState (currents in effort).
        robot: URDF or MJCF file of the arm alone, a name that `tauguard robot` lists, or the TOML
            file of `tauguard twin`.
        columns: columns of a CSV file: a preset (ur10e, ur_rtde, ur5, ur3, franka, libfranka,
            doosan, lbr), auto to find them from names and values, or a JSON file with the fields
            of tauguard.datasets.ColumnMap, such as {"t": "time", "q": ["q1", "q2"],
            "torque": ["tau1", "tau2"]}; a number instead of a name is the column's index from 0.
        model: a model file of `tauguard train` for this arm and the log's sample rate.
        payload: load that the arm carries, as KG or KG,X,Y,Z (centre in the last link's frame, m);
            0 for no load. It cannot be combined with a model from `train --traces`. Without this
            flag the load is estimated from the motion; before, only hard contacts are detected.
        torque: the log holds joint torques in N m, see `tauguard calibrate`.
        at_tool: all contacts are at the tool, which narrows the intervals of the forces.
        quiet: without --model, length of the log's beginning in which nothing touches the arm [s]
            (default: 20). A collision in this time raises the thresholds, so that later collisions
            may be missed.
        gains: without --model, N m per ampere, one number for each joint (not needed for
            calibrated robot files and for the presets ur10e and ur5).
        out: folder for events.json, detect.mcap and detect.rrd.
        reading: how logs are read.
        json: write the results here as JSON.
    """
    from tauguard import read_log
    from tauguard.cli.help_text import print_notes
    from tauguard.detectors.alarms.log_detection import detect_in_log
    from tauguard.detectors.evaluation.labelled_log import compare_with_labels
    from tauguard.models.robot import bodies_file
    from tauguard.report import write_json

    if out is not None and out.exists() and not out.is_dir():
        raise ArgumentError(f"--out {out}: is a file; expected a folder")
    if model is not None and (quiet is not None or gains):
        raise ArgumentError(
            "--quiet and --gains cannot be combined with --model: they are for training"
        )
    robot = bodies_file(robot)
    options = {"torque": torque, "mend": reading.mend, "resample": reading.resample}
    read = read_log(log, columns, robot=robot, **options)  # type: ignore[arg-type]
    print_notes(read.findings)
    numbers = read.numbers
    if model is not None:
        trace, alarm = trained(model, log.name, read, payload, robot, numbers)
    else:
        seconds = QUIET if quiet is None else quiet
        refuse_touched(log, read, seconds)
        trace, alarm = trained_on_beginning(log, read, robot, numbers, seconds, gains, payload)
    found = detect_in_log(alarm, trace, payload is not None)
    causes, notes = diagnosed(alarm.detector, trace, found, robot, at_tool, payload is not None)
    print_notes((*found.notes, *notes))
    result = summary(log, trace, found, causes)
    if read.labels is not None:
        begin, end = found.begin, float(trace.t[-1])
        result["labels"] = compare_with_labels(found.detection.alarms, read.labels, begin, end)
    report(result)
    if json is not None:
        write_json(json, result)
    if out is not None:
        write_results(out, trace, found, result, robot)


def refuse_touched(log: Path, read: Log, quiet: float) -> None:
    """Raise ``ArgumentError`` if labels mark a contact in the first ``quiet`` seconds."""
    begin = read.trace.t[0]
    early = [start - begin for start, _ in read.labels or () if start < begin + quiet]
    if early:
        raise ArgumentError(
            f"{log}: a column labels a contact {early[0]:.2f} s after the beginning, within the "
            f"first {quiet:g} s (--quiet), on which the detector is trained; give a "
            "shorter --quiet, or a --model"
        )


def trained(
    model: Path, log: str, read: Log, payload: str | None, robot: Path, numbers: RobotNumbers
) -> tuple[Trace, CollisionAlarm]:
    """The log in the joint order of a trained detector, and the detector.

    A note names joints whose columns do not fit the detector's arm.
    """
    from tauguard.cli.help_text import print_notes
    from tauguard.cli.payload import load
    from tauguard.datasets.arm_logs import load_of
    from tauguard.datasets.real_arms import check_robot
    from tauguard.detectors import load_model
    from tauguard.detectors.alarms.training import carrying
    from tauguard.detectors.calibration.checks import check_order, check_signs
    from tauguard.detectors.calibration.joints import is_torque, linear_axes, matched
    from tauguard.detectors.calibration.recording import Load, Recording

    alarm = load_model(model)
    if payload is not None:
        alarm = carrying(alarm, load_of(load(payload)) or Load())
    arm = alarm.detector.arm
    check_robot(numbers, robot, arm.robot, model)
    trace = matched(read.trace, arm.robot.joint_names)
    print_notes(linear_axes(arm.robot, {log: read}))
    if is_torque(trace) and not (arm.drive_gain == 1).all():
        raise ArgumentError(f"the log holds torques, {model} was trained on currents")
    for check in (check_signs, check_order):
        try:
            check(arm, {log: Recording(trace)})
        except ValueError as error:
            print_notes([str(error)])
            break
    return trace, alarm


def trained_on_beginning(
    log: Path,
    read: Log,
    robot: Path,
    numbers: RobotNumbers,
    quiet: float,
    gains: tuple[float, ...],
    payload: str | None,
) -> tuple[Trace, CollisionAlarm]:
    """The log in the robot's joint order, and a detector trained on the log's beginning."""
    import numpy as np

    from tauguard.cli.free_logs import free_arm, free_detector
    from tauguard.cli.help_text import print_notes
    from tauguard.cli.payload import load
    from tauguard.datasets.arm_logs import load_of
    from tauguard.detectors.alarms.training import free_alarm
    from tauguard.detectors.calibration.joints import linear_axes, matched, of_log
    from tauguard.detectors.calibration.recording import Load, Recording, cut

    numbers, held = of_log(numbers, read.trace.joint_names, robot)
    print_notes((*held, *linear_axes(numbers, {log.name: read})))
    trace = matched(read.trace, numbers.joint_names)
    length = float(trace.t[-1] - trace.t[0])
    if not 0 < quiet < length:
        raise ArgumentError(
            f"--quiet {quiet:g}: expected above 0 and below the log's {length:.1f} s; or train on "
            "logs of free motion (`tauguard train --free`) and give --model"
        )
    rows = int(np.searchsorted(trace.t, trace.t[0] + quiet))
    carried = Load() if payload is None else load_of(load(payload)) or Load()
    first = {log.name: Recording(cut(trace, slice(0, rows)), carried)}
    try:
        arm, source = free_arm(robot, numbers, first, gains)
        detector = free_detector(arm, first)
    except ValueError as error:
        raise ArgumentError(
            f"{log}, its first {quiet:g} s (--quiet): {error}; or did something touch the arm in "
            "this time? If not, train with `tauguard train --free`, which has --accept"
        ) from None
    print_notes([f"trained on the first {quiet:g} s; gains: {source}"])
    detector = dataclasses.replace(detector, settle=quiet)
    detector = detector if payload is None else detector.carrying(carried)
    return trace, free_alarm(detector, [first[log.name].trace])


def diagnosed(
    detector: Any,
    trace: Trace,
    found: LogDetection,
    robot: Path,
    at_tool: bool = False,
    load_known: bool = False,
) -> tuple[list[dict[str, Any]], tuple[str, ...]]:
    """Diagnoses of alarms (torques only, if ``robot`` is no chain of links), and notes."""
    from tauguard.detectors import Diagnoser
    from tauguard.detectors.diagnosis.post_alarm import PostAlarmWindows
    from tauguard.detectors.diagnosis.severity import ContactTorque
    from tauguard.models import arm_surface

    alarms = found.detection.alarms
    if not alarms:
        return [], ()
    try:
        surface, sticks = arm_surface(robot, detector.arm.robot.joint_names)
    except ValueError as error:
        looked = PostAlarmWindows(detector.arm, detector.arm.noise_model, trace)
        contact_torque = [ContactTorque.of(looked.at(alarm.start)) for alarm in alarms]
        return [
            {"summary": one.text(trace.joint_names), **torques(one)} for one in contact_torque
        ], (f"{error}: links and forces are not estimated",)
    notes: tuple[str, ...] = ()
    if sticks:
        notes = (
            f"{robot.name}: no shape found of {', '.join(sticks)}: thin capsules replace them "
            "when link and force are estimated. Put the meshes into the file's folder or a "
            "folder above it for better results",
        )
    found_causes = Diagnoser.of(detector.arm, surface, at_tool, load_known).diagnose(trace, alarms)
    return [cause(one) for one in found_causes], notes


def torques(contact_torque: ContactTorque) -> dict[str, Any]:
    """Duration, peak torques and impulses of a contact at the joints, as JSON values."""
    return {
        "contact_s": contact_torque.seconds,
        "contact_goes_on": contact_torque.goes_on,
        "peak_torque_nm": contact_torque.peak.tolist(),
        "joint_impulse_nms": contact_torque.impulse.tolist(),
    }


def cause(one: Diagnosis) -> dict[str, Any]:
    """A diagnosis, as JSON values."""

    def interval(value: Interval90) -> dict[str, Any]:
        return {**dataclasses.asdict(value), "identifiable": value.identifiable}

    return {
        "summary": one.summary,
        "kind": one.kind,
        "kinds": one.kinds,
        "link": one.link,
        "link_identifiable": one.link_identifiable,
        "links": one.links.tolist(),
        "force_n": one.force.tolist(),
        "point_m": one.point.tolist(),
        "impulse_ns": interval(one.severity.impulse),
        "peak_force_n": interval(one.severity.peak),
        **torques(one.severity.torque),
        "payload_kg": None if one.collision else one.signs.mass,
    }


def summary(
    log: Path, trace: Trace, found: LogDetection, causes: Sequence[dict[str, Any]] = ()
) -> dict[str, Any]:
    """The results of a run, as JSON values."""

    from tauguard.detectors import poisson_rate
    from tauguard.detectors.alarms.log_detection import most_changed_joint

    whole = float(trace.t[-1] - found.begin)
    watched = max(whole - found.fault_seconds - found.unwatched_seconds, 0.0)
    hours = max(watched, trace.dt) / 3600
    events: list[dict[str, Any]] = []
    for alarm in found.detection.alarms:
        joint = most_changed_joint(found, alarm.start, alarm.end)
        name = trace.joint_names[joint]
        events.append({"start": alarm.start, "end": alarm.end, "joint": name})
    if causes:
        for event, one in zip(events, causes, strict=True):
            event |= one
    return {
        "name": "detect",
        "log": log.name,
        "joints": list(trace.joint_names),
        "begin": float(trace.t[0]),
        "seconds": float(trace.t[-1] - trace.t[0]),
        "watched_seconds": watched,
        "detector": found.detection.detector,
        "score_threshold": found.detection.threshold,
        "faults": [{"start": f.start, "end": f.end, "reason": f.reason} for f in found.faults],
        "fault_seconds": found.fault_seconds,
        "unwatched_seconds": found.unwatched_seconds,
        "alarms": len(events),
        "alarms_per_hour": len(events) / hours,
        "alarms_per_hour_high": poisson_rate(len(events), hours)["high"],
        "events": events,
    }


def report(result: dict[str, Any]) -> None:
    """Print the results as text."""
    from tauguard.detectors.diagnosis.post_alarm import AFTER
    from tauguard.detectors.evaluation.card_page import printed_from, rate_text
    from tauguard.detectors.evaluation.labelled_log import labels_text

    print(f"{result['detector']}: score above {result['score_threshold']:.3f} is an alarm")
    since = printed_from(result["begin"])
    if since and (result["events"] or result["faults"]):
        print(f"times count from the log's first sample, at {since:.3f} s")
    for event in result["events"]:
        start, end = event["start"] - since, event["end"] - since
        line = f"alarm {start:.3f} s to {end:.3f} s, most on {event['joint']}"
        print(f"{line}: {event['summary']}" if event.get("summary") else line)
    said = {event.get("kind") for event in result["events"]}
    if meanings := [f"{kind}: {KINDS[kind]}" for kind in KINDS if kind in said]:
        print(f"kinds of contact, {AFTER:g} s or more after an alarm begins: {'; '.join(meanings)}")
    for fault in result["faults"]:
        start, end = fault["start"] - since, fault["end"] - since
        print(f"fault {start:.3f} s to {end:.3f} s: {fault['reason']}")
    if result["fault_seconds"]:
        print(f"faults hide collisions in {result['fault_seconds']:.2f} s of this log")
    count, seconds = result["alarms"], result["watched_seconds"]
    text = f"{count} alarm{'' if count == 1 else 's'} in {seconds:.1f} s watched"
    if labels := result.get("labels"):
        print(f"{text}\n{labels_text(labels, since)}")
        return
    if seconds < WATCHED:
        print(f"{text}: almost nothing of this log was watched")
        return
    most = rate_text(result["alarms_per_hour_high"], seconds, ": at most {} per hour (95 %)")
    false = "; if nothing touched the arm, each is a false alarm" if count else ""
    print(f"{text}{false}{most}")


def write_results(
    out: Path, trace: Trace, found: LogDetection, result: dict[str, Any], robot: Path
) -> None:
    """Write events.json, detect.mcap and detect.rrd into the folder ``out``."""
    from tauguard.replay import write_rrd
    from tauguard.report import write_json
    from tauguard.traces import write_mcap
    from tauguard.untrusted_input import read_text

    out.mkdir(parents=True, exist_ok=True)
    trace = dataclasses.replace(trace, attachments={robot.name: read_text(robot)})
    write_json(out / "events.json", result)
    write_mcap(out / "detect.mcap", trace, found.detection)
    write_rrd(out / "detect.rrd", trace, found.detection, robot)
    print(f"{out}: events.json, detect.mcap, detect.rrd (show it with: rerun {out}/detect.rrd)")
