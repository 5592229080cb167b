"""One arm's episodes of a generated dataset, split by split: to train on and to judge on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from tauguard.datasets.dataset_folder import arm_xml, configuration_in
from tauguard.datasets.reader import arms_of, read, splits_of
from tauguard.detectors import RobotNumbers
from tauguard.models import pin_model
from tauguard.traces import Trace


def training(folder: Path, arm: str | None) -> list[Trace]:
    """One arm's episodes of the first split, which others are held to.

    Raises:
        ValueError: the split has several arms and ``arm`` does not choose, or it has no such arm.
    """
    first = (configuration_in(folder).splits[0].name,)
    arms = arms_of(folder, first)
    if arm is None and len(arms) > 1:
        raise ValueError(
            f"{folder}: its split {first[0]!r} has {len(arms)} arms and a detector knows one: "
            f"choose with --arm {{{','.join(arms)}}}"
        )
    return list(read(folder, first, arm))


def episodes_of_splits(
    folder: Path, robot: RobotNumbers, splits: Sequence[str]
) -> Iterator[tuple[str, Iterator[Trace]]]:
    """The splits to judge on and the episodes in them of the arm that a detector knows.

    Args:
        folder: of the dataset.
        robot: what the detector believes of its arm.
        splits: to judge on (default: those whose name begins with "test").

    Raises:
        ValueError: no split has that arm.
    """
    every = [split.name for split in configuration_in(folder).splits]
    chosen = splits_of(folder, splits or [s for s in every if s.startswith("test")])
    arm = same_arm(folder, robot)
    there = [split for split in chosen if arm in arms_of(folder, [split])]
    if not there:
        raise ValueError(
            f"{folder}: the model is of {arm or 'no arm of this dataset'}; {', '.join(chosen)} "
            f"have {', '.join(arms_of(folder, chosen))}"
        )
    for split in there:
        yield split, read(folder, [split], arm)


def same_arm(folder: Path, robot: RobotNumbers) -> str | None:
    """Which arm of the dataset has the geometry that a detector believes in."""
    for arm in arms_of(folder):
        own = RobotNumbers.from_pin(pin_model(arm_xml(folder, arm)))
        parts = ("translation", "axis", "armature")  # masses are identified in training
        if all(np.array_equal(getattr(own, name), getattr(robot, name)) for name in parts):
            return arm
    return None
