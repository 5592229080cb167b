"""Impulse and peak force after an alarm: how often their 90 % intervals hold, and how wide."""

from __future__ import annotations

from collections.abc import Sequence

from tauguard.detectors import Diagnosis
from tauguard.detectors.diagnosis.diagnosis_metrics import TrueSeverity, severity_figures
from tauguard.report import Row

NOTE = (
    "how often the interval that is said to hold 90 % of the true values does, of the collisions "
    "that raised an alarm; width: median of the upper end over the lower one; identifiable: that "
    "factor is 6 or less. Impulse [N s] and peak force [N] up to the end of the look."
)
#: A contact of one kind or link, what was said of it and what it was.
Sized = tuple[str, int, Diagnosis, TrueSeverity]


def severity_rows(sizes: Sequence[Sized]) -> list[Row]:
    """A row a kind and a row a link."""
    kinds = sorted({kind for kind, *_ in sizes})
    links = sorted({link for _, link, *_ in sizes})
    groups = [(kind, [s for s in sizes if s[0] == kind]) for kind in kinds]
    groups += [(f"link {link}", [s for s in sizes if s[1] == link]) for link in links]
    rows = []
    for name, some in groups:
        found = severity_figures([(said, true) for *_, said, true in some])
        row: Row = {"study": "severity", "group": name}
        for size in ("impulse", "peak"):
            row[f"{size}_held"] = found[f"{size}_held"]
            row[f"{size}_width"] = found[f"{size}_width"]["median"]
            row[f"{size}_identifiable"] = found[f"{size}_identifiable"]["value"]
        rows.append(row)
    return rows
