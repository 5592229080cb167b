"""``tauguard twin LOGS --robot FILE``: a simulated arm that behaves like the arm in the logs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from tauguard.datasets.columns import AS_IS, Reading
from tauguard.findings import ArgumentError

if TYPE_CHECKING:
    from tauguard.arrays import Array
    from tauguard.cli.free_logs import FreeLogs
    from tauguard.detectors.calibration.recording import Recording
    from tauguard.traces import Trace
    from tauguard.twin import Likeness, Twin

#: Number of parts into which the logs are divided for the jackknife that gives the intervals.
PARTS = 5
#: Half width of a 95 % interval in standard deviations.
WIDE = 1.96


def command(
    logs: Annotated[tuple[Path, ...], tyro.conf.Positional],
    /,
    robot: Path,
    out: Path,
    columns: str | None = None,
    gains: tuple[float, ...] = (),
    payload: tuple[str, ...] = (),
    torque: bool = False,
    judge: tuple[Path, ...] = (),
    accept: tuple[Literal["alarms", "order"], ...] = (),
    figure: Path | None = None,
    reading: Annotated[Reading, tyro.conf.arg(name="")] = AS_IS,
    json: Path | None = None,
) -> None:
    """Identify a twin from logs in which nothing touched the arm, and compare it with the arm.

    The twin is a robot file for `simulate --robot`, `generate` and the environments.

    Args:
        logs: CSV or MCAP files, or a folder of them.
        robot: URDF or MJCF file of the arm alone, or a name that `tauguard robot` lists.
        out: the twin, a TOML file; its bodies are written into the same folder.
        columns: as for `tauguard calibrate`.
        gains: N m per ampere, one per joint.
        payload: loads that were carried, LOG=KG, LOG=KG,X,Y,Z or LOG=unknown.
        torque: the logs hold joint torques in N m instead of currents.
        judge: free logs of other programs, without a load, for the comparison. By default every
            third log of LOGS is compared with a twin from the other logs, and the written twin is
            identified from all logs.
        accept: make a twin although a check fails. alarms: a log has bursts of torque like those of
            contacts. order: two joints' columns seem exchanged.
        figure: a PNG of real and simulated residuals with the results.
        reading: how logs are read.
        json: write the results here as JSON.
    """
    from tauguard.cli.free_logs import explain, free_logs, read_real, run_check
    from tauguard.cli.help_text import print_notes
    from tauguard.detectors.calibration.assessment import left_out
    from tauguard.detectors.calibration.checks import check_order
    from tauguard.detectors.calibration.recording import each_can_be_left_out
    from tauguard.models import load_arm
    from tauguard.models.robot import bodies_file
    from tauguard.report import write_json
    from tauguard.twin.description import write_twin

    if out.suffix != ".toml":
        raise ArgumentError(f"--out {out}: expected a name that ends in .toml")
    robot = bodies_file(robot)
    given, left = without_odd_logs(
        free_logs(logs, robot, columns, gains, payload, torque, reading=reading)
    )
    print_notes(left)
    run_check("order", accept, lambda: check_order(given.arm, given.logs))
    recordings, names = list(given.logs.values()), list(given.logs)
    limit = load_arm(str(robot)).torque_limit
    twin = twin_from(given, recordings, limit)
    apart = []
    if each_can_be_left_out(recordings):
        apart = left_out(given.arm, recordings, scale=given.scale)
    seen = explain(twin.arm, given.logs, apart, accept)
    twin, own = with_jackknife(twin, given, limit)
    print_notes(own)
    tried = None
    if judge:
        others = read_real(judge, robot, columns, (), torque, reading)
        tried = {name: log.trace for name, log in others.items()}
    likeness, compared, reasons = judged(twin, given, limit, tried)
    notes = (*left, *seen, *own)
    written = write_twin(replace(twin, notes=notes), robot, out, names, given.source)
    rows = report(twin.arm.robot.joint_names, likeness, compared, reasons)
    if figure is not None and likeness is not None:
        from tauguard.twin.figure import draw

        draw(figure, twin.arm.robot.joint_names, likeness)
        print(f"{figure}: drawn")
    print(f"{', '.join(map(str, (out, *written)))}: written")
    if json is not None:
        result = {"name": "twin", "twin": str(out), "scale": given.source, "notes": list(notes)}
        write_json(json, result | {"judged_on": compared, "rows": rows})


def without_odd_logs(given: FreeLogs) -> tuple[FreeLogs, list[str]]:
    """Logs that a calibration from the other logs predicts, and a note on each log left out.

    Raises:
        ArgumentError: logs of two arms.
    """
    from tauguard.detectors import ArmModel
    from tauguard.detectors.calibration.identification import identify
    from tauguard.twin.sorting import odd_logs

    names, recordings, arm = list(given.logs), list(given.logs.values()), given.arm
    if given.scale != "gains":
        found = identify(arm, recordings, scale=given.scale).arm
        arm = ArmModel(arm.robot, found.drive_gain)
    odd = odd_logs(arm, names, recordings)
    kept = [k for k in range(len(names)) if k not in odd]
    notes = [
        f"{names[k]} is left out: the other logs do not predict it. Did the arm carry something "
        f"(then give --payload {names[k]}=KG or =unknown), is it another arm, or did something "
        "touch it?"
        for k in odd
    ]
    return replace(given, logs={names[k]: recordings[k] for k in kept}), notes


def twin_from(given: FreeLogs, used: list[Recording], limit: Array) -> Twin:
    """A twin from some of the logs; ``limit`` are the arm's largest torques [N m], shape (n,)."""
    from tauguard.detectors.calibration.identification import identify
    from tauguard.twin import identify_twin

    found = identify(given.arm, used, scale=given.scale)
    bare = [r.trace for r in used if _unloaded(r)]
    if not bare:
        raise ArgumentError("all logs carry a load: a twin needs at least one without")
    twin = identify_twin(found.arm, bare, limit / abs(found.arm.drive_gain))
    return replace(twin, intervals={"inertial": WIDE * found.inertial_error})


def with_jackknife(twin: Twin, given: FreeLogs, limit: Array) -> tuple[Twin, list[str]]:
    """The twin with intervals from twins identified without a part of the logs, and its notes."""
    from tauguard.detectors.calibration.recording import pieces
    from tauguard.twin import with_intervals

    parts = pieces(list(given.logs.values()), PARTS)
    rest = [[r for i, r in enumerate(parts) if i != k] for k in range(len(parts))]
    others, lacking = _twin_from_each(given, rest, limit)
    twin = with_intervals(twin, others)
    return twin, [*twin.notes, *(f"a twin for the intervals is missing: {why}" for why in lacking)]


def judged(
    twin: Twin, given: FreeLogs, limit: Array, tried: dict[str, Trace] | None
) -> tuple[Likeness | None, list[str], list[str]]:
    """Compare twin and arm in motion from which the compared twin was not identified.

    Args:
        twin: identified from all logs.
        given: the logs.
        limit: the arm's largest torques [N m], shape (n,).
        tried: logs of other motion; None: every third log, compared with a twin of the others.

    Returns:
        The likeness or None, the names of the compared logs, and why there is no likeness.
    """
    from tauguard.twin import compare, with_alarms

    names, recordings = list(given.logs), list(given.logs.values())
    held: list[int] = []
    if tried is None:
        held = [k for k in range(2, len(names), 3) if _unloaded(recordings[k])]
        tried = {names[k]: recordings[k].trace for k in held}
    used = [r for k, r in enumerate(recordings) if k not in held]
    twins, reasons = _twin_from_each(given, [used], limit) if held else ([twin], [])
    if not twins or not tried:
        return None, list(tried), reasons
    bare, others = [r.trace for r in used if _unloaded(r)], list(tried.values())
    likeness = compare(twins[0].arm, twins[0].drive, others, own=bare)
    return with_alarms(likeness, used, given.arm, others), list(tried), reasons


def _twin_from_each(
    given: FreeLogs, groups: list[list[Recording]], limit: Array
) -> tuple[list[Twin], list[str]]:
    """A twin from each group of logs, and the different reasons why some groups give none."""
    found, reasons = [], list[str]()
    for used in groups:
        try:
            found.append(twin_from(given, used, limit))
        except ValueError as error:
            reasons += [str(error)] if str(error) not in reasons else []
    return found, reasons


def _unloaded(recording: Recording) -> bool:
    return recording.load is not None and recording.load.mass == 0


def report(
    joints: tuple[str, ...], likeness: Likeness | None, logs: list[str], reasons: list[str]
) -> list[dict[str, Any]]:
    """Print how similar twin and arm are, or why this is not known; return rows for JSON."""
    from tauguard.report import table

    if likeness is None:
        why = f"without {', '.join(logs)}, the other logs make no twin ({'; '.join(reasons)})"
        few = "no log is left for the comparison, which uses every third log that has no load"
        print(f"not judged: {why if logs else few}; give more logs, or --judge")
        return []
    kinds = {
        "rms, moving": likeness.rms,
        "peaks, moving": likeness.peaks,
        "rms, standing": likeness.standing_rms,
        "peaks, standing": likeness.standing_peaks,
        "real: power above": likeness.high[0],
        "twin: power above": likeness.high[1],
        "real: 0.1 s later": likeness.correlation[0],
        "twin: 0.1 s later": likeness.correlation[1],
    }
    rows: list[dict[str, Any]] = [
        {"residual": kind} | {j: _two(v) for j, v in zip(joints, values, strict=True)}
        for kind, values in kinds.items()
    ]
    print(f"judged on {', '.join(logs)}; rms and 99 % of peaks: simulated over real")
    print(table(rows))
    areas = {
        "moving": likeness.moving_auc,
        "standing": likeness.standing_auc,
        "the arm in its own logs against the arm in these, moving": likeness.programs_auc,
    }
    text = "; ".join(f"{kind} {_two(a)}, {_two(b)}" for kind, (a, b) in areas.items())
    print(
        "area under the curve of a classifier that tells simulated from real (boosted trees, "
        f"logistic regression; .5: it cannot): {text}"
    )
    print(
        f"alarms of free-motion, trained on the twin's logs, in {likeness.seconds:.0f} s: "
        f"{likeness.alarms[0]} on the arm, {likeness.alarms[1]} on the twin along the same motion"
    )
    area = {k: f"{_two(a)}, {_two(b)}" for k, (a, b) in areas.items()}
    alarms = dict(zip(("arm", "twin"), likeness.alarms, strict=True))
    return [
        *rows,
        {"residual": "alarms", "seconds": likeness.seconds} | alarms,
        {"residual": "area under the curve"} | area,
    ]


def _two(value: float) -> str:
    return "-" if value != value else f"{value:.2f}"
