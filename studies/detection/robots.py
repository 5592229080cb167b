"""Any robot: what detectors find on it, how soon, and their false alarms.

Every arm is an individual of its robot: masses, gains and friction differ from the nominal ones. If
neither file nor description states a robot's friction, it gets the losses of the CURA6-like arm's
drives, as fractions of its torque limits, because any detector is good on an arm without losses.
Payloads and torques of collisions are smaller on an arm with smaller torque limits.
"""

import contextlib
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from studies.detection.motions import Conditions, Training
from studies.detection.rates import AIMED, Size, arm_tallies, collisions, point
from studies.framework import JobCache, Workers, draw_found, groups
from tauguard.models import cura6_drive, load_arm
from tauguard.models.arm import NAMED
from tauguard.report import Row

#: The shipped detector, thresholds on the same residual, and thresholds on another residual.
NAMES = ("srq-svr", "moving-thresholds", "residual-thresholds")
#: False alarms per hour that the thresholds aim at.
ASKED = 1.0

NOTES = {
    "robot": "one individual of each robot, with thresholds from its own motion for one false "
    "alarm per hour. share: largest torque limit / that of the CURA6-like arm, at most "
    "1; payloads and torques are multiplied by it. sensitivity: of collisions from 16 N m "
    "times share up; all: from 4 N m times share up. Delays: collisions of `sensitivity` [ms].",
}

FULL = Size(1, NAMES, (ASKED,), Training(free=10), 0.3, 0.4, 1)
LITTLE = Training(slices=6, free=4, free_seconds=20.0)
QUICK = Size(1, NAMES[:3], (ASKED,), LITTLE, 0.1, 0.1, 1)


def measure(quick: bool, seed: int, robot: str | None = None, keep: str | None = None) -> list[Row]:
    """Rows ``robot``: one per robot and detector (default: the package's arms; quick: one)."""
    own = NAMED[1:2] if quick else NAMED
    names = list(own) if robot is None else [name.strip() for name in robot.split(",")]
    stems = [Path(name).stem for name in names]
    twice = next((stem for stem in stems if stems.count(stem) > 1), None)
    if twice is not None:
        raise ValueError(f"--robot: two arms are called {twice!r}; expected different file names")
    size = QUICK if quick else FULL
    with _descriptions(keep) as folder, Workers() as each:
        unders = [conditions(name, folder) for name in names]
        cache = JobCache.of(keep, "detection_robots", seed, (size, unders))
        jobs = [
            (replace(size, under=under), seed, 61_000 + 100 * seed + k)
            for k, under in enumerate(unders)
        ]
        arms = list(cache.over(each, "robot")(arm_tallies, jobs))
    return [
        {"study": "robot", "robot": stem, "share": under.share, "detector": detector}
        | collisions(arm[detector, point(AIMED, ASKED)], under.share)
        for stem, under, arm in zip(stems, unders, arms, strict=True)
        for detector in size.names
    ]


def draw(rows: list[Row], figure: Any) -> None:
    """Fraction of the harder collisions that is found, by robot and detector."""
    known = groups([row for row in rows if row["sensitivity"]["n"]], lambda row: row["robot"])
    panels = {k: {row["detector"]: row["sensitivity"] for row in own} for k, own in known.items()}
    draw_found(panels, figure)


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
    """Conditions of a robot's test; a file of the robot with losses is written into ``folder``.

    The package's own arms and descriptions (TOML) are taken as they are.
    """
    facts = load_arm(name).facts
    source = name
    if name not in NAMED and not name.lower().endswith(".toml"):
        own = str(Path(name).resolve()) if Path(name).is_file() else name
        described = folder / f"{Path(name).stem}.toml"
        described.write_text(f'file = {json.dumps(own)}\n[drive]\nlike = "cura6"\n')
        source = str(described)
        load_arm(source)  # raises if the torque limits are not known
    largest = float(facts.drive.torque_limit[:4].max())
    share = min(1.0, largest / float(cura6_drive().torque_limit.max()))
    return Conditions(robot=source, joints=len(facts.joints), share=share)
