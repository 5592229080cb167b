"""``tauguard calibrate LOGS --robot FILE``: a calibrated robot file from collision-free logs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import tyro

from tauguard.datasets import AS_IS, Reading


def command(
    logs: Annotated[tuple[Path, ...], tyro.conf.Positional],
    /,
    robot: Path,
    out: Path | None = None,
    columns: str | None = None,
    gains: tuple[float, ...] = (),
    payload: tuple[str, ...] = (),
    scale: Literal["auto", "gains", "payload", "masses"] = "auto",
    torque: bool = False,
    accept: tuple[Literal["alarms", "error", "gravity", "order"], ...] = (),
    reading: Annotated[Reading, tyro.conf.arg(name="")] = AS_IS,
    json: Path | None = None,
) -> None:
    """Identify friction, inertia and drive gains from logs in which nothing touched the arm.

    Logs with currents do not determine the drive gains. These come from --gains if given, else from
    a log with a known --payload, else from a preset of the columns, else from the robot file's
    masses; the output states which. For cross-validation, each log is predicted by a calibration
    from the other logs.

    Args:
        logs: CSV or MCAP files, or a folder of them; at least 10 s of motion, better two minutes.
        robot: URDF or MJCF file of the arm alone, or a name that `tauguard robot` lists.
        out: the calibrated robot file (default: beside ROBOT, with .calibrated in its name).
        columns: columns of CSV files: a preset, auto, or a JSON file (see `tauguard detect`).
        gains: N m per ampere, one number for each joint.
        payload: loads that were carried, as LOG=KG, LOG=KG,X,Y,Z (centre in the last link's frame,
            m) or LOG=unknown; LOG is a file's name, with or without .csv. Other logs are assumed to
            have no load.
        scale: source of the drive gains.
        torque: the logs hold joint torques in N m instead of currents, as ROS 2 efforts may. A
            JSON file of columns states this by its field "torque" instead.
        accept: write the file although a check fails. alarms: a log has bursts of torque like those
            of contacts. error: a joint's prediction error exceeds twice the joint's friction.
            gravity: the gravity torques differ from those of the robot file. order: two joints'
            columns seem exchanged.
        reading: how logs are read.
        json: write the results here as JSON.
    """
    import tauguard as tg
    from tauguard.cli.output import print_findings
    from tauguard.cli.read import read_free
    from tauguard.report import write_json

    free = read_free(logs, robot, columns, payload, torque, reading)
    arm = tg.calibrate(free, gains=gains, scale=scale, accept=accept)
    beside = robot if robot.exists() else Path(robot.name)  # a named arm: the working folder
    source = free.robot or robot
    target = arm.save(out or beside.with_name(f"{beside.stem}.calibrated{source.suffix}"))
    print_findings(arm.findings)
    print(f"{arm.text()}\n{target}: written")
    if json is not None:
        write_json(json, {"name": "calibrate", "robot": str(target), **arm.to_dict()})
