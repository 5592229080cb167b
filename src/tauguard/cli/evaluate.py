"""``tauguard evaluate``: a detector's figures on labelled recordings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tauguard.detectors import CollisionAlarm
    from tauguard.traces import Detection, Trace


def command(
    traces: Path,
    model: Path = Path("model.skops"),
    detector: str | None = None,
    json: Path | None = None,
    figure: Path | None = None,
) -> None:
    """Judge a trained detector on labelled recordings; they must not be those of its training.

    Args:
        traces: folder of MCAP recordings with truth.
        model: a model file that `tauguard train` wrote.
        detector: module:Class of the method, if it is not one of tauguard's own.
        json: write the figures here.
        figure: draw them here (PNG).
    """
    from tauguard.cli.folder import labelled
    from tauguard.cli.summary import diagnosis_text, draw, text
    from tauguard.detectors import figures, judge, load_model
    from tauguard.detectors.methods.free_motion_file import is_free_motion
    from tauguard.detectors.registry import make_detector
    from tauguard.report import machine, versions, write_json

    if is_free_motion(model):
        raise ValueError(f"{model}: a real arm's detector (train --free); use `tauguard detect`")
    if detector is not None:
        make_detector(detector)  # allows the file to hold its classes
    alarm = load_model(model)
    recordings = labelled(traces)
    pairs = [(alarm.detect(trace), trace) for trace in recordings]
    matchings = [judge(found, trace, alarm.settle) for found, trace in pairs]
    summary = figures(matchings)
    summary["diagnosis"] = explained(alarm, pairs)
    print(f"{len(recordings)} recordings in {traces}")
    print(text(summary))
    print(diagnosis_text(summary["diagnosis"]))
    if figure is not None:
        draw(figure, summary, matchings)
    if json is not None:
        write_json(
            json,
            {
                "name": "evaluate",
                "quick": False,
                "machine": machine(),
                "versions": versions(),
                "seed": None,
                "rows": [summary],
            },
        )


def explained(alarm: CollisionAlarm, pairs: Sequence[tuple[Detection, Trace]]) -> dict[str, Any]:
    """Figures of what is said after the alarms of recordings that carry their arm's file."""
    from tauguard.detectors import diagnose, diagnosis_figures, judge_diagnoses
    from tauguard.models import link_surface

    judged = []
    surfaces: dict[str, Any] = {}
    for detection, trace in pairs:
        arm = trace.attachments.get("arm.xml")
        if arm is None:
            continue
        if arm not in surfaces:
            surfaces[arm] = link_surface(arm)
        said = diagnose(alarm, trace, detection, surfaces[arm])
        judged += judge_diagnoses(said, trace)
    return diagnosis_figures(judged)
