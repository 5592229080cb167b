"""``tauguard twin LOGS --robot FILE``: a simulated arm that is like the one in the logs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

if TYPE_CHECKING:
    from tauguard.detectors import ArmModel
    from tauguard.detectors.calibration.recording import Recording
    from tauguard.twin import Likeness


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
    figure: Path | None = None,
    json: Path | None = None,
) -> None:
    """Identify a twin from logs in which nothing touched the arm, and judge it on others.

    The twin is a robot file: `simulate`, `generate` and every environment take it as --robot.

    Args:
        logs: CSV or MCAP files, or a folder of them.
        robot: URDF or MJCF file of the arm alone.
        out: the twin, a TOML file; its bodies are written beside it.
        columns: as for `tauguard calibrate`.
        gains: N m per ampere, one a joint.
        payload: loads that were carried, LOG=KG, LOG=KG,X,Y,Z or LOG=unknown.
        torque: the logs hold joint torques in N m where they would hold currents.
        judge: free logs without a load of programs that LOGS do not have; without them, each third
            log of LOGS is left out for the judgement, and used for the twin afterwards.
        figure: a PNG of residuals, real and simulated.
        json: write the figures here as JSON.
    """
    from tauguard.cli.help_text import print_notes
    from tauguard.datasets.arm_logs import moving, read_logs, with_loads
    from tauguard.datasets.real_arms import calibration_notes, check_named, initial_arm
    from tauguard.detectors.calibration.assessment import left_out
    from tauguard.detectors.calibration.checks import check_signs
    from tauguard.detectors.calibration.identification import identify
    from tauguard.models import load_arm
    from tauguard.report import write_json
    from tauguard.twin import compare, identify_twin
    from tauguard.twin.description import write_twin

    read = read_logs(logs, columns, robot, torque)
    print_notes(read.notes)
    known = dict(zip(read.traces, with_loads(read.traces, payload), strict=True))
    traces, notes = moving(read.traces)
    print_notes(notes)
    recordings = [known[name] for name in traces]
    if not gains:
        check_named(robot, columns, list(traces.values()))
    arm, source = initial_arm(read.numbers, recordings, columns, gains, "auto")
    for name, trace in traces.items():
        check_signs(arm, name, trace)
    scale = "gains" if source in ("preset", "torques") else source
    limit = load_arm(str(robot)).torque_limit

    def made(used: list[Recording]) -> tuple[ArmModel, Any]:
        found = identify(arm, used, scale=scale).arm
        bare = [r.trace for r in used if r.load is not None and r.load.mass == 0]
        return found, identify_twin(found, bare, limit / found.drive_gain)

    likeness, names = None, list(traces)
    if judge:
        others = read_logs(judge, columns, robot, torque)
        tried, told = list(others.traces.values()), list(others.traces)
        model, twin = made(recordings)
        likeness = compare(model, twin.drive, tried)
    else:
        held = [k for k in range(2, len(names), 3) if known[names[k]].load is not None]
        held = [k for k in held if recordings[k].load.mass == 0]  # type: ignore[union-attr]
        told = [names[k] for k in held]
        if held:
            part = made([r for k, r in enumerate(recordings) if k not in held])
            likeness = compare(part[0], part[1].drive, [recordings[k].trace for k in held])
        model, twin = made(recordings)
    apart = left_out(arm, recordings, scale=scale) if len(recordings) > 1 else []
    print_notes((*calibration_notes(model, traces, recordings, apart), *twin.notes))
    bodies = write_twin(twin, robot, out, names, source)
    rows = report(twin.arm.robot.joint_names, likeness, told)
    if figure is not None and likeness is not None:
        from tauguard.twin.figure import draw

        draw(figure, twin.arm.robot.joint_names, likeness)
        print(f"{figure}: drawn")
    print(f"{out}, {bodies}: written")
    if json is not None:
        result = {"name": "twin", "twin": str(out), "scale": source, "notes": list(twin.notes)}
        write_json(json, result | {"judged_on": told, "rows": rows})


def report(
    joints: tuple[str, ...], likeness: Likeness | None, logs: list[str]
) -> list[dict[str, Any]]:
    """Print how like the twin is; the rows, ready for JSON."""
    from tauguard.report import table

    if likeness is None:
        print("not judged: give three logs or more, or --judge")
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
        "real against real, moving": likeness.real_auc,
    }
    text = "; ".join(f"{kind} {_two(value)}" for kind, value in areas.items())
    print(f"a classifier that tells simulated from real (area, .5: it cannot): {text}")
    return [*rows, {"residual": "area under the curve"} | {k: _two(v) for k, v in areas.items()}]


def _two(value: float) -> str:
    return "-" if value != value else f"{value:.2f}"
