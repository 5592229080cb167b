"""``tauguard evaluate``: a detector's figures on labelled recordings."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tauguard.cli.events import EventFolder
    from tauguard.detectors import CollisionAlarm, Matching
    from tauguard.models import LinkSurface
    from tauguard.traces import Detection, Trace


def command(
    traces: Path | None = None,
    data: Path | None = None,
    splits: tuple[str, ...] = (),
    model: Path = Path("model.skops"),
    detector: str | None = None,
    json: Path | None = None,
    figure: Path | None = None,
    events: Path | None = None,
    late: float = 0.05,
) -> None:
    """Evaluate a trained detector on labelled recordings; they must not be those of its training.

    Args:
        traces: folder of MCAP recordings with truth.
        data: instead, a dataset (`tauguard generate`): its episodes of the model's arm, split by
            split.
        splits: with --data, which ones (default: those whose name begins with "test").
        model: a model file that `tauguard train` wrote.
        detector: module:Class of the method, if it is not one of tauguard's own.
        json: write the figures here.
        figure: draw them here (PNG).
        events: a folder for ten seconds of every missed collision, late detection and false
            alarm, with a page that `tauguard replay --web` opens.
        late: with --events, a collision found later than this is an event [s].
    """
    from tauguard.cli.events import EventFolder
    from tauguard.cli.summary import diagnosis_text, draw, text
    from tauguard.datasets.arm_splits import episodes_of_splits
    from tauguard.datasets.labelled import labelled
    from tauguard.detectors import figures, load_model
    from tauguard.detectors.registry import make_detector
    from tauguard.report import machine, versions, write_json

    if (traces is None) == (data is None):
        raise ValueError("give --traces (a folder of recordings) or --data (a dataset)")
    if detector is not None:
        make_detector(detector)  # allows the file to hold its classes
    alarm = load_model(model)
    parts = (
        episodes_of_splits(data, alarm.detector.arm.robot, splits)
        if data is not None
        else iter([(str(traces), iter(labelled(Path(str(traces)))))])
    )
    rows, wrong = [], None if events is None else EventFolder(events, late)
    for name, recordings in parts:
        matchings, diagnosis = judged_one_by_one(alarm, recordings, name, wrong)
        summary = figures(matchings)
        summary["diagnosis"] = diagnosis
        rows.append({"split": name, **summary} if data is not None else summary)
        print(f"{len(matchings)} recordings in {name}")
        print(text(summary))
        print(diagnosis_text(diagnosis))
        if figure is not None:
            drawn = figure if data is None else figure.with_stem(f"{figure.stem}-{name}")
            draw(drawn, summary, matchings)
    if wrong is not None:
        page = wrong.finish()
        print(f"{page}: open it with `tauguard replay --web {page.parent}`")
    if json is not None:
        write_json(
            json,
            {
                "name": "evaluate",
                "quick": False,
                "machine": machine(),
                "versions": versions(),
                "seed": None,
                "rows": rows,
            },
        )


def judged_one_by_one(
    alarm: CollisionAlarm,
    recordings: Iterable[Trace],
    split: str,
    wrong: EventFolder | None = None,
) -> tuple[list[Matching], dict[str, Any]]:
    """Every recording judged, and the figures of what is said after its alarms; one in memory."""
    from tauguard.detectors import diagnosis_figures, match_detection
    from tauguard.detectors.detector import check_interval

    matchings, said = [], []
    for number, trace in enumerate(recordings, start=1):
        check_interval(f"recording {number}", trace, alarm.detector.dt)
        if trace.joint_names != alarm.detector.arm.robot.joint_names:
            raise ValueError(
                f"recording {number} is of joints {', '.join(trace.joint_names)}, the model of "
                f"{', '.join(alarm.detector.arm.robot.joint_names)}"
            )
        found = alarm.detect(trace)
        matchings.append(match_detection(found, trace, alarm.settle))
        if wrong is not None:
            wrong.add(split, number, matchings[-1], (trace, found))
        said += explained(alarm, found, trace)
    return matchings, diagnosis_figures(said)


def explained(alarm: CollisionAlarm, detection: Detection, trace: Trace) -> list[Any]:
    """What is said after the alarms of a recording that carries its arm's file, judged."""
    from tauguard.detectors import diagnose, match_diagnoses

    arm = trace.attachments.get("arm.xml")
    if arm is None:
        return []
    return list(match_diagnoses(diagnose(alarm, trace, detection, surface(arm)), trace))


@functools.cache
def surface(arm: str) -> LinkSurface:
    """Points on the links of an arm, from its MJCF text."""
    from tauguard.models import link_surface

    return link_surface(arm)
