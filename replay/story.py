"""Guidance for the viewer of a recording: the first detection, and a page of text."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tauguard.detectors.events import detection_window
from tauguard.traces import Alarm, Collision, Detection, Trace

if TYPE_CHECKING:
    from tauguard.detectors import Diagnosis

LISTED = 20  # collisions in the table of the page


def alarm_of(collision: Collision, alarms: tuple[Alarm, ...]) -> Alarm | None:
    """The first alarm that starts in the collision's detection window."""
    onset, last = detection_window(collision)
    if any(a.start < onset <= a.end for a in alarms):
        return None  # the alarm was on before, so it detects nothing
    return next((a for a in alarms if onset <= a.start <= last), None)


def first_moment(trace: Trace, detection: Detection | None) -> float:
    """First time to show [s]: the first alarm of a detected collision, or else the first sample.

    If the alarm starts after the collision's end, begin at that end, because the body that was hit
    is visible there.
    """
    if trace.truth is None or detection is None:
        return float(trace.t[0])
    found = [(alarm_of(c, detection.alarms), c) for c in trace.truth.collisions]
    moments = [min(alarm.start, c.end) for alarm, c in found if alarm is not None]
    return min(moments, default=float(trace.t[0]))


def cut(
    trace: Trace, detection: Detection | None, start: float, end: float = np.inf
) -> tuple[Trace, Detection | None]:
    """Cut out the samples and events between ``start`` and ``end`` [s]."""
    first, last = np.searchsorted(trace.t, [start - 1e-9, end + 1e-9])
    samples = len(trace.t)

    def rest(value: Any) -> dict[str, Any]:
        """The arrays of a dataclass that have a row per sample, without the other rows."""
        arrays = {f.name: getattr(value, f.name) for f in fields(value)}
        found = {n: a for n, a in arrays.items() if isinstance(a, np.ndarray)}
        return {n: a[first:last] for n, a in found.items() if len(a) == samples}

    truth = trace.truth
    if truth is not None:
        kept = tuple(c for c in truth.collisions if c.end >= start and c.onset <= end)
        truth = replace(truth, collisions=kept, **rest(truth))
    if detection is not None:
        alarms = tuple(a for a in detection.alarms if a.end >= start and a.start <= end)
        detection = replace(detection, alarms=alarms, **rest(detection))
    contacts = tuple(one.between(start, end) for one in trace.contacts)
    return replace(trace, truth=truth, contacts=contacts, **rest(trace)), detection


def page(
    trace: Trace, detection: Detection | None, explained: Sequence[Diagnosis] = (), about: str = ""
) -> str:
    """The text next to the views, in Markdown: the events, then an explanation of the views."""
    lines = [f"## {about}", ""] if about else []
    if trace.truth is not None:
        lines += collision_table(trace, detection, explained)
    else:
        lines += alarms(detection, explained)
    span = trace.t[-1] - trace.t[0]
    lines += ["", f"An arm with {len(trace.joint_names)} joints, {span:.1f} s.", ""]
    if trace.truth is not None:
        lines += [
            "- **3D**: the arm in its real geometry. A red arrow is the contact force on the arm, "
            "at the point of contact.",
        ]
    if explained:
        lines += ["- **3D**: a blue arrow is the contact force that was estimated after an alarm."]
    if trace.contacts:
        names = ", ".join(one.checker for one in trace.contacts)
        lines += [f"- **3D**: a dot is a contact that a checker reported ({names})."]
    if detection is not None:
        lines += [
            "- **Residual**: the observer's estimate of the external torque of each joint.",
            f"- **Score**: the output of the {detection.detector} detector. Scores above the red "
            f"line, at {detection.threshold:.3g}, lead to an alarm. High scores leave the chart.",
            "- **Alarm and truth**: when the alarm was active, and when there was a contact.",
        ]
    lines += [
        "- **Current**: the measured motor currents, the only input.",
        "",
        "Press the space bar to play (at half speed). Click into a chart with the right button "
        "to go to a time; the `?` of each view lists its keys.",
        "",
        "*A research tool, not a certified safety function.*",
    ]
    return "\n".join(lines)


def collision_table(
    trace: Trace, detection: Detection | None, explained: Sequence[Diagnosis] = ()
) -> list[str]:
    """Markdown rows of the collisions, with the time from onset to detection."""
    assert trace.truth is not None
    found = detection.alarms if detection is not None else ()
    rows = sorted(trace.truth.collisions, key=lambda c: c.onset)
    detected = [alarm for alarm in (alarm_of(c, found) for c in rows) if alarm is not None]
    false = len(found) - len({alarm.start for alarm in detected})
    many = "collision" if len(rows) == 1 else "collisions"
    wrong = f", {false} false alarm{'s' if false > 1 else ''}" if false else ""
    judged = f", {len(detected)} detected{wrong}" if detection else ""
    lines = [f"## {len(rows)} {many}{judged}", ""]
    if not rows:
        return lines
    said = {one.alarm.start: one.summary for one in explained}
    extra = ("| diagnosis |", "-|") if said else ("|", "")
    lines += [
        "| onset [s] | kind | link | peak torque [N m] | detected after " + extra[0],
        "|-|-|-|-|-|" + extra[1],
    ]
    for collision in rows[:LISTED]:
        alarm = alarm_of(collision, found)
        after = f"{1e3 * (alarm.start - collision.onset):.0f} ms" if alarm else "-"
        line = (
            f"| {collision.onset:.3f} | {collision.kind} | {collision.link} "
            f"| {collision.peak_tau:.1f} | {after} |"
        )
        lines.append(f"{line} {said.get(alarm.start, '-') if alarm else '-'} |" if said else line)
    if len(rows) > LISTED:
        lines += ["", f"and {len(rows) - LISTED} more."]
    return lines


def alarms(detection: Detection | None, explained: Sequence[Diagnosis] = ()) -> list[str]:
    """Markdown list of the alarms of a recording without truth."""
    if detection is None:
        return []
    count = len(detection.alarms)
    lines = [f"## {count} alarm{'' if count == 1 else 's'}", ""]
    said = {one.alarm.start: f": {one.summary}" for one in explained}
    lines += [
        f"- {a.start:.3f} s to {a.end:.3f} s{said.get(a.start, '')}"
        for a in detection.alarms[:LISTED]
    ]
    if len(detection.alarms) > LISTED:
        lines.append(f"- and {len(detection.alarms) - LISTED} more")
    return lines
