"""``tauguard speed PROGRAM``: how fast a robot may move along a program beside a person."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro


def command(
    program: Annotated[Path, tyro.conf.Positional],
    /,
    robot: str,
    columns: str | None = None,
    tool: str = "flat:1.0",
    tool_mass: float = 0.5,
    tool_length: float = 0.1,
    detector: Path | None = None,
    delay: float | None = None,
    stop: Literal[0, 1, 2] = 2,
    deceleration: float = 10.0,
    stop_from: Literal["set_point", "measured"] = "set_point",
    retract: bool = False,
    cover: str | None = None,
    contact: tuple[str, ...] = (),
    limits: Path | None = None,
    person_speed: float = 0.0,
    margin: float = 1.0,
    check: bool = True,
    table: Path | None = None,
    picture: Path | None = None,
    report: Path | None = None,
    json: Path | None = None,
) -> None:
    """How fast a robot may move along a program beside a person: an estimate.

    For each segment of motion and each body region, the command finds the speed at which the first
    peak of the contact force, the force that lasts and the pressure stay within the limits of
    ISO/TS 15066, at the worst point of the arm and in the worst direction. With --detector the stop
    begins at your own detector's alarm. The most binding cases are simulated in MuJoCo.

    Args:
        program: a log (as in `tauguard detect`), or a CSV of waypoints with the columns t, q1, q2,
            ... [s, rad].
        robot: name of an arm that `tauguard robot` lists, or a robot file.
        columns: columns of a CSV log, see `tauguard detect`.
        tool: the face that touches: flat:AREA_CM2, sphere:RADIUS_MM or edge:WIDTHxLENGTH in mm.
        tool_mass: mass of the tool with the part that it holds [kg].
        tool_length: distance of the face from the flange [m].
        detector: a model file of `tauguard train`; the program must then be a log with currents.
        delay: in place of a detector, time from the first touch to the stop [s].
        stop: category of the stop (IEC 60204-1).
        deceleration: of every joint in the stop [rad/s2].
        stop_from: set_point: the reference slows down along the path; measured: it first jumps to
            the arm's position.
        retract: go back after the stop.
        cover: soft cover of the arm: STIFFNESS:THICKNESS in N/mm and mm, such as 5:20.
        contact: REGION=free for regions that can always move away (default: clamped).
        limits: TOML file with other limits for body regions.
        person_speed: speed of the person towards the robot, for free contact [m/s].
        margin: keep forces and pressures below the limits over this factor.
        check: simulate the most binding cases in MuJoCo.
        table: write all rows here (CSV).
        picture: draw speeds along the program here (PNG, SVG or PDF).
        report: write a printable page here (HTML).
        json: write the results here as JSON.
    """
    import tauguard
    from tauguard.findings import as_flags
    from tauguard.models import BODY_REGIONS, read_regions
    from tauguard.report import write_json
    from tauguard.speed import Stop, Tool, read_waypoints

    motion = read_waypoints(program) if columns is None and program.suffix == ".csv" else None
    result = tauguard.speed_limits(
        motion or tauguard.read_log(program, columns, robot=robot),
        robot,
        tool=Tool.parse(tool, tool_mass, tool_length),
        stop=Stop(stop, deceleration, stop_from, retract),
        delay=delay,
        detector=None if detector is None else tauguard.load_detector(detector),
        cover=cover,
        contact=dict(pair.partition("=")[::2] for pair in contact),
        regions=BODY_REGIONS if limits is None else read_regions(limits),
        person_speed=person_speed,
        margin=margin,
        check=check,
    )
    print(as_flags(result.text()))
    if table is not None:
        write_rows(table, result.rows())
    if picture is not None:
        result.plot().savefig(picture)
    if report is not None:
        result.write_page(report)
    if json is not None:
        write_json(json, result.to_dict())


def write_rows(path: Path, rows: list[dict[str, Any]]) -> None:
    """Write rows as CSV."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]) if rows else [])
        writer.writeheader()
        writer.writerows(rows)
