"""Comparison of diagnoses with the truth: link, force, direction and point of found collisions."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from tauguard.arrays import Array
from tauguard.detectors.alarms.alarm import CollisionAlarm
from tauguard.detectors.diagnosis.diagnosis import Diagnosis, diagnose
from tauguard.detectors.dynamics.robot import RobotNumbers
from tauguard.detectors.dynamics.same_arm import arm_difference
from tauguard.detectors.evaluation.matching import Matching, match_detection
from tauguard.detectors.events import detection_window
from tauguard.detectors.samples import check_interval
from tauguard.findings import ArgumentError
from tauguard.models import link_surface, pin_model
from tauguard.report import rate as wilson
from tauguard.traces.trace import Collision, Detection, Trace, Truth

#: An estimate lags, so it is compared with the largest true force in this time before it [s].
LAG = 0.015


def contact_at(trace: Trace, collision: Collision, time: float) -> tuple[Array, Array]:
    """True force [N] and point [m] with which an estimate for ``time`` [s] is compared.

    They belong to the largest force in the last :data:`LAG` seconds. If there was no contact in
    that time, they are the collision's own force and point.

    Raises:
        ArgumentError: the trace has no truth.
    """
    truth = _truth(trace)
    first, last = np.searchsorted(trace.t, (time - LAG, time))
    forces = truth.contact_vector[first : last + 1]
    if not forces.any():
        return collision.force, collision.point
    row = int(np.linalg.norm(forces, axis=1).argmax())
    return forces[row], truth.contact_point[first + row]


def _truth(trace: Trace) -> Truth:
    if trace.truth is None:
        raise ArgumentError("trace has no truth to match a diagnosis with")
    return trace.truth


@dataclass(frozen=True)
class ContactErrors:
    """Errors of an estimated contact."""

    true_force: float  #: [N]
    force: float  #: norm of the difference [N]
    direction: float  #: angle between the forces [deg]
    point: float  #: distance of the points [m]

    @classmethod
    def of(cls, force: ArrayLike, point: ArrayLike, truth: tuple[Array, Array]) -> ContactErrors:
        """Errors of an estimated force [N] and point [m]."""
        said, place = np.asarray(force, dtype=float), np.asarray(point, dtype=float)
        size, own = float(np.linalg.norm(truth[0])), float(np.linalg.norm(said))
        cosine = float(said @ truth[0]) / (size * own) if size * own > 0 else 0.0
        return cls(
            size,
            float(np.linalg.norm(said - truth[0])),
            float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))),
            float(np.linalg.norm(place - truth[1])),
        )


@dataclass(frozen=True)
class TrueSeverity:
    """Truth of a contact up to the end of the window."""

    impulse: float  #: norm of the force's integral [N s]
    peak: float  #: largest force [N]

    @classmethod
    def of(cls, trace: Trace, collision: Collision, until: float) -> TrueSeverity:
        """The severity of a collision until the time ``until`` [s].

        Raises:
            ArgumentError: the trace has no truth.
        """
        first, last = np.searchsorted(trace.t, (collision.onset, min(collision.end, until)))
        force = _truth(trace).contact_vector[first : max(last, first + 1)]
        size = np.linalg.norm(force, axis=1)
        return cls(float(np.linalg.norm(force.sum(axis=0)) * trace.dt), float(size.max()))


@dataclass(frozen=True)
class MatchedDiagnosis:
    """A diagnosis, with the collision that its alarm detected or None for a false alarm."""

    diagnosis: Diagnosis
    collision: Collision | None
    errors: ContactErrors | None
    severity: TrueSeverity | None = None


def match_diagnoses(diagnoses: Sequence[Diagnosis], trace: Trace) -> list[MatchedDiagnosis]:
    """Each diagnosis with the collision that its alarm detected.

    A collision is detected by the first alarm that starts in its detection window. Later alarms in
    the window are left out. An alarm in no window is false.

    Raises:
        ArgumentError: the trace has no truth.
    """
    collisions = _truth(trace).collisions
    matched, used = [], set()
    for diagnosis in diagnoses:
        start = diagnosis.alarm.start
        windows = [(c, detection_window(c)) for c in collisions]
        about = [c for c, (low, high) in windows if low <= start <= high]
        if not about:
            matched.append(MatchedDiagnosis(diagnosis, None, None))
        elif about[0].onset not in used:
            used.add(about[0].onset)
            truth = contact_at(trace, about[0], diagnosis.time)
            errors = ContactErrors.of(diagnosis.force, diagnosis.point, truth)
            true = TrueSeverity.of(trace, about[0], diagnosis.until)
            matched.append(MatchedDiagnosis(diagnosis, about[0], errors, true))
    return matched


def diagnosis_metrics(matched: Iterable[MatchedDiagnosis]) -> dict[str, Any]:
    """All metrics over the given diagnoses.

    Returns:
        ``link_right``, ``link_or_neighbour``, ``last_joint_right`` (the usual rule), each a rate
        with its Wilson interval over the collisions found; ``force_error_n``, ``direction_deg``
        and ``point_cm`` (median, p95, n); the rates ``called_payload`` over the collisions found
        and ``false_alarms_called_payload`` over the false alarms; and the metrics of
        :func:`severity_figures`.
    """
    several = list(matched)
    found = [(j.diagnosis, j.collision) for j in several if j.collision is not None]
    errors = [j.errors for j in several if j.errors is not None]
    false = [j.diagnosis for j in several if j.collision is None]
    off = [abs(d.link - c.link) for d, c in found]
    sizes = [(j.diagnosis, j.severity) for j in several if j.severity is not None]
    return {
        **severity_figures(sizes),
        "link_right": wilson(sum(o == 0 for o in off), len(off)),
        "link_or_neighbour": wilson(sum(o <= 1 for o in off), len(off)),
        "last_joint_right": wilson(sum(d.last_joint == c.link for d, c in found), len(off)),
        "force_error_n": spread([e.force for e in errors]),
        "direction_deg": spread([e.direction for e in errors]),
        "point_cm": spread([100 * e.point for e in errors]),
        "called_payload": wilson(sum(not d.collision for d, _ in found), len(found)),
        "false_alarms_called_payload": wilson(sum(not d.collision for d in false), len(false)),
    }


def severity_figures(sizes: Sequence[tuple[Diagnosis, TrueSeverity]]) -> dict[str, Any]:
    """Metrics of the 90 % intervals of impulse and peak force.

    Returns:
        ``impulse_held`` and ``peak_held``, rates at which the interval contains the true value;
        ``impulse_identifiable`` and ``peak_identifiable``, rates; ``impulse_width`` and
        ``peak_width``, upper end divided by lower end (median, p95, n).
    """
    figures: dict[str, Any] = {}
    for name in ("impulse", "peak"):
        pairs = [(getattr(d.severity, name), getattr(true, name)) for d, true in sizes]
        held = sum(b.low <= value <= b.high for b, value in pairs)
        figures[f"{name}_held"] = wilson(held, len(pairs))
        identifiable = sum(b.identifiable for b, _ in pairs)
        figures[f"{name}_identifiable"] = wilson(identifiable, len(pairs))
        figures[f"{name}_width"] = spread([b.high / max(b.low, 1e-12) for b, _ in pairs])
    return figures


def spread(values: Sequence[float]) -> dict[str, Any]:
    """Median, 95th percentile and number of values; None without values."""
    if not values:
        return {"median": None, "p95": None, "n": 0}
    median, p95 = np.percentile(values, (50, 95))
    return {"median": float(median), "p95": float(p95), "n": len(values)}


_surface = functools.cache(link_surface)


class JudgedRecording(NamedTuple):
    """The detection of a recording, matched with its truth."""

    trace: Trace
    detection: Detection
    matching: Matching

    def diagnoses(self, alarm: CollisionAlarm) -> list[MatchedDiagnosis]:
        """Diagnoses of the alarms compared with the truth; none if no arm file is attached."""
        arm = self.trace.attachments.get("arm.xml")
        if arm is None:
            return []
        said = diagnose(alarm, self.trace, self.detection, _surface(arm))
        return match_diagnoses(said, self.trace)


def judge_recording(alarm: CollisionAlarm, name: str, trace: Trace) -> JudgedRecording:
    """Detect in a recording and match with its truth.

    Raises:
        ArgumentError: no truth, another arm, or another sample rate; the last two give ``name``.
    """
    arm = alarm.detector.arm.robot
    if trace.joint_names != arm.joint_names:
        raise ArgumentError(
            f"{name} has joints {', '.join(trace.joint_names)}, the model "
            f"{', '.join(arm.joint_names)}"
        )
    text = trace.attachments.get("arm.xml")
    if text is not None and (alarm.robot is None or text != alarm.robot.text):
        difference = arm_difference(RobotNumbers.from_pin(pin_model(text)), arm)
        if difference:
            raise ArgumentError(f"{name} is of another arm than the model: {difference}")
    check_interval(name, trace, alarm.detector.dt)
    found = alarm.detect(trace)
    return JudgedRecording(trace, found, match_detection(found, trace, alarm.settle))
