"""Permissible speeds along a program, for each segment of motion and each body region."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tauguard.detectors import RobotNumbers
from tauguard.detectors.dynamics.same_arm import arm_difference
from tauguard.findings import ArgumentError, Findings, MismatchError, note
from tauguard.models import BODY_REGIONS, BodyRegion, Robot, pin_model
from tauguard.results import Result, Row, finding_rows
from tauguard.speed.arm_states import ContactArm
from tauguard.speed.detection_delay import DelayModel
from tauguard.speed.program import Program
from tauguard.speed.reaction import Stop
from tauguard.speed.search import Search, SpeedLimit, SpeedOptions
from tauguard.speed.tool import Cover, Tool
from tauguard.traces import Trace

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class SpeedLimits(Result):
    """Permissible speeds along a program."""

    program: Program
    robot: str
    tool: Tool
    stop: Stop
    limits: tuple[SpeedLimit, ...]
    segments: tuple[tuple[float, float], ...]  #: first and last time of each segment [s]
    detection: str  #: how the delay is found, as text
    margin: float  #: forces and pressures are kept below the limit over this factor
    findings: Findings = field(default_factory=Findings)

    def rows(self) -> list[Row]:
        """One row for each segment and region."""
        return [
            {
                "segment": limit.segment,
                "t [s]": round(limit.t, 2),
                "region": limit.region,
                "point": "tool" if limit.link == 0 else f"link {limit.link}",
                "programmed [m/s]": round(limit.programmed, 3),
                "mass [kg]": round(limit.mass, 2),
                "free [m/s]": round(limit.free, 3),
                "clamped, no stop [m/s]": round(limit.undetected, 3),
                "permissible [m/s]": round(limit.permissible, 3),
                "limited by": limit.limited_by,
                "delay [ms]": round(1e3 * limit.delay, 1) if np.isfinite(limit.delay) else None,
                "scale": round(limit.scale, 3),
            }
            for limit in self.limits
        ]

    def slow_down(self) -> dict[int, float]:
        """Factor on the speed of each segment that exceeds a limit, by the segment's number."""
        scales: dict[int, float] = {}
        for limit in self.limits:
            if limit.scale < 1:
                scales[limit.segment] = min(scales.get(limit.segment, 1.0), limit.scale)
        return scales

    @property
    def reacts(self) -> bool:
        """Whether a detector or a delay starts a reaction."""
        return not self.detection.startswith("none")

    def plot(self) -> Figure:
        """Programmed and permissible speed along the program, as a matplotlib figure."""
        from tauguard.speed.page import figure

        return figure(self)

    def write_page(self, path: str | Path) -> None:
        """Write a printable page (HTML): assumptions, picture, table."""
        from tauguard.speed.page import write_page

        write_page(self, path)

    @property
    def worst_simulated(self) -> float:
        """Largest force over its limit of all simulated cases; NaN: none was simulated."""
        ratios = [limit.simulated for limit in self.limits if np.isfinite(limit.simulated)]
        return max(ratios, default=float("nan"))

    def to_dict(self) -> dict[str, Any]:
        """JSON values: rows, segments, factors, assumptions and findings."""
        return {
            "name": "speed",
            "program": self.program.name,
            "robot": self.robot,
            "tool": str(self.tool),
            "stop": str(self.stop),
            "detection": self.detection,
            "margin": self.margin,
            "seconds": self.program.seconds,
            "segments": [list(times) for times in self.segments],
            "rows": self.rows(),
            "slow_down": self.slow_down(),
            "worst_simulated": None if np.isnan(self.worst_simulated) else self.worst_simulated,
            "findings": finding_rows(self.findings),
        }

    def __repr__(self) -> str:
        """One line."""
        slow = len(self.slow_down())
        return (
            f"SpeedLimits({self.program.name}: {len(self.segments)} segments, "
            f"{slow} of them too fast)"
        )

    def text(self) -> str:
        """Assumptions and findings, the lowest regions of each segment, what to slow down."""
        from tauguard.speed.page import text

        return text(self)

    def __str__(self) -> str:
        return self.text()


def speed_limits(
    program: Program | Trace | Any,
    robot: str | Path | Robot | None = None,
    *,
    tool: Tool | str = "flat:1.0",
    stop: Stop | None = None,
    delay: float | None = None,
    detector: Any = None,
    cover: Cover | str | None = None,
    contact: Mapping[str, str] | None = None,
    regions: Mapping[str, BodyRegion] | None = None,
    person_speed: float = 0.0,
    margin: float = 1.0,
    check: bool = True,
    options: SpeedOptions | None = None,
) -> SpeedLimits:
    """How fast a robot may move along a program beside a person.

    For each segment of motion and each body region the speed is found at which neither the first
    peak of the contact's force, nor the force that lasts, nor the pressure exceeds its limit
    (ISO/TS 15066:2016, annex A), at the point of the arm and in the direction of the contact that
    are worst. A detector or a delay decides when the robot reacts. Every result is an estimate.

    Args:
        program: a :class:`Program`, a trace or a log.
        robot: name, file or description of the arm, see :func:`tauguard.models.load_arm` (default:
            the log's).
        tool: the face that touches, see :meth:`Tool.parse`.
        stop: the reaction (default: ``Stop()``, category 2 along the set point at 10 rad/s2).
        delay: from the first touch to the reaction [s]. None: the detector's, or no reaction.
        detector: a trained detector, whose own alarm starts the reaction.
        cover: a soft cover, see :meth:`Cover.parse`.
        contact: "free" or "clamped" by region (default: clamped).
        regions: limits by region (default: :data:`tauguard.models.BODY_REGIONS`).
        person_speed: speed of the person towards the robot in free contact [m/s].
        margin: keep forces and pressures below the limits over this factor.
        check: simulate binding cases in MuJoCo.
        options: settings of the search.

    Raises:
        ArgumentError: arguments out of range or that exclude each other.
        MismatchError: program, robot and detector do not belong together.
    """
    settings = options or SpeedOptions()
    if delay is not None and detector is not None:
        raise ArgumentError("give `delay=` or `detector=`, not both")
    if not isinstance(robot, str | Path | Robot | None):
        raise ArgumentError(
            f"robot: {type(robot).__name__}; expected a name, a file or a Robot (a calibration is "
            "a file after its `save`)"
        )
    if not isinstance(stop, Stop | None):
        raise ArgumentError(f"stop: {stop!r:.40}; expected a `Stop`, such as Stop(category=2)")
    if isinstance(detector, str | Path):
        raise ArgumentError("detector: a file; expected what `tauguard.load_detector` returns")
    if delay is not None and not delay >= 0:
        raise ArgumentError(f"delay {delay} s: expected 0 or more")
    if not margin >= 1:
        raise ArgumentError(f"margin {margin}: expected 1 or more")
    if not 0 <= person_speed <= 10:
        raise ArgumentError(f"person_speed {person_speed} m/s: expected 0 to 10")
    chain = getattr(program, "robot", None) if robot is None else robot
    if chain is None:
        raise ArgumentError("`robot=` is missing: give the name or the file of the arm")
    source = chain if isinstance(chain, Robot) else str(chain)
    face = Tool.parse(tool) if isinstance(tool, str) else tool
    soft = Cover.parse(cover) if isinstance(cover, str) else cover
    known = dict(BODY_REGIONS if regions is None else regions)
    chosen = _chosen(contact or {}, known)
    motion = program if isinstance(program, Program) else _program(program)
    arm = ContactArm.of(source, face, points=settings.points)
    motion = _in_order(motion, arm)
    search = Search(
        motion, arm, face, stop or Stop(), soft, known, chosen, person_speed, margin, settings,
        float("inf") if delay is None else delay,
        None if detector is None else _delay_model(detector, motion, arm),
    )  # fmt: skip
    limits, segments = search.run()
    findings = search.findings()
    if check and limits:
        limits = search.simulated(limits)
        worst = max((x.simulated for x in limits if x.simulated > 0), default=0.0)
        if worst > 1.02:
            text = (
                f"in MuJoCo, forces at the permissible speed reach {worst:.2f} of the limits over "
                f"the margin; give `margin={margin * worst:.2f}`"
            )
            findings = Findings((*findings, note("check", text)))
    return SpeedLimits(
        motion, source if isinstance(source, str) else source.file, face, search.stop,
        tuple(limits), tuple(segments), search.detection, margin, findings,
    )  # fmt: skip


def _program(source: Any) -> Program:
    trace = source if isinstance(source, Trace) else getattr(source, "trace", None)
    if not isinstance(trace, Trace):
        raise ArgumentError(
            f"program: {type(source).__name__}; expected a Program, a trace or a log"
        )
    return Program.from_trace(trace, getattr(source, "name", "trace"))


def _chosen(contact: Mapping[str, str], regions: Mapping[str, BodyRegion]) -> dict[str, bool]:
    """Whether each region is clamped."""
    for name, how in contact.items():
        if name not in regions or how not in ("free", "clamped"):
            raise ArgumentError(
                f"contact {name}={how}: expected a region ({', '.join(regions)}) and free or "
                "clamped"
            )
    return {name: contact.get(name, "clamped") == "clamped" for name in regions}


def _in_order(program: Program, arm: ContactArm) -> Program:
    """The program with its joints in the arm's order."""
    wanted, names = arm.scene.joint_names, program.joint_names
    if len(names) != len(wanted):
        raise MismatchError(
            f"{program.name} has {len(names)} joints ({', '.join(names)}), the robot has "
            f"{len(wanted)} ({', '.join(wanted)})"
        )
    if set(names) != set(wanted) or names == wanted:  # other names: the order is the robot's
        return program
    order = [names.index(name) for name in wanted]
    return replace(program, joint_names=wanted, q=program.q[:, order], qd=program.qd[:, order])


def _delay_model(detector: Any, program: Program, robot: ContactArm) -> DelayModel:
    alarm = getattr(detector, "alarm", detector)
    if program.trace is None:
        raise ArgumentError(
            "`detector=` needs a log with motor currents; for waypoints give `delay=`"
        )
    numbers = RobotNumbers.from_pin(pin_model(robot.scene.arm_model))
    if difference := arm_difference(numbers, alarm.detector.arm.robot):
        raise MismatchError(f"the detector was trained on another arm: {difference}")
    arm, trace = alarm.detector.arm, program.trace
    names, order = arm.robot.joint_names, range(len(trace.joint_names))
    if set(names) == set(trace.joint_names):
        order = [trace.joint_names.index(name) for name in names]  # type: ignore[assignment]
    columns = list(order)
    q, qd, current = (
        np.ascontiguousarray(signal[:, columns]) for signal in (trace.q, trace.qd, trace.current)
    )
    if len(names) != len(columns):
        names = trace.joint_names  # refused by the model, which names both
    matched = Trace(names, trace.t, q, qd, current, meta=trace.meta)
    return DelayModel(alarm, matched)
