"""Contacts: checkers beside MuJoCo's own contacts, and guarded steps."""

from collections.abc import Iterator, Sequence

from studies.framework import Part, Point, Study, groups, number, table_rows
from tauguard.report import Row

STUDY = Study(
    "contact checkers and guarded steps: missed contacts, delays and computing time",
    {
        "checkers": Part(
            "contacts.checkers",
            "contact checkers and MuJoCo's contacts: contacts found, delays and computing time",
        ),
        "guard": Part(
            "contacts.guard",
            "random scenes with guarded steps, with MuJoCo's modes and with short fixed steps",
            ("keep",),
            alias="guard",
        ),
        "handling": Part(
            "contacts.handling",
            "a bin, belts and a gripper: guarded steps beside plain and fine steps",
            alias="handling",
        ),
    },
)
#: Methods whose names begin with one of these are peers.
PEERS = ("MuJoCo", "mujoco", "plain", "speculative", "ipc")


def points(rows: Sequence[Row]) -> Iterator[Point]:
    """The error of the first reported contact, and the fraction of scenes with tunnelling."""
    question = "Contact checkers: when the first contact is reported"
    axes = ("microseconds per step", "error of the first report [ms]")
    for row in table_rows(rows, "scenes"):
        cost, error = number(row.get("us_per_step")), number(row.get("first_error_ms"))
        if cost and error is not None:
            role = "peer" if row["checker"].startswith(PEERS) else ""
            yield Point(question, row["checker"], cost, abs(error), "", role, *axes)
    question = "Steps over fast contacts, random scenes"
    axes = ("time / time of the longest safe fixed step", "fraction of scenes with tunnelling")
    thrown = [row for row in table_rows(rows, "thrown") if row["timestep_ms"] == "all"]
    for method, own in groups(thrown, lambda row: str(row["method"])).items():
        known = [row["over_fixed"] for row in own if row["over_fixed"] is not None]
        n = sum(row["held"]["n"] for row in own)
        if known and n:
            lost = 1 - sum(row["held"]["value"] * row["held"]["n"] for row in own) / n
            role = "peer" if method.startswith(PEERS) else "ours" if method == "guarded" else ""
            yield Point(question, method, sum(known) / len(known), lost, "", role, *axes)
