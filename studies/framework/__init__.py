"""The framework of all studies: parts, timings, summary, processes, job cache."""

from studies.framework.jobs import Each, JobCache, Workers
from studies.framework.pareto import draw_found
from studies.framework.rows import (
    Incomplete,
    Point,
    answer,
    groups,
    number,
    per,
    table_rows,
    time_in_turn,
    timed,
)
from studies.framework.study import Part, Study

__all__ = [
    "Each", "Incomplete", "JobCache", "Part", "Point", "Study", "Workers", "answer", "draw_found",
    "groups", "number", "per", "table_rows", "time_in_turn", "timed",
]  # fmt: skip
