"""``tauguard replay FILE.mcap``: a recording for rerun."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Annotated

import tyro


def command(
    file: Annotated[Path, tyro.conf.Positional],
    /,
    out: Path | None = None,
    robot: Path | None = None,
    whole: bool = False,
    open: bool = False,
) -> None:
    """Turn an MCAP recording into an .rrd that shows the arm moving beside its signals.

    Args:
        file: an MCAP file written by tauguard.
        out: the recording (default: FILE with the ending .rrd).
        robot: MJCF or URDF file of the robot (default: the one attached to FILE).
        whole: keep what comes before the first detected collision.
        open: show it in the rerun viewer, which listens on 127.0.0.1 only.
    """
    from tauguard.replay import write_rrd
    from tauguard.traces import read_mcap

    trace, detection = read_mcap(file)
    out = out or file.with_suffix(".rrd")
    write_rrd(out, trace, detection, robot, whole=whole)
    print(f"{out}  ({out.stat().st_size / 1e6:.1f} MB; show it with: rerun {out})")
    if open:
        viewer = Path(sys.executable).with_name("rerun")
        subprocess.run([viewer, "--bind", "127.0.0.1", out], check=False)
