"""``tauguard replay PATH``: convert recordings for rerun and show them."""

import signal
import subprocess
import sys
from pathlib import Path
from typing import Annotated
from urllib.parse import quote

import tyro

from tauguard.findings import ArgumentError


def command(
    path: Annotated[Path, tyro.conf.Positional],
    /,
    out: Path | None = None,
    robot: Path | None = None,
    whole: bool = False,
    open: bool = False,
    web: bool = False,
    port: int = 0,
) -> None:
    """Convert an MCAP recording into an .rrd file that shows the moving arm and its signals.

    With --web, an .rrd file or the folder of `evaluate --events` or `report` is shown in a browser.
    Of a folder of MCAP recordings the newest one is converted. --web and --open use an existing
    .rrd of PATH, unless --out, --robot or --whole is given.

    Args:
        path: an MCAP file written by tauguard, an .rrd file, or a folder of either.
        out: the .rrd file to write (default: PATH with the extension .rrd, if it does not exist).
        robot: MJCF or URDF file of the robot (default: the file attached to PATH).
        whole: include the part before the first detection.
        open: show the recording in the rerun viewer, which listens on 127.0.0.1 only.
        web: serve the recording and rerun's web viewer on 127.0.0.1, until interrupted.
        port: with --web, port of the page (default: a free one).
    """
    from tauguard.cli import expect

    expect("--port", port, 0, 65535)
    web = web or path.is_dir() or (path.suffix == ".rrd" and not open)
    path = shown = newest(path)
    if not (path.is_dir() or path.suffix == ".rrd"):
        asked = out or robot or whole
        there = path.with_suffix(".rrd")
        fits = (web or open) and not asked and there.exists() and path.exists()
        fits = fits and there.stat().st_mtime >= path.stat().st_mtime
        if fits:
            print(f"{there}: made from {path.name} before, shown as it is")
        shown = there if fits else recorded(path, out, robot, whole)
    if web:
        serve(shown, port)
    elif open:
        viewer = Path(sys.executable).with_name("rerun")
        subprocess.run([viewer, "--bind", "127.0.0.1", shown], check=False)


def newest(path: Path) -> Path:
    """The newest recording (MCAP, or else .rrd) in a folder without a page; otherwise ``path``."""
    if not path.is_dir() or (path / "index.html").exists():
        return path
    found = sorted(path.rglob("*.mcap"), key=lambda file: file.stat().st_mtime)
    found = found or sorted(path.rglob("*.rrd"), key=lambda file: file.stat().st_mtime)
    if not found:
        return path
    print(f"{path}: {len(found)} recordings; showing the newest, {found[-1].name}")
    return found[-1]


def recorded(file: Path, out: Path | None, robot: Path | None, whole: bool) -> Path:
    """Convert the MCAP file to an .rrd file."""
    from tauguard.replay import write_rrd
    from tauguard.traces import read_mcap

    usual = file.with_suffix(".rrd")
    if not file.exists():
        raise FileNotFoundError(f"{file}: no such file")
    if out is None and usual.exists():
        raise FileExistsError(
            f"{usual} is there already: name the file to write with --out; "
            f"`tauguard replay --web {usual}` shows the existing one"
        )
    trace = read_mcap(file)
    out = out or usual
    write_rrd(out, trace, trace.detection, robot, whole=whole)
    print(f"{out}  ({out.stat().st_size / 1e6:.1f} MB; show it with: rerun {out})")
    return out


def serve(shown: Path, port: int) -> None:
    """Serve a recording, or a folder with a page that links to its recordings."""
    from tauguard.replay import BrowserReplay

    if not shown.exists():
        raise FileNotFoundError(f"{shown}: no such file or folder")
    folder = shown if shown.is_dir() else shown.parent
    if shown.is_dir() and not (shown / "index.html").exists():
        there = ", ".join(sorted(str(file) for file in shown.glob("*.rrd"))[:3])
        own = f"name one of its recordings ({there}), or " if there else ""
        raise ArgumentError(
            f"{shown}: no index.html in it; {own}the folder of `tauguard evaluate --events FOLDER`"
        )
    with BrowserReplay(folder, port) as replay:
        address = f"{replay.address}/" + ("" if shown.is_dir() else f"open/{quote(shown.name)}")
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # also stops the servers
        print(f"open {address} in a browser; Ctrl-C ends this", flush=True)
        replay.wait()
