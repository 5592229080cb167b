"""``tauguard calibrate LOGS --robot FILE``: a calibrated robot file from collision-free logs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from tauguard.datasets.columns import AS_IS, Reading
from tauguard.findings import ArgumentError

if TYPE_CHECKING:
    from tauguard.arrays import Array
    from tauguard.cli.free_logs import FreeLogs
    from tauguard.detectors.calibration.identification import Identified

#: Below this torque per unit of the current columns [N m/A], the columns probably hold torques.
SMALL_GAIN = 2.0
SOURCES = {
    "torques": "the logs' torques",
    "gains": "the gains that were given",
    "preset": "the gains of the preset",
    "payload": "the known payload",
    "masses": "the robot file's masses",
}


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
    import numpy as np

    from tauguard.cli.free_logs import free_logs, run_check
    from tauguard.detectors.calibration.arm_file import save_arm
    from tauguard.detectors.evaluation.acceptance import check_held_out
    from tauguard.detectors.features.free_bound import SHOWN_SECONDS, motion_seconds
    from tauguard.detectors.features.motion_regimes import exceeded
    from tauguard.models.robot import bodies_file
    from tauguard.report import write_json

    beside = robot if robot.exists() else Path(robot.name)  # a named arm: the working folder
    robot = bodies_file(robot)
    if gains and scale in ("masses", "payload"):
        raise ArgumentError(
            f"--gains cannot be combined with --scale {scale}, which finds the gains"
        )
    given = free_logs(logs, robot, columns, gains, payload, torque, scale, reading)
    found, held = identified(given, accept)
    names, recordings = list(given.logs), list(given.logs.values())
    logs_of = (found.arm, names, recordings)
    run_check("error", accept, lambda: check_held_out(*logs_of, held))
    target = out or beside.with_name(f"{beside.stem}.calibrated{robot.suffix}")
    save_arm(found.arm, robot, target, scale=given.scale, logs=names)
    preset = recordings[0].trace.meta.get("columns", "")
    result = summary(names, found, held, target) | {"scale": given.source}
    speeds = [(one.trace.t, np.abs(one.trace.qd)) for one in recordings]
    result["speed_rad_s"] = exceeded(speeds).tolist()
    result["moves"] = (motion_seconds(recordings) >= SHOWN_SECONDS).tolist()
    report(result, found, preset)
    if json is not None:
        write_json(json, result)


def identified(given: FreeLogs, accept: tuple[str, ...]) -> tuple[Identified, list[Array]]:
    """The calibrated arm, and each log's residual RMS with a calibration from the other logs [N m].

    Each RMS has shape (n,). With too few logs to leave one out, the list is empty.

    Raises:
        ArgumentError: exchanged joints, bodies other than those of the robot file, a wrong load, or
            bursts of torque, unless ``accept`` names the check.
    """
    from tauguard.cli.free_logs import explain, run_check
    from tauguard.cli.help_text import print_notes
    from tauguard.detectors.calibration.assessment import check_loads, left_out
    from tauguard.detectors.calibration.checks import check_order, check_weight, torque_per_ampere
    from tauguard.detectors.calibration.identification import filtered_logs, identify
    from tauguard.detectors.calibration.recording import each_can_be_left_out
    from tauguard.detectors.features.motion_regimes import unseen_motion

    arm, recordings = given.arm, list(given.logs.values())
    traces = [recording.trace for recording in recordings]
    run_check("order", accept, lambda: check_order(arm, given.logs))
    data = filtered_logs(arm, recordings) if given.scale == "gains" else None
    found = identify(arm, recordings, scale=given.scale, data=data)
    if data is not None:
        weight = (given.numbers, found.arm.robot, traces)
        run_check("gravity", accept, lambda: check_weight(*weight))
        check_loads(arm, given.logs, data)
    elif (ratio := torque_per_ampere(found.arm, traces)) < SMALL_GAIN:
        print(
            f"note: one unit of the current columns gives {ratio:.1f} N m, so the columns may hold "
            "joint torques; if they do, add --torque"
        )
    held: list[Array] = []
    if each_can_be_left_out(recordings):
        held = left_out(arm, recordings, scale=given.scale, data=data)
    print_notes(unseen_motion(list(given.all_traces.values())))
    explain(found.arm, given.logs, held, accept)
    return found, held


def summary(names: list[str], found: Identified, held: list[Array], target: Path) -> dict[str, Any]:
    """The results, as JSON values."""
    return {
        "name": "calibrate",
        "robot": str(target),
        "joints": list(found.arm.robot.joint_names),
        "scale": found.scale,
        "drive_gain": found.arm.drive_gain.tolist(),
        "gain_relative_sd": found.gain_error.tolist(),
        "mass": found.arm.robot.inertial[:, 0].tolist(),
        "armature": found.arm.robot.armature.tolist(),
        "rms_nm": found.rms.tolist(),
        "held_out_rms_nm": {n: r.tolist() for n, r in zip(names, held, strict=False)},
        "loads_kg": dict(zip(names, found.loads[:, 0].tolist(), strict=True)),
        "notes": list(found.notes),
    }


def report(result: dict[str, Any], found: Identified, preset: str) -> None:
    """Print the results. For a joint that moves in no log, print only gain and mass.

    The output names ``preset`` if the gains are those of the preset.
    """
    from tauguard.cli.help_text import print_notes
    from tauguard.report import table

    source = SOURCES[result["scale"]] + (f" {preset}" if result["scale"] == "preset" else "")
    print(f"scale of the torques: from {source}")
    held = result["scale"] if result["scale"] in ("preset", "torques") else "given"
    rows = []
    linear = found.arm.robot.prismatic
    for k, name in enumerate(result["joints"]):
        spread = result["gain_relative_sd"][k]
        moved = {
            "rotor kg m2": f"{result['armature'][k]:.3f}",
            "rms N m": f"{result['rms_nm'][k]:.2f}",
            "up to rad/s": f"{result['speed_rad_s'][k]:.2f}",
        }
        rows.append(
            {
                "joint": f"{name} (linear: N, m, kg)" if linear[k] else name,
                "gain N m/A": f"{result['drive_gain'][k]:.2f}",
                "+-": f"{100 * spread:.0f} %" if spread else held,
                "mass kg": f"{result['mass'][k]:.2f}",
                **(moved if result["moves"][k] else dict.fromkeys(moved, "-")),
            }
        )
    print(table(rows))
    held_out = []
    for name, rms in result["held_out_rms_nm"].items():
        load = result["loads_kg"][name]
        carried = f"{load:.2f} kg" if abs(load) > 0.01 else ""
        units = [
            f"{j} [{'N' if on else 'N m'}]" for j, on in zip(result["joints"], linear, strict=True)
        ]
        values = {j: f"{v:.2f}" for j, v in zip(units, rms, strict=True)}
        held_out.append({"held out, rms": name, "predicted without its load": carried} | values)
    if held_out:
        print(table(held_out))
    print_notes(found.notes)
    print(f"{result['robot']}: written")
