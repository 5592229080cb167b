"""The detection study on other arms: found, delay and false alarms, arm by arm.

Every arm is an individual of its robot: masses, gains and friction differ from what is believed. A
robot of whose friction neither its file nor its description says anything gets the losses of the
CURA6-like arm's drives, as shares of its torque limits: without losses any detector is good.
Payloads and torques of collisions are smaller on an arm with smaller torque limits.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from studies.detection.arm_scores import Extent, arm_scores
from studies.detection.fleet import Training
from studies.detection.pool import Conditions
from studies.detection.threshold_laws import ArmOutcome, judged
from studies.framework import JobCache, Workers
from tauguard.detectors import poisson_rate
from tauguard.detectors.evaluation.metrics import HEADLINE, delay_figures
from tauguard.models import cura6_drive, load_arm
from tauguard.models.arm import NAMED
from tauguard.report import Row
from tauguard.report import rate as wilson
from tauguard.report.charts import errorbars
from tauguard.traces import STRATA

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: The shipped detector, and others of which the first two read the same residual.
NAMES = ("srq-svr", "moving-thresholds", "residual-thresholds", "boosting")
#: The law of the product, and the false alarms per hour that its threshold aims at.
LAW, ASKED = "usual tail", 1.0

NOTE = (
    "One individual of each robot, thresholds from its own motion for one false alarm an hour. "
    "share: of the CURA6-like arm's largest torque limit, at most 1; payloads and torques are "
    "smaller by it. sensitivity: of the collisions from 16 N m times share up; all: from 4 N m "
    "times share up. Delays of the former [ms]. stated: false alarms per hour that the calibration "
    "alone allows (95 %)."
)

FULL = Extent(NAMES, Training(free=10), 0.3, 0.4, 1)
QUICK = Extent(NAMES[:3], Training(slices=6, free=4, free_seconds=20.0), 0.1, 0.1, 1)


def run(names: Sequence[str], quick: bool, seed: int, keep: str | None = None) -> list[Row]:
    """Rows ``robot``: one a robot and detector.

    Args:
        names: robots, by name or file.
        quick: six minutes of motion for the thresholds, and six more to judge.
        seed: of all arms and motions.
        keep: folder of what is done already.

    Raises:
        ValueError: a robot that cannot be used, or two of one name.
        FileNotFoundError: no such robot.
    """
    stems = [Path(name).stem for name in names]
    twice = next((stem for stem in stems if stems.count(stem) > 1), None)
    if twice is not None:
        raise ValueError(f"--robot: two arms are called {twice!r}; expected different file names")
    extent = QUICK if quick else FULL
    with _descriptions(keep) as folder, Workers() as each:
        unders = [conditions(name, folder) for name in names]
        kept = JobCache.of(keep, "detection_robots", seed, (extent, unders))
        jobs = [
            (replace(extent, under=under), seed, 61_000 + 100 * seed + k)
            for k, under in enumerate(unders)
        ]
        arms = list(kept.over(each, "robot")(arm_scores, jobs))
    return [
        _row(robot, under, name, judged([arm], name, LAW, ASKED).arms[0])
        for robot, under, arm in zip(names, unders, arms, strict=True)
        for name in extent.names
    ]


@contextlib.contextmanager
def _descriptions(keep: str | None) -> Iterator[Path]:
    """A folder for descriptions of robots: within ``keep``, else for this run only."""
    if keep is None:
        with TemporaryDirectory() as made:
            yield Path(made)
    else:
        folder = Path(keep, "robots").resolve()
        folder.mkdir(parents=True, exist_ok=True)
        yield folder


def conditions(name: str, folder: Path) -> Conditions:
    """Under which a robot is judged; a description with losses is written into ``folder``.

    The package's own arms and descriptions (TOML) are taken as they are.

    Raises:
        ValueError: a robot that cannot be used.
        FileNotFoundError: no such robot.
    """
    facts = load_arm(name).facts
    source = name
    if name not in NAMED and not name.lower().endswith(".toml"):
        own = str(Path(name).resolve()) if Path(name).is_file() else name
        described = folder / f"{Path(name).stem}.toml"
        described.write_text(f'file = {json.dumps(own)}\n[drive]\nlike = "cura6"\n')
        source = str(described)
        load_arm(source)  # its torque limits are known
    largest = float(facts.drive.torque_limit[:4].max())
    share = min(1.0, largest / float(cura6_drive().torque_limit.max()))
    return Conditions(robot=source, joints=len(facts.joints), share=share)


def _row(robot: str, under: Conditions, detector: str, found: ArmOutcome) -> Row:
    share = under.share
    hard = [delay for torque, delay in found.collisions if torque >= share * HEADLINE]
    every = [delay for torque, delay in found.collisions if torque >= share * STRATA[0][0]]
    delays = delay_figures(hard)
    return {
        "study": "robot",
        "robot": Path(robot).stem,
        "share": share,
        "detector": detector,
        "sensitivity": wilson(sum(d is not None for d in hard), len(hard)),
        "all": wilson(sum(d is not None for d in every), len(every)),
        "median_ms": delays["median"],
        "p95_ms": delays["p95"],
        "alarms_per_hour": poisson_rate(found.alarms, found.hours),
        "stated": "{:.2g} to {:.2g}".format(*found.stated),
    }


def draw(rows: list[Row], figure: Figure) -> None:
    """Found and false alarms by robot, with their intervals."""
    left, right = figure.subplots(1, 2)
    robots = list(dict.fromkeys(row["robot"] for row in rows))
    names = list(dict.fromkeys(row["detector"] for row in rows))
    for k, name in enumerate(names):
        own = [row for row in rows if row["detector"] == name]
        at = [robots.index(row["robot"]) + 0.15 * (k - (len(names) - 1) / 2) for row in own]
        struck = [(x, row["sensitivity"]) for x, row in zip(at, own, strict=True)]
        judged_ = [(x, rate) for x, rate in struck if rate["n"]]
        errorbars(left, [x for x, _ in judged_], (r for _, r in judged_), fmt="o", label=name)
        errorbars(right, at, (row["alarms_per_hour"] for row in own), fmt="o", label=name)
    right.axhline(ASKED, color="k", ls="--", label="aimed at")
    left.set(ylabel="found of the harder collisions", ylim=(0, 1.03))
    right.set(ylabel="false alarms per hour", yscale="symlog")
    for axis in (left, right):
        axis.set_xticks(range(len(robots)), robots)
        axis.grid(alpha=0.3)
    right.legend(fontsize=8)
