"""``tauguard detect LOG``: collisions in the log of a real arm."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from tauguard.datasets import AS_IS, Reading
from tauguard.findings import ArgumentError

if TYPE_CHECKING:
    from tauguard import LogDetection

#: One number per joint; the help does not print the empty default.
PerJoint = Annotated[tuple[float, ...], tyro.conf.arg(help_behavior_hint="")]


def command(
    log: Annotated[Path, tyro.conf.Positional],
    /,
    robot: Path | None = None,
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
            file of `tauguard twin` (default: the robot in the model file).
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
    import tauguard as tg
    from tauguard.cli.output import print_findings
    from tauguard.cli.payload import load
    from tauguard.cli.read import read_one
    from tauguard.report import write_json

    if out is not None and out.exists() and not out.is_dir():
        raise ArgumentError(f"--out {out}: is a file; expected a folder")
    if model is not None and (quiet is not None or gains):
        raise ArgumentError(
            "--quiet and --gains cannot be combined with --model: they are for training"
        )
    carried = None if payload is None else load(payload)
    if model is not None:
        detector = tg.load_detector(model)
        read = read_one(log, robot or detector, columns, torque, reading)
        found = detector.detect(read, payload=carried, at_tool=at_tool)
    elif robot is None:
        raise ArgumentError("give --robot, or a --model, which has its robot in it")
    else:
        read = read_one(log, robot, columns, torque, reading)
        seconds = 20.0 if quiet is None else quiet
        found = tg.detect_after_quiet(
            read, quiet=seconds, gains=gains, payload=carried, at_tool=at_tool
        )
    print_findings(found.findings)
    print(found.text())
    if json is not None:
        write_json(json, found.to_dict())
    if out is not None:
        write_results(out, found)


def write_results(out: Path, found: LogDetection) -> None:
    """Write events.json, detect.mcap and detect.rrd into the folder ``out``."""
    from tauguard.replay import write_rrd
    from tauguard.report import write_json
    from tauguard.traces import write_mcap

    out.mkdir(parents=True, exist_ok=True)
    write_json(out / "events.json", found.to_dict())
    with found.robot_file() as robot:
        if robot is None:
            raise ArgumentError("--out needs --robot: the model file has no robot in it")
        trace = dataclasses.replace(found.trace, attachments={robot.name: robot.read_text()})
        write_mcap(out / "detect.mcap", trace, found.detection)
        write_rrd(out / "detect.rrd", trace, found.detection, robot)
    print(f"{out}: events.json, detect.mcap, detect.rrd (show it with: rerun {out}/detect.rrd)")
