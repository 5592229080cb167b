"""``tauguard export``: a generated dataset in the format of another library."""

from pathlib import Path
from typing import Annotated, Literal

import tyro


def command(
    folder: Annotated[Path, tyro.conf.Positional],
    out: str,
    to: Literal["lerobot", "minari"] = "lerobot",
    splits: tuple[str, ...] = (),
    arm: str | None = None,
) -> None:
    """Write a dataset, or some of its splits, for LeRobot or Minari.

    pandas, polars and DuckDB need no export: they read data/*.parquet directly.

    Args:
        folder: folder of a dataset that `tauguard generate` made.
        out: for LeRobot a new folder; for Minari a dataset id such as tauguard/collisions-v0, which
            Minari stores in its own folder.
        to: "lerobot" (LeRobotDataset v3.0) or "minari" (extra `export`).
        splits: names of the splits to write (default: all).
        arm: write only this arm's episodes.
    """
    from tauguard.datasets import arms_of, configuration_in, read
    from tauguard.datasets.exports import LEROBOT_VERSION, write_lerobot, write_minari

    configuration = configuration_in(folder)
    traces = read(folder, splits or None, arm)
    if to == "minari":
        count = write_minari(traces, out, configuration.rate)
        print(f"{out}: {count} episodes, for minari.load_dataset({out!r})")
        return
    robots = (arm,) if arm else arms_of(folder, splits or None)
    count = write_lerobot(traces, Path(out), configuration.rate, "+".join(robots))
    print(
        f"{out}: {count} episodes as LeRobotDataset {LEROBOT_VERSION}; "
        f"on the hub, tag it {LEROBOT_VERSION}"
    )
