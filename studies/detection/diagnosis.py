"""Errors of the diagnosis after an alarm: link, force, point and kind of the event.

Four methods are compared on the same alarms. ``surface``: every point of the arm's surface is a
hypothesis. ``exposed``: the same without the points of link 1, which nothing can reach. ``usual``,
for comparison: the link of the last joint with a significant residual, and the damped least-squares
force at the middle of that link. ``exact``: ``surface`` with the true external torque; the
remaining errors are due to other contacts that explain the same torques.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from studies.detection.events import Event, payload_events, push_events, struck_events
from studies.detection.motions import CALIBRATE, SPEEDS, TEST, Training, free_pool, stream
from studies.framework import groups, per, time_in_turn
from tauguard.arrays import Array
from tauguard.detectors import CollisionAlarm, Diagnoser, Diagnosis, make_detector
from tauguard.detectors.alarms.training import with_rate
from tauguard.detectors.calibration.nominal import nominal_design
from tauguard.detectors.diagnosis.classification import KINDS
from tauguard.detectors.diagnosis.contact_force import link_poses, point_jacobians
from tauguard.detectors.diagnosis.post_alarm import PostAlarmWindow, PostAlarmWindows
from tauguard.detectors.evaluation.diagnosis_metrics import (
    ContactErrors,
    TrueSeverity,
    contact_at,
    severity_figures,
)
from tauguard.envs import simulate
from tauguard.models import LinkSurface, cura6, link_surface
from tauguard.report import Row, rate
from tauguard.report.charts import errorbars
from tauguard.traces import STRATA, Collision, stratum

#: The detector whose alarms are explained, and its false alarms per hour.
DETECTOR, PER_HOUR = "moving-thresholds", 5.0
#: Force for which the damping of the usual method is chosen [N].
EXPECTED = 100.0
METHODS = ("surface", "exposed", "usual", "exact")
#: Links that collisions of these plans may be on, as ``exposed`` assumes.
EXPOSED = (2, 3, 4, 5, 6)

_ALARMS = (
    "over the collisions that raised an alarm. Methods: surface is tauguard's; exposed: the same "
    "without link 1; usual, the peer: last joint with a residual, damped least squares at the "
    "middle of its link; exact: surface with the true torque, a bound for every observer. "
)
#: What the columns of each table mean.
NOTES = {
    "link": "rates " + _ALARMS + "Missed collisions do not count.",
    "contact": "medians and 95th percentiles " + _ALARMS + "force_error_n: norm of the difference.",
    "kind": "counts: one row for each true kind, one column for each diagnosed kind. All "
    "events are simulated, also the pushes.",
    "payload": "loads that are picked up and put down, unknown to the detector. mass_error_g: "
    "median error of the loads not diagnosed as a collision.",
    "severity": "of the collisions that raised an alarm. held: fraction whose 90 % interval "
    "contains the true value; width: median of upper / lower end; identifiable: fraction with a "
    "width of 6 or less. Impulse [N s] and peak force [N] of the window.",
    "cost": "wall time of the diagnosis of one alarm; aftermath_us: computation of the residual "
    "around the alarm, included.",
}


@dataclass(frozen=True)
class Size:
    """Amount of simulated motion."""

    arms: int
    speeds: tuple[float, ...]
    training: Training
    calibration_hours: float  #: motion per arm from which the threshold is set
    per_stratum: int  #: collisions per stratum and speed
    pushes: int  #: episodes per speed, with five pushes each
    payloads: int  #: episodes per speed in which a payload is picked up and put down


FULL = Size(3, SPEEDS, Training(slices=3), 0.3, 13, 3, 8)
QUICK = Size(1, (10.0, 60.0), Training(slices=1, free=6, free_seconds=20.0), 0.02, 2, 1, 2)


#: Answer of a method: the link (1-based, 0: none), the force [N] and the point [m].
Answer = tuple[int, Array, Array]


@dataclass(frozen=True)
class Judged:
    """One event, and the answers of all methods if it raised an alarm.

    The trace is not kept, because many traces would fill the memory.
    """

    kind: str
    speed: float  #: joint speed [% of the maximum]
    collision: Collision | None
    mass: float  #: change of the payload [kg]; 0 for a contact
    diagnosis: Diagnosis | None
    links: dict[str, int]  #: link that each method names, 1-based; 0: none
    errors: dict[str, ContactErrors]
    severity: TrueSeverity | None = None


def measure(quick: bool, seed: int) -> list[Row]:
    """Rows of the studies that :data:`NOTES` names."""
    size = QUICK if quick else FULL
    # No setting was tuned on these arms and seeds.
    arms = [31_000 + 100 * seed + k for k in range(size.arms)]
    trained = {arm: trained_for(seed, arm, size) for arm in arms}
    surface = link_surface(cura6.arm_xml())
    judged: list[Judged] = []
    sample: Event | None = None
    for speed in size.speeds:
        test = stream(seed, TEST, 5)
        for events in (
            struck_events(test, speed, trained, size.per_stratum),
            push_events(test, speed, trained, size.pushes),
            payload_events(test, speed, trained, size.payloads),
        ):
            for event in events:
                judged.append(answered(event, trained[event.arm], surface))
                sample = sample or (event if event.alarm is not None else None)
    contacts = [j for j in judged if j.collision is not None]
    rows = [*link_rows(contacts), *contact_rows(contacts)]
    rows += [*severity_rows(contacts), *kind_rows(judged), *payload_rows(judged)]
    assert sample is not None
    return [*rows, cost_row(sample, trained[sample.arm], surface)]


def trained_for(seed: int, arm: int, size: Size) -> CollisionAlarm:
    """The detector of one arm; training and threshold use motion of this arm."""
    detector = make_detector(DETECTOR).fit(size.training.traces(seed, arm), nominal_design())
    hours = size.calibration_hours / len(size.speeds)
    pools = (free_pool(stream(seed, CALIBRATE, 5), s, (arm,), hours) for s in size.speeds)
    return with_rate(detector, [simulate(e) for pool in pools for _, e in pool], PER_HOUR)


def answered(event: Event, trained: CollisionAlarm, surface: LinkSurface) -> Judged:
    """All methods' answers to one event."""
    known = (event.kind, event.speed, event.collision, event.mass)
    if event.alarm is None:
        return Judged(*known, None, {}, {})
    diagnoser = Diagnoser.of(trained.detector.arm, surface)
    after = PostAlarmWindows(diagnoser.arm, diagnoser.noise_model, event.trace).at(
        event.alarm.start
    )
    found = diagnoser.explain(event.alarm, after)
    if event.collision is None:
        return Judged(*known, found, {}, {})
    assert event.trace.truth is not None
    exact = replace(after, residual=event.trace.truth.tau_ext[after.rows])
    informed = diagnoser.explain(event.alarm, exact)
    exposed = replace(diagnoser, surface=surface.only(EXPOSED)).explain(event.alarm, after)
    own = {"surface": found, "exposed": exposed, "exact": informed}
    answers = {name: (one.link, one.force, one.point) for name, one in own.items()}
    answers["usual"] = usual(diagnoser, after, found)
    truth = contact_at(event.trace, event.collision, found.time)
    errors = {n: ContactErrors.of(force, at, truth) for n, (_, force, at) in answers.items()}
    true = TrueSeverity.of(event.trace, event.collision, found.until)
    return Judged(*known, found, {n: a[0] for n, a in answers.items()}, errors, true)


def usual(diagnoser: Diagnoser, after: PostAlarmWindow, found: Diagnosis) -> Answer:
    """The last joint with a residual; damped least-squares force at the middle of its link."""
    robot, link = diagnoser.arm.robot, max(found.last_joint, 1) - 1
    row = int(after.level.argmax())
    poses = link_poses(robot, after.q[row])
    rows = diagnoser.surface.link == link
    middle = diagnoser.surface.point[rows].mean(axis=0)
    point = poses.origin[link] + poses.rotation[link] @ middle
    jacobian = point_jacobians(robot, poses, np.array([link]), point[None])[0]
    columns = jacobian.T / after.deviation[row][:, None]
    damped = columns.T @ columns + np.eye(3) / EXPECTED**2
    force = np.linalg.solve(damped, columns.T @ (after.residual[row] / after.deviation[row]))
    return found.last_joint, force, point


def by_group(contacts: Sequence[Judged]) -> list[tuple[str, list[Judged]]]:
    """Groups of the events that raised an alarm: all, by speed, and by severity."""
    known = [j for j in contacts if j.diagnosis is not None and j.kind != "push"]
    speeds = sorted({j.speed for j in known})
    named = [("all", known)]
    named += [(f"{s:g} %", [j for j in known if j.speed == s]) for s in speeds]
    for low, _ in STRATA:
        name = stratum(low)
        named.append((f"{name} N m", [j for j in known if stratum(_peak(j)) == name]))
    named.append(("from 16 N m", [j for j in known if _peak(j) >= 16]))
    pushes = [j for j in contacts if j.diagnosis is not None and j.kind == "push"]
    return [(name, some) for name, some in [*named, ("pushes", pushes)] if some]


def _peak(judged: Judged) -> float:
    assert judged.collision is not None
    return judged.collision.peak_tau


def _link(judged: Judged) -> int:
    assert judged.collision is not None
    return judged.collision.link


def link_rows(contacts: Sequence[Judged]) -> list[Row]:
    """How often the link is right, and how often it is right or off by one."""
    rows: list[Row] = []
    for group, some in by_group(contacts):
        for method in METHODS:
            off = [abs(j.links[method] - _link(j)) for j in some]
            row: Row = {"study": "link", "group": group, "method": method}
            row["link_right"] = rate(sum(o == 0 for o in off), len(off))
            row["link_or_neighbour"] = rate(sum(o <= 1 for o in off), len(off))
            rows.append(row)
    return rows


def contact_rows(contacts: Sequence[Judged]) -> list[Row]:
    """Errors of force and point at the time of the estimated force: median and p95."""
    rows = []
    names = ("true_force_n", "force_error_n", "direction_deg", "point_cm")
    for group, some in by_group(contacts):
        for method in METHODS:
            own = [j.errors[method] for j in some]
            errors = np.array([(e.true_force, e.force, e.direction, 100 * e.point) for e in own])
            row: Row = {"study": "contact", "group": group, "method": method, "n": len(some)}
            for name, column in zip(names, errors.T, strict=True):
                row[name] = float(np.median(column))
                row[f"{name}_p95"] = float(np.percentile(column, 95))
            rows.append(row)
    return rows


def severity_rows(contacts: Sequence[Judged]) -> list[Row]:
    """Coverage and width of the intervals of impulse and peak force, by kind and by link."""
    by_kind = groups(sorted(contacts, key=lambda j: j.kind), lambda j: j.kind)
    by_link = groups(sorted(contacts, key=_link), lambda j: f"link {_link(j)}")
    rows = []
    for name, own in (by_kind | by_link).items():
        pairs = [(j.diagnosis, j.severity) for j in own if j.diagnosis and j.severity]
        if not pairs:
            continue
        found = severity_figures(pairs)
        row: Row = {"study": "severity", "group": name}
        for size in ("impulse", "peak"):
            row[f"{size}_held"] = found[f"{size}_held"]
            row[f"{size}_width"] = found[f"{size}_width"]["median"]
            row[f"{size}_identifiable"] = found[f"{size}_identifiable"]["value"]
        rows.append(row)
    return rows


def kind_rows(judged: Sequence[Judged]) -> list[Row]:
    """True kind (row) against diagnosed kind (column)."""
    rows = []
    for kind in KINDS:
        said = [j.diagnosis.kind for j in judged if j.diagnosis and j.kind == kind]
        counts = {f"said_{other}": said.count(other) for other in KINDS}
        right = rate(said.count(kind), len(said))
        rows.append({"study": "kind", "kind": kind, **counts, "kind_right": right})
    return rows


def payload_rows(judged: Sequence[Judged]) -> list[Row]:
    """Payload changes with an alarm, how many were called a collision, and the mass found."""
    rows = []
    changes = [j for j in judged if j.kind == "payload"]
    for mass in (None, *sorted({abs(j.mass) for j in changes})):
        some = [j for j in changes if mass in (None, abs(j.mass))]
        found = [(j.diagnosis, j.mass) for j in some if j.diagnosis is not None]
        masses = [abs(d.signs.mass - m) for d, m in found if not d.collision]
        rows.append(
            {
                "study": "payload",
                "payload_kg": mass or "all",
                "alarm_raised": rate(len(found), len(some)),
                "called_collision": rate(sum(d.collision for d, _ in found), len(found)),
                "mass_error_g": 1000 * float(np.median(masses)) if masses else None,
            }
        )
    return rows


def cost_row(event: Event, trained: CollisionAlarm, surface: LinkSurface) -> Row:
    """Time of a diagnosis, and of the computations before it [us]."""
    alarm = event.alarm
    assert alarm is not None
    diagnoser = Diagnoser.of(trained.detector.arm, surface)
    looked = PostAlarmWindows(diagnoser.arm, diagnoser.noise_model, event.trace)
    after = looked.at(alarm.start)
    times: dict[str, Any] = time_in_turn(
        {
            "diagnosis_us": lambda: diagnoser.explain(alarm, after),
            "aftermath_us": lambda: looked.at(alarm.start),
        },
        repeats=15,
    )
    scaled = {name: per(time, 1, 1e6) for name, time in times.items()}
    return {"study": "cost", "surface_points": len(surface.link), **scaled}


def draw(rows: list[Row], figure: Any) -> None:
    """Link accuracy and point error by severity."""
    axes = figure.subplots(1, 2)
    names = [f"{stratum(low)} N m" for low, _ in STRATA]
    for method in METHODS:
        mine = [r for r in rows if r.get("method") == method and r["group"] in names]
        links = [r for r in mine if r["study"] == "link"]
        at = [names.index(r["group"]) for r in links]
        errorbars(axes[0], at, (r["link_right"] for r in links), fmt="o-", label=method)
        points = [r["point_cm"] for r in mine if r["study"] == "contact"]
        axes[1].plot(at, points, "o-", label=method)
    for axis, label in ((axes[0], "link accuracy (0 to 1)"), (axes[1], "median point error [cm]")):
        axis.set_xticks(range(len(names)), [name.removesuffix(" N m") for name in names])
        axis.set(xlabel="external torque [N m]", ylabel=label)
        axis.legend()
