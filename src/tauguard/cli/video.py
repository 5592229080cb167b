"""``tauguard video RECORDING``: render a recording to a video file, without a viewer."""

from pathlib import Path
from typing import Annotated

import tyro

from tauguard.findings import ArgumentError


def command(
    recording: Annotated[Path, tyro.conf.Positional],
    /,
    out: Path | None = None,
    start: float = 0.0,
    seconds: float | None = None,
    slower: float = 1.0,
    rate: int = 20,
    width: int = 640,
    height: int = 480,
) -> None:
    """Render an MCAP recording of the simulation: arm, obstacles and people.

    MP4 needs the extra `video`. Rendering needs OpenGL: without a display install libegl1 or
    libosmesa6.

    Args:
        recording: an MCAP file written by tauguard, or a folder, of which the newest is used.
        out: .gif, .webp, .png or .mp4 (default: RECORDING with the extension .gif).
        start: start of the rendered part [s].
        seconds: length of the rendered part [s] (default: to the end).
        slower: factor by which the video is slower than real time.
        rate: frames per second.
        width: width of the picture [px].
        height: height of the picture [px].
    """
    from tauguard.cli import expect
    from tauguard.cli.replay import newest
    from tauguard.replay import video_frames, write_video
    from tauguard.traces import read_mcap

    expect("--slower", slower, 1e-3, 1e6)
    expect("--rate", rate, 1, 1000)
    expect("--width", width, 1, 8192)
    expect("--height", height, 1, 8192)
    expect("--start", start, 0)
    expect("--seconds", 0.0 if seconds is None else seconds, 0)
    source = newest(recording)
    target = out or source.with_suffix(".gif")
    if not target.absolute().parent.is_dir():
        raise FileNotFoundError(f"--out {target}: the folder {target.parent} does not exist")
    if target.exists() and out is None:
        raise FileExistsError(f"{target} is there already: name the file to write with --out")
    trace = read_mcap(source)
    pictures = video_frames(trace, start, seconds, rate * slower, (height, width))
    try:
        count = write_video(target, pictures, rate)
    except RuntimeError as error:  # no OpenGL
        raise ArgumentError(str(error)) from None
    print(f"{target}  ({count} frames, {target.stat().st_size / 1e6:.1f} MB)")
