"""``tauguard inspect``: show the content of a dataset and check its files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from tauguard.findings import ArgumentError

if TYPE_CHECKING:
    from collections.abc import Mapping


def command(
    folder: Annotated[Path, tyro.conf.Positional],
    verify: bool = False,
    json: Path | None = None,
    figure: Path | None = None,
    episode: str | None = None,
    mcap: Path | None = None,
    robot: Path | None = None,
) -> None:
    """Show the content of a generated dataset; with --verify check all its bytes.

    The exit code is 2 if --verify finds damaged, missing or foreign files or a motion in two
    splits, or if the repeated --episode has other bytes. To repair damaged files, run the command
    that generated the dataset again.

    Args:
        folder: folder of the dataset.
        verify: compare every file with its checksum.
        json: write the report here as JSON.
        figure: draw the report here (PNG).
        episode: simulate this episode, SPLIT/NUMBER (from 0), again from its line in the manifest,
            and compare its bytes.
        mcap: with --episode, write the episode here, with obstacles, for `tauguard replay`.
        robot: with --episode, the robot file of an arm that is not in the package. The dataset
            contains only the file's hash and the parameters for training, not the shapes.
    """
    from tauguard.datasets import draw_inspection, inspect_dataset
    from tauguard.report import write_json

    if (mcap or robot) is not None and episode is None:
        raise ArgumentError("--mcap and --robot need --episode")
    if episode is not None:
        simulate_again(folder, episode, mcap, robot)
        return
    report = inspect_dataset(folder, verify)
    print(page(report))
    if figure is not None:
        draw_inspection(figure, folder, report)
    if json is not None:
        write_json(json, report)
    if report["damaged"] or (verify and report["leaks"]):
        raise SystemExit(2)


def page(report: Mapping[str, Any]) -> str:
    """The report as text."""
    from tauguard.report import table

    code = report["code"]
    lines = [
        f"{report['name']}, {report['rate']} rows per second, "
        f"configuration {report['configuration_sha256'][:12]}",
        f"made by tauguard {code['tauguard']}, MuJoCo {code['mujoco']}",
        "",
    ]
    rows = [
        {
            "split": name,
            "episodes": one["episodes"],
            "hours": one["hours"],
            "MB": f"{one['megabytes']:.1f}",
            "MB/h": f"{one['megabytes'] / one['hours'] if one['hours'] else 0.0:.0f}",
            "collisions": one["collisions"],
            "planned": one["planned_collisions"],
            "outcomes": ", ".join(f"{n} {what}" for what, n in sorted(one["outcomes"].items())),
        }
        for name, one in report["splits"].items()
    ]
    lines.append(table(rows))
    for name, one in report["splits"].items():
        if one["collisions"]:
            lines += ["", *classes(name, one)]
        lines += [f"  off balance: {what}" for what in one["off_balance"]]
    return "\n".join([*lines, "", *verdict(report)])


def classes(name: str, one: Mapping[str, Any]) -> list[str]:
    """Collisions of a split by class, as achieved and as planned."""
    from tauguard.datasets import class_order

    lines = [f"{name}: collisions that happened (planned)"]
    for what in ("kind", "link", "severity"):
        there, wanted = one["achieved"].get(what, {}), one["planned"].get(what, {})
        both = sorted(there.keys() | wanted.keys(), key=class_order)
        cells = "  ".join(f"{v} {there.get(v, 0)} ({wanted.get(v, 0)})" for v in both)
        lines.append(f"  {what:<9} {cells}")
    return lines


def verdict(report: Mapping[str, Any]) -> list[str]:
    """Lines of text on missing and damaged files, and on leaks between splits."""
    lines = []
    gone, damaged = report["missing"], report["damaged"]
    if gone:
        lines.append(f"not complete: {len(gone)} shards missing, first: {gone[0]}")
    for leak in report["leaks"]:
        lines.append(f"LEAK: {leak}")
    if not report["leaks"]:
        lines.append(
            "no motion is in two splits, and no value declared unseen is in the first split"
        )
    if damaged is None:
        lines.append("files not checked (--verify reads every byte)")
    elif damaged:
        lines += [f"DAMAGED: {name}: {wrong}" for name, wrong in damaged.items()]
        lines.append("`tauguard generate` with the same configuration writes damaged files again")
    elif report["unchecked"]:
        lines.append("every file with a checksum is intact, byte for byte")
    else:
        lines.append("every file is intact, byte for byte")
    for name in report["unchecked"]:
        lines.append(f"{name}: not checked; `tauguard generate` of this version adds a checksum")
    return lines


def simulate_again(folder: Path, name: str, mcap: Path | None, robot: Path | None) -> None:
    """Simulate one episode again and compare it with the stored one."""
    from tauguard.datasets import episode_line, simulated_again
    from tauguard.traces import write_mcap

    line = episode_line(folder, name)
    trace, same = simulated_again(folder, line, robot)
    print(f"{name}: {line['outcome']}; {line['rows']} rows, key {line['key'][:12]}")
    print("simulated again: the same bytes" if same else "simulated again: OTHER bytes")
    if mcap is not None and trace is not None:
        write_mcap(mcap, trace)
        print(f"{mcap}: the episode with its scene; `tauguard replay` shows it")
    if not same:
        raise SystemExit(2)
