"""The table of the manual's page on the benchmark: ``python -m studies.real_arms.page`` prints it.

A column is a group of contacts with a truth that counts; the numbers are those of ``table.csv``.
"""

import csv
from collections.abc import Sequence

from studies.real_arms.table import FILE, POINTS
from tauguard.benchmark.submission import ranking

#: The columns: arm, truth and state of a group, and its heading.
GROUPS = {
    ("panda_touch", "switch", "standing"): "Panda, switch, of 122",
    ("ur5", "sensor", "standing"): "UR5 at rest, sensor, of 8",
    ("ur5", "same program", "moving"): "UR5 moving, of 9",
    ("ur5", "same program", "standing"): "UR5 at rest, of 1",
}


def table() -> list[dict[str, str]]:
    """The rows of the committed table."""
    with FILE.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def lines(rows: Sequence[dict[str, str]], point: str = POINTS[1][0]) -> list[str]:
    """The page's table at an operating point as Markdown, methods in the order of their rank."""
    own = {
        (row["method"], row["arm"], row["truth"], row["state"]): row
        for row in rows
        if row["operating point"] == point
    }
    head = ["method", *GROUPS.values(), "beyond chance", "false alarms an hour (95 %)"]
    out = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for ranked in ranking(list(rows), point):
        cells = [ranked["method"]]
        for group in GROUPS:
            row = own.get((ranked["method"], *group))
            chance = row and float(row["by chance"]) * int(row["contacts"])
            cells.append(f"{row['found']} ({chance:.1f})" if row else "-")
        cells += [ranked["beyond chance"], ranked["false per hour"]]
        out.append("| " + " | ".join(cells) + " |")
    return out


if __name__ == "__main__":
    print("\n".join(lines(table())))
