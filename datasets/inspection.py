"""Counts, balance, outcomes, leakage and damage of a dataset."""

import json
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tauguard.datasets.columns_of_shards import collision_line, given, stored
from tauguard.datasets.configuration import Configuration
from tauguard.datasets.dataset_folder import (
    CARD,
    CROISSANT,
    HEAD,
    SUMS,
    arm_checksums,
    arm_texts,
    arms_of,
    changed,
    configuration_in,
    faults,
    lines,
    read_head,
    shards,
)
from tauguard.datasets.reader import episodes_of
from tauguard.datasets.robots import check_unchanged
from tauguard.datasets.schedule import Balance, Planned
from tauguard.datasets.shard import PHYSICS_RATE, data_path, manifest_path, simulated
from tauguard.envs import Episode
from tauguard.findings import FileError
from tauguard.traces import Trace, stratum

#: Properties of collisions that are counted from the labels.
ACHIEVED = ("kind", "link", "severity")
#: A class is off balance if it differs from the plan by more than this fraction and more than this
#: number of collisions.
SLACK, SLACK_COUNT = 0.25, 10


#: Fields of :class:`SplitSummary` that a report shows.
SHOWN = (
    "episodes", "hours", "rows", "megabytes", "planned_collisions", "collisions", "outcomes",
    "planned", "achieved",
)  # fmt: skip


@dataclass
class SplitSummary:
    """Counts of one split."""

    episodes: int = 0
    hours: float = 0.0
    rows: int = 0
    megabytes: float = 0.0
    planned_collisions: int = 0
    collisions: int = 0
    planned: dict[str, Counter[str]] = field(default_factory=dict)
    achieved: dict[str, Counter[str]] = field(default_factory=dict)
    outcomes: Counter[str] = field(default_factory=Counter)
    seeds: set[int] = field(default_factory=set)
    values: dict[str, set[Any]] = field(default_factory=dict)


def summarised(folder: Path) -> dict[str, SplitSummary]:
    """Counts from the manifest, split by split; planned counts cover only existing episodes.

    Raises:
        FileError: no dataset, one of a newer version, or a damaged manifest.
    """
    found = {split.name: SplitSummary() for split in configuration_in(folder).splits}
    last = ""
    for line in lines(folder):
        one = found[line["split"]]
        _add(one, line)
        if line["shard"] != last:
            one.megabytes += line["bytes"] / 1e6
            last = line["shard"]
    return found


def _add(one: SplitSummary, line: dict[str, Any]) -> None:
    one.episodes += 1
    one.rows += line["rows"]
    one.hours += line["seconds"] / 3600
    one.planned_collisions += line["planned_collisions"]
    one.collisions += len(line["collisions"])
    one.seeds.add(line["seed"])
    one.outcomes[_outcome(line["outcome"])] += 1
    for name, value in (
        ("arm", line["arm"]),
        ("individual", (line["arm"], line["individual"])),
        ("payload", line["payload_g"]),
        ("speed", line["speed"]),
    ):
        one.values.setdefault(name, set()).add(value)
    _count(one.planned, _planned_of(line))
    _count(
        one.achieved,
        {
            "kind": Counter(c["kind"] for c in line["collisions"]),
            "link": Counter(str(c["link"]) for c in line["collisions"]),
            "severity": Counter(stratum(c["peak_tau"]) for c in line["collisions"]),
        },
    )


def _outcome(text: str) -> str:
    if text == "as planned":
        return text
    return "failed" if text.startswith("failed") else "other collisions than planned"


def _planned_of(line: dict[str, Any]) -> dict[str, Counter[str]]:
    plans = line["episode"]["collisions"]
    middle = [(p["severity"][0] * p["severity"][1]) ** 0.5 for p in plans if p["severity"]]
    return {
        "arm": Counter([line["arm"]]),
        "speed": Counter([f"{line['speed']:g}"]),
        "payload_g": Counter([f"{line['payload_g']:g}"]),
        "kind": Counter(p["kind"] for p in plans),
        "link": Counter(str(p["link"]) for p in plans),
        "severity": Counter(stratum(m) for m in middle),
    }


def _count(into: dict[str, Counter[str]], what: dict[str, Counter[str]]) -> None:
    for name, counts in what.items():
        into.setdefault(name, Counter()).update(counts)


def leaks(configuration: Configuration, found: dict[str, SplitSummary]) -> list[str]:
    """Leaks between splits: equal motion seeds, and values that a split declares unseen."""
    lines = []
    names = list(found)
    for i, a in enumerate(names):
        for b in names[i + 1 :]:
            if shared := found[a].seeds & found[b].seeds:
                lines.append(f"{a} and {b} share {len(shared)} motion seeds")
    first = configuration.splits[0]
    for split in configuration.splits[1:]:
        for what in split.unseen:
            of_first = found[first.name].values.get(what, set())
            if shared := of_first & found[split.name].values.get(what, set()):
                lines.append(f"{split.name} shares {what} {sorted(shared)} with {first.name}")
    return lines


def missing(folder: Path) -> list[str]:
    """Shards that do not exist yet."""
    return [
        data_path(split, number)
        for split, number in shards(configuration_in(folder))
        if not (folder / manifest_path(split, number)).is_file()
    ]


def inspect_dataset(folder: Path, verify: bool = False) -> dict[str, Any]:
    """The content of a dataset, and with ``verify`` the result of reading all its bytes.

    Returns:
        As :func:`report`, with ``damaged`` (faults by file; None: not verified) and ``unchecked``
        (files without a checksum).

    Raises:
        FileError: no dataset, or ``dataset.json`` is damaged.
    """
    damaged = dict(verified(folder)) if verify else None
    if damaged and HEAD in damaged:
        raise FileError(f"{folder}: " + "; ".join(f"{k}: {v}" for k, v in damaged.items()))
    return report(folder) | {
        "damaged": damaged,
        "unchecked": unchecked(folder) if verify else [],
    }


def verified(folder: Path) -> list[tuple[str, str]]:
    """Names and faults of damaged, missing and foreign files; reads every byte.

    Raises:
        FileError: ``dataset.json`` is so damaged that the other files are not known.
    """
    found = changed(folder)
    found += [
        (data_path(split, number), wrong)
        for split, number, wrong in faults(folder)
        if wrong is not None
    ]
    for arm in arms_of(configuration_in(folder)):
        try:
            arm_texts(folder, arm)
        except ValueError as error:
            found.append((f"arms/{arm}", str(error)))
    return found + [(name, "no file of this dataset: move it away") for name in foreign(folder)]


def foreign(folder: Path) -> list[str]:
    """Files in the folders of shards and arms that do not belong to the dataset."""
    known = {
        path(split, number)
        for split, number in shards(configuration_in(folder))
        for path in (data_path, manifest_path)
    }
    known |= {f"arms/{name}" for name in arm_checksums(read_head(folder))}
    there = (path for name in ("data", "manifest", "arms") for path in folder.glob(f"{name}/*"))
    names = (path.relative_to(folder).as_posix() for path in there if not path.name.startswith("."))
    return sorted(set(names) - known)


def unchecked(folder: Path) -> list[str]:
    """Files without a checksum, in a complete dataset that an earlier version made."""
    if (folder / SUMS).is_file():
        return []
    return [name for name in (HEAD, CARD, CROISSANT) if (folder / name).is_file()]


def off_balance(stated: Balance, one: SplitSummary) -> list[str]:
    """Properties whose planned counts are not as ``stated``, and classes that are off balance."""
    lines = []
    for name, classes in stated.items():
        if {k: v for k, v in classes.items() if v} != dict(one.planned.get(name, {})):
            lines.append(f"{name}: planned counts differ from those in {HEAD}")
    for name in ACHIEVED:
        for value, wanted in stated[name].items():
            there = one.achieved.get(name, Counter())[value]
            if abs(there - wanted) > max(SLACK * wanted, SLACK_COUNT):
                lines.append(f"{name} {value}: {there} of {wanted} planned")
    return lines


def report(folder: Path) -> dict[str, Any]:
    """All results that `tauguard inspect` shows, as plain values."""
    head = read_head(folder)
    configuration = configuration_in(folder)
    found = summarised(folder)
    absent = missing(folder)
    return {
        "name": head["name"],
        "format": head["format"],
        "configuration_sha256": head["configuration_sha256"],
        "code": head["code"],
        "rate": configuration.rate,
        "missing": absent,
        "stated": head["planned"],
        "leaks": leaks(configuration, found),
        "splits": {
            name: {
                **{key: value for key, value in vars(one).items() if key in SHOWN},
                "off_balance": [] if absent else off_balance(head["planned"][name], one),
            }
            for name, one in found.items()
        },
    }


def episode_line(folder: Path, name: str) -> dict[str, Any]:
    """The manifest's line of an episode, ``split/number``.

    Raises:
        FileError: no such episode.
    """
    for line in lines(folder):
        if f"{line['split']}/{line['number']}" == name:
            return line
    raise FileError(f"{folder}: no episode {name!r}; expected split/number, such as train/0")


def simulated_again(
    folder: Path, line: dict[str, Any], robot: str | Path | None = None
) -> tuple[Trace | None, bool]:
    """Simulate an episode again: the trace, and whether it equals the stored samples.

    Args:
        folder: folder of the dataset.
        line: the episode's line of the manifest.
        robot: the file of the episode's arm, if the arm is not part of the package.

    Raises:
        FileError: the arm's file is missing or not the one the dataset was made with, or a file
            was given for an arm of the package.
    """
    episode = Episode.from_json(json.dumps(line["episode"]))
    configuration = configuration_in(folder)
    if robot is not None:
        if line["arm"] not in {one.name for one in configuration.robots}:
            raise FileError(f"arm {line['arm']} comes with the package: leave `robot=` out")
        configuration = configuration.with_source(line["arm"], str(robot))
    check_unchanged(line["arm"], configuration.robots)
    source = configuration.source_of(line["arm"])
    one = Planned(line["split"], line["number"], line["arm"], line["individual"], episode, source)
    if not line["rows"]:
        return None, True
    trace, _ = simulated(one, with_residual=False)
    kept = next(iter(episodes_of(folder, [line])))
    fresh = stored(trace, PHYSICS_RATE // configuration.rate)
    same = all(
        np.array_equal(getattr(fresh, name), getattr(kept, name), equal_nan=True)
        for name in ("t", "q", "qd", "current", "q_des", "qd_des", "qdd_des")
    )
    truths = (given(fresh.truth), given(kept.truth))
    same &= np.array_equal(truths[0].tau_ext, truths[1].tau_ext)
    same &= [collision_line(c) for c in truths[0].collisions] == line["collisions"]
    return trace, bool(same)
