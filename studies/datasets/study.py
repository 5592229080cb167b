"""Generation of datasets: rate and where it goes, bytes, reading and memory."""

from __future__ import annotations

from typing import TYPE_CHECKING

from studies.datasets.files import memory_rows, size_rows
from studies.datasets.rates import PARTS, rate_rows
from tauguard.report import Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: What the columns mean.
NOTES = {
    "rate": "Episodes of tauguard-collisions-v1 under another seed; processor time of one core, 1 "
    "kHz, observer and writing included. us: a sample of each part; steps include the tries of a "
    "collision until its severity is the one asked for. rollout: mujoco.rollout on the same scene "
    "from the same states, without drives, servo, contacts' recording or labels; away: how far it "
    "gets from the motion in 0.1 s.",
    "size": "MB (1e6 bytes) an hour of tauguard-collisions-v1 under another seed.",
    "read": "MB of float32 a second, one column of one shard, median of 7.",
    "memory": "Peak resident memory [MiB] of the command and of the largest of two workers; "
    "episodes of 1 s, 20 a shard.",
}


def measure(quick: bool, seed: int) -> list[Row]:
    """All rows; the quick run has few episodes."""
    return [
        *rate_rows(quick, seed),
        *size_rows(quick, seed),
        *memory_rows(quick, seed),
    ]


def draw(rows: list[Row], figure: Figure) -> None:
    """Where the time of a sample goes, and bytes an hour."""
    left, right = figure.subplots(1, 2)
    timed = [row for row in rows if row["study"] == "rate" and f"{PARTS[0]} [us]" in row]
    names, bottom = [str(row["episodes"]) for row in timed], [0.0] * len(timed)
    for part in PARTS:
        values = [float(str(row[f"{part} [us]"])) for row in timed]
        left.bar(names, values, bottom=bottom, label=part)
        bottom = [b + v for b, v in zip(bottom, values, strict=True)]
    for k, row in enumerate(timed):
        left.hlines(float(str(row["rollout [us]"])), k - 0.4, k + 0.4, "black", "dashed")
    left.axhline(1000 / 60, color="grey", linewidth=1)
    left.set(ylabel="us a sample", title="grey: 60 x real time; dashed: rollout")
    left.set_xlim(-0.6, 2.2 * len(timed) - 1)
    left.legend(loc="upper right")
    sizes = [row for row in rows if row["study"] == "size"]
    labels = [str(row["rows a second"]) for row in sizes]
    right.barh(labels, [float(str(row["MB an hour"])) for row in sizes])
    right.invert_yaxis()
    right.set(xlabel="MB an hour")
