"""Detection in recordings with truth, one recording in memory at a time."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from tauguard.detectors.alarms.alarm import CollisionAlarm
from tauguard.detectors.diagnosis.diagnosis import diagnose
from tauguard.detectors.evaluation.diagnosis_metrics import MatchedDiagnosis, match_diagnoses
from tauguard.detectors.evaluation.matching import Matching, match_detection
from tauguard.detectors.samples import check_interval
from tauguard.models import link_surface
from tauguard.traces.trace import Detection, Trace

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


def judged_recordings(
    alarm: CollisionAlarm, recordings: Iterable[Trace]
) -> Iterator[JudgedRecording]:
    """Detect in each recording and match with its truth.

    Raises:
        ValueError: no truth, another sample rate, or other joints; names the recording's number,
            counted from 0.
    """
    own = alarm.detector.arm.robot.joint_names
    for number, trace in enumerate(recordings):
        check_interval(f"recording {number}", trace, alarm.detector.dt)
        if trace.joint_names != own:
            raise ValueError(
                f"recording {number} has joints {', '.join(trace.joint_names)}, the model "
                f"{', '.join(own)}"
            )
        found = alarm.detect(trace)
        yield JudgedRecording(trace, found, match_detection(found, trace, alarm.settle))
