"""``tauguard twin LOGS --robot FILE``: a simulated arm that behaves like the arm in the logs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import tyro

from tauguard.datasets import AS_IS, Reading
from tauguard.findings import ArgumentError


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
    import tauguard as tg
    from tauguard.cli.output import print_findings
    from tauguard.cli.read import read_free
    from tauguard.report import write_json

    if out.suffix != ".toml":
        raise ArgumentError(f"--out {out}: expected a name that ends in .toml")
    free = read_free(logs, robot, columns, payload, torque, reading)
    others = read_free(judge, robot, columns, (), torque, reading) if judge else None
    twin = tg.identify_twin(free, gains=gains, accept=accept, judge=others)
    print_findings(twin.findings)
    files = twin.save(out)
    print(twin.text())
    if figure is not None and twin.likeness is not None:
        twin.draw(figure)
        print(f"{figure}: drawn")
    print(f"{', '.join(map(str, files))}: written")
    if json is not None:
        write_json(json, {"name": "twin", "twin": str(out), **twin.to_dict()})
