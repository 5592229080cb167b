"""Traces of a generated dataset, of a folder of recordings, or of one log."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow.parquet as pq

from tauguard.datasets.columns_of_shards import trace_of
from tauguard.datasets.dataset_folder import HEAD, arm_texts, arm_xml, configuration_in, shards
from tauguard.datasets.dataset_folder import arms_of as arms_in
from tauguard.datasets.log_table import Options
from tauguard.datasets.logs import read_source
from tauguard.datasets.shard import data_path, manifest_path, read_lines
from tauguard.findings import FileError
from tauguard.traces import Trace

if TYPE_CHECKING:
    from tauguard.detectors import RobotNumbers

#: Extensions of recordings.
ENDINGS = (".mcap", ".csv", ".parquet")


def is_dataset(path: Path) -> bool:
    """Whether ``path`` is a folder that ``tauguard generate`` made."""
    return (path / HEAD).is_file()


def read(
    path: str | Path,
    splits: Sequence[str] | None = None,
    arm: str | None = None,
) -> Iterator[Trace]:
    """The traces of a dataset, of a folder of recordings or of one recording, one at a time.

    Args:
        path: a folder that ``tauguard generate`` made, a folder of MCAP or CSV files, or one MCAP
            or CSV file.
        splits: names of a dataset's splits (default: all).
        arm: read only this arm's episodes of a dataset.

    Yields:
        Traces. Those of a dataset have truth, and the nominal arm as attachments: ``arm.xml``, and
            ``drive.json`` for an arm that is not part of the package. The arm's own file is not
            needed.

    Raises:
        FileError: nothing to read at ``path``, a damaged shard (the message names it), an unknown
            split or arm, or a dataset of a newer version.
        OSError: no such file or folder.
    """
    path = Path(path)
    if is_dataset(path):
        yield from _of_dataset(path, splits, arm)
        return
    if splits or arm:
        raise FileError(f"{path}: no dataset (no {HEAD}), so it has no splits and no named arms")
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such file or folder")
    files = sorted(f for f in path.iterdir() if f.suffix in ENDINGS) if path.is_dir() else [path]
    if not files:
        raise FileError(f"{path}: no dataset and no recordings ({', '.join(ENDINGS)}) in it")
    for file in files:
        yield read_source(file, file.name, Options()).trace


def splits_of(folder: Path, wanted: Sequence[str] | None) -> tuple[str, ...]:
    """The wanted splits of a dataset, all by default; ``FileError`` for one it does not have."""
    there = [split.name for split in configuration_in(folder).splits]
    for name in wanted or ():
        if name not in there:
            raise FileError(f"{folder}: no split {name!r}; it has {', '.join(there)}")
    return tuple(wanted or there)


def arms_of(folder: Path, splits: Sequence[str] | None = None) -> tuple[str, ...]:
    """The arms of a dataset's splits, by name."""
    chosen = splits_of(folder, splits)
    return arms_in(configuration_in(folder), chosen)


def _of_dataset(folder: Path, splits: Sequence[str] | None, arm: str | None) -> Iterator[Trace]:
    chosen = splits_of(folder, splits)
    if arm is not None and arm not in arms_of(folder, chosen):
        raise FileError(
            f"{folder}: no arm {arm!r} in {', '.join(chosen)}; "
            f"there are {', '.join(arms_of(folder, chosen))}"
        )
    for split, number in shards(configuration_in(folder)):
        if split not in chosen:
            continue
        listed = folder / manifest_path(split, number)
        if not listed.is_file():
            raise FileError(
                f"{folder}: {data_path(split, number)} is missing; the same `tauguard generate` "
                "that began the dataset completes it"
            )
        wanted = [x for x in read_lines(listed) if x["rows"] and arm in (None, x["arm"])]
        yield from episodes_of(folder, wanted)


def episodes_of(folder: Path, wanted: Sequence[dict[str, Any]]) -> Iterator[Trace]:
    """The traces of episodes of one shard; ``wanted`` has their lines of the manifest."""
    if not wanted:
        return
    path = folder / wanted[0]["shard"]
    arms = {arm: arm_texts(folder, arm) for arm in {line["arm"] for line in wanted}}
    try:
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            for line in wanted:
                yield trace_of(file.read_row_group(line["row_group"]), line, arms[line["arm"]])
    except FileNotFoundError:
        raise FileNotFoundError(
            f"{path}: missing; the same `tauguard generate` that made the dataset makes it again"
        ) from None
    except (OSError, ValueError, KeyError) as error:
        raise FileError(
            f"{path}: damaged ({' '.join(str(error).split())[:120]}); the same `tauguard generate` "
            "that made the dataset makes this shard again"
        ) from None


def training_episodes(folder: Path, arm: str | None) -> list[Trace]:
    """One arm's episodes of the first split, which is the training split.

    Raises:
        FileError: the split has several arms and ``arm`` is None, or it has no such arm.
    """
    first = (configuration_in(folder).splits[0].name,)
    arms = arms_of(folder, first)
    if arm is None and len(arms) > 1:
        raise FileError(
            f"{folder}: its split {first[0]!r} has {len(arms)} arms, and a detector is trained for "
            f"one: choose with `arm=`: {', '.join(arms)}"
        )
    return list(read(folder, first, arm))


def episodes_of_splits(
    folder: Path, robot: RobotNumbers, splits: Sequence[str]
) -> Iterator[tuple[str, Iterator[Trace]]]:
    """Names of splits, and their episodes of the arm that a detector was trained for.

    Args:
        folder: folder of the dataset.
        robot: the detector's numbers of its arm.
        splits: names of splits (default: all whose name begins with "test").

    Raises:
        FileError: no split has that arm.
    """
    every = [split.name for split in configuration_in(folder).splits]
    chosen = splits_of(folder, splits or [s for s in every if s.startswith("test")])
    arm = same_arm(folder, robot)
    there = [split for split in chosen if arm in arms_of(folder, [split])]
    if not there:
        raise FileError(
            f"{folder}: the model was trained for {arm or 'no arm of this dataset'}; the arms of "
            f"{', '.join(chosen)} are {', '.join(arms_of(folder, chosen))}"
        )
    for split in there:
        yield split, read(folder, [split], arm)


def same_arm(folder: Path, robot: RobotNumbers) -> str | None:
    """The dataset's arm with the detector's geometry and rotor inertias; None if there is none."""
    from tauguard.detectors import RobotNumbers
    from tauguard.models import pin_model

    for arm in arms_of(folder):
        own = RobotNumbers.from_pin(pin_model(arm_xml(folder, arm)))
        parts = ("translation", "axis", "armature")  # masses are identified in training
        if all(np.array_equal(getattr(own, name), getattr(robot, name)) for name in parts):
            return arm
    return None
