"""The result of a comparison of checkers."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import mujoco

from tauguard.contacts.ground_truth import Pair
from tauguard.contacts.run import Run
from tauguard.findings import ArgumentError


@dataclass(frozen=True)
class Disagreement:
    """A difference between a checker and the ground truth."""

    checker: str
    kind: str  #: "missed": an event without a report; "false": a report without a touch
    time: float  #: [s]
    partners: tuple[str, str]
    depth: float  #: true depth of a missed event, or reported depth of a false one [m]

    def __str__(self) -> str:
        names = " and ".join(self.partners)
        return f"{self.checker} {self.kind}: {names}, {1e3 * self.depth:.3g} mm"


@dataclass(frozen=True)
class Outcome:
    """MuJoCo's handling of one event."""

    partners: tuple[str, str]
    onset: float  #: [s]
    end: float  #: [s]
    generated: bool  #: whether MuJoCo listed a contact of this pair during the event
    held: bool  #: whether the contact kept the partners from passing through each other


@dataclass(frozen=True)
class Score:
    """The score of one checker; ``None`` in a field: nothing to count, or no ground truth.

    Attributes:
        checker: Name of the checker.
        events: Number of true contacts, each from touch to separation, of pairs that the checker
            covers.
        recalled: Number of events reported during the event or within a step of it.
        reports: Number of reports; a report is a step and a pair that touches in it.
        correct: Number of reports that are true, or no deeper than the tolerance.
        steps: Number of touches: a step and a pair that gets deeper than the tolerance in it.
        steps_found: Number of these touches that were reported in the same step.
        delay_ms: Median time from the onset of an event to its first report [ms].
        first: Time of the first report of any pair [s].
        first_error_ms: ``first`` minus the time of the first contact in a run of MuJoCo with fine
            steps [ms]; ``None`` without such a run, or if the checker does not cover its pair.
        lead_ms: Median time by which a pair's first report is earlier than MuJoCo's [ms].
        depth_mm: Median difference from MuJoCo's depth at the same state [mm].
        normal_deg: Median angle to MuJoCo's normal [deg].
        normals: Number of compared normals.
        opposite: Number of normals at more than 90 degrees to MuJoCo's.
        us_per_step: Median processor time of a call [us].
        us_low: 10 % quantile of the processor time [us].
        us_high: 90 % quantile of the processor time [us].
        over_mj_step: Median processor time of a call divided by that of ``mj_step``.
        not_covered: Number of reported contacts of pairs outside ``covers``, which are not counted.
        disagreements: Differences from the ground truth, in order of time.
    """

    checker: str
    events: int | None = None
    recalled: int | None = None
    reports: int | None = None
    correct: int | None = None
    steps: int | None = None
    steps_found: int | None = None
    delay_ms: float | None = None
    first: float | None = None
    first_error_ms: float | None = None
    lead_ms: float | None = None
    depth_mm: float | None = None
    normal_deg: float | None = None
    normals: int = 0
    opposite: int = 0
    us_per_step: float = 0.0
    us_low: float = 0.0
    us_high: float = 0.0
    over_mj_step: float = 0.0
    not_covered: int = 0
    disagreements: tuple[Disagreement, ...] = ()

    @property
    def recall(self) -> float | None:
        """Fraction of the events that were reported."""
        return self.recalled / self.events if self.events and self.recalled is not None else None

    @property
    def precision(self) -> float | None:
        """Fraction of the reports that are correct."""
        return self.correct / self.reports if self.reports and self.correct is not None else None


@dataclass(frozen=True)
class Report:
    """The comparison of several checkers on one run of a scene.

    It prints as a table with one line per checker; :class:`Score` explains the columns.

    Attributes:
        scene: Name of the scene.
        timestep: [s].
        steps: Number of steps.
        scores: One score per checker.
        outcomes: MuJoCo's handling of every event, in order of onset.
        disagreements: Differences of all checkers from the ground truth.
        first_contact: The scene's first contact in a finely stepped run of MuJoCo [s].
        step_us: Median processor time of ``mj_step`` [us].
        state_us: Median processor time of :meth:`State.of`, once per step for all checkers [us].
        run: States and contacts, if they were kept.
    """

    scene: str
    timestep: float
    steps: int
    scores: tuple[Score, ...]
    outcomes: tuple[Outcome, ...]
    first_contact: float | None
    disagreements: tuple[Disagreement, ...]
    step_us: float
    state_us: float
    run: Run | None = None

    def recording(self) -> dict[str, Any]:
        """Keyword arguments of :func:`tauguard.replay.contacts.write_contacts_rrd`.

        Raises:
            ArgumentError: the states were not kept.
        """
        if self.run is None:
            raise ArgumentError("the states were not kept; call compare(..., keep=True)")
        return {**self.run.recording(), "notes": [(d.time, str(d)) for d in self.disagreements]}

    def __getitem__(self, checker: str) -> Score:
        for score in self.scores:
            if score.checker == checker:
                return score
        raise KeyError(f"{checker!r}: expected one of {', '.join(s.checker for s in self.scores)}")

    def rows(self) -> list[dict[str, Any]]:
        """One flat dictionary per checker."""
        skip = {"disagreements", "checker"}
        return [
            {
                "scene": self.scene,
                "timestep_ms": 1e3 * self.timestep,
                "checker": score.checker,
                "precision": score.precision,
                "recall": score.recall,
                **{f.name: getattr(score, f.name) for f in fields(score) if f.name not in skip},
                "mj_step_us": self.step_us,
            }
            for score in self.scores
        ]

    def __str__(self) -> str:
        shown = ["checker", "precision", "recall", "events", "delay_ms", "lead_ms", "depth_mm"]
        shown += ["normal_deg", "us_per_step", "over_mj_step"]
        table = [shown] + [[_cell(row[name]) for name in shown] for row in self.rows()]
        widths = [max(len(line[i]) for line in table) for i in range(len(shown))]
        lines = [
            "  ".join(cell.ljust(w) for cell, w in zip(line, widths, strict=True)).rstrip()
            for line in table
        ]
        missed = sum(not o.generated for o in self.outcomes)
        lost = sum(not o.held for o in self.outcomes)
        lines.append(
            f"{self.scene}: {self.steps} steps of {1e3 * self.timestep:g} ms, mj_step takes "
            f"{self.step_us:.0f} us; true contacts: {len(self.outcomes)}, of which "
            f"MuJoCo did not list {missed} and did not hold {lost}"
        )
        lines += [
            f"{one.checker}: {one.not_covered} contacts of pairs that it does not cover, "
            "not counted"
            for one in self.scores
            if one.not_covered
        ]
        lines += [
            f"{one.checker}: {one.opposite} of {one.normals} normals are opposite to MuJoCo's; a "
            "normal points from the first partner to the second"
            for one in self.scores
            if one.opposite
        ]
        return "\n".join(lines + _by_partners(self.disagreements))


def _by_partners(disagreements: Sequence[Disagreement]) -> list[str]:
    """One line per checker, kind and pair: the first disagreement, and the number of others."""
    found: dict[tuple[Any, ...], list[Disagreement]] = defaultdict(list)
    for one in disagreements:
        found[one.checker, one.kind, one.partners].append(one)
    return [
        f"{same[0].time:8.4f} s  {same[0]}"
        + (f", and {len(same) - 1} more" if len(same) > 1 else "")
        for same in found.values()
    ]


def pair_names(model: Any, pair: Pair) -> tuple[str, str]:
    """Names of the partners, such as ``body forearm`` and ``flex sheet``."""
    types = {"body": mujoco.mjtObj.mjOBJ_BODY, "flex": mujoco.mjtObj.mjOBJ_FLEX}
    first, second = (
        f"{kind} {mujoco.mj_id2name(model, types[kind], number) or number}" for kind, number in pair
    )
    return first, second


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    return f"{round(value, 5) + 0.0:.3g}" if isinstance(value, float) else str(value)
