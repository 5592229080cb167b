"""``tauguard evaluate``: a detector's metrics on labelled recordings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from tauguard.findings import ArgumentError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from tauguard.detectors import CollisionAlarm, Matching
    from tauguard.replay.events import EventFolder
    from tauguard.traces import Trace

    #: Name of a split or folder, its matched recordings, and their metrics.
    Part = tuple[str, list[Matching], dict[str, Any]]


def command(
    traces: Path | None = None,
    data: Path | None = None,
    splits: tuple[str, ...] = (),
    model: Path = Path("model.tauguard"),
    alarms: Path | None = None,
    detector: str | None = None,
    json: Path | None = None,
    figure: Path | None = None,
    events: Path | None = None,
    late: float = 0.05,
) -> None:
    """Evaluate a trained detector on labelled recordings that it was not trained on.

    Args:
        traces: folder of MCAP recordings with truth.
        data: a dataset (`tauguard generate`) instead of --traces; the episodes of the model's arm
            are used.
        splits: with --data, names of the splits (default: those that begin with "test").
        model: a model file that `tauguard train` wrote.
        alarms: with --data, the alarms of any other detector instead of a model: a CSV file with
            one line per alarm and the columns episode (SPLIT/NUMBER, as for `tauguard inspect
            --episode`), start and end [s]. All arms of the splits are evaluated.
        detector: module:Class of the method, if it is your own.
        json: write the metrics here as JSON.
        figure: draw the metrics here (PNG).
        events: a folder for ten seconds of every missed collision, late detection and false
            alarm, with pictures and a page for `tauguard replay --web`. An event is named by the
            file of its recording; with --data by SPLIT/NUMBER, as for `tauguard inspect --episode`.
        late: with --events, delay above which a detection is late [s].
    """
    from tauguard.detectors.evaluation.metrics_page import diagnosis_text, draw, text
    from tauguard.replay.events import EventFolder, command_to_open
    from tauguard.report import measured, write_json

    wrong = None
    if alarms is not None:
        if data is None or detector is not None or events is not None:
            raise ArgumentError("--alarms goes with --data, and not with --detector or --events")
        parts = of_file(data, alarms, splits)
    else:
        if (traces is None) == (data is None):
            raise ArgumentError("give --traces (a folder of recordings) or --data (a dataset)")
        alarm = loaded(model, detector)
        wrong = None if events is None else EventFolder(events, late, alarm)
        parts = of_model(alarm, traces, data, splits, wrong)
    rows: list[dict[str, Any]] = []
    for name, matchings, summary in parts:
        rows.append({"split": name, **summary} if data is not None else summary)
        print(f"{len(matchings)} recordings in {name}")
        print(text(summary))
        if "diagnosis" in summary:
            print(diagnosis_text(summary["diagnosis"]))
        if figure is not None:
            drawn = figure if data is None else figure.with_stem(f"{figure.stem}-{name}")
            draw(drawn, summary, matchings)
    if wrong is not None:
        page = wrong.finish()
        print(f"{page}: open it with `{command_to_open(page.parent)}`")
    if json is not None:
        write_json(json, measured("evaluate", rows))


def loaded(model: Path, detector: str | None) -> CollisionAlarm:
    """The model in a file; ``detector`` names its class if that is the user's own."""
    from tauguard.detectors import load_model
    from tauguard.detectors.registry import make_detector

    if detector is not None:
        make_detector(detector)
    return load_model(model)


def of_file(data: Path, alarms: Path, splits: tuple[str, ...]) -> Iterator[Part]:
    """Match the alarms of a file with the collisions of a dataset, split by split."""
    from tauguard.datasets.alarm_files import judged_alarms
    from tauguard.detectors import detection_metrics

    for name, matchings in judged_alarms(data, alarms, splits):
        yield name, matchings, detection_metrics(matchings)


def of_model(
    alarm: CollisionAlarm,
    traces: Path | None,
    data: Path | None,
    splits: tuple[str, ...],
    wrong: EventFolder | None,
) -> Iterator[Part]:
    """Evaluate a detector on the splits of a dataset, or on a folder of recordings."""
    from tauguard.datasets.reader import episodes_of_splits
    from tauguard.datasets.recordings import labelled

    if data is not None:
        parts = episodes_of_splits(data, alarm.detector.arm.robot, splits)
    else:
        parts = iter([(str(traces), iter(labelled(Path(str(traces)))))])
    for name, recordings in parts:
        yield name, *evaluated(alarm, recordings, wrong)


def evaluated(
    alarm: CollisionAlarm, recordings: Iterable[Trace], wrong: EventFolder | None
) -> tuple[list[Matching], dict[str, Any]]:
    """Match alarms with the truth and compute all metrics; ``wrong`` records the errors."""
    from tauguard.detectors import detection_metrics, diagnosis_metrics
    from tauguard.detectors.evaluation.diagnosis_metrics import judge_recording

    matchings, said = [], []
    for number, trace in enumerate(recordings):
        name = name_of(trace, number)
        one = judge_recording(alarm, name, trace)
        matchings.append(one.matching)
        said += one.diagnoses(alarm)
        if wrong is not None:
            wrong.add(name, one.matching, (trace, one.detection))
    return matchings, {**detection_metrics(matchings), "diagnosis": diagnosis_metrics(said)}


def name_of(trace: Trace, number: int) -> str:
    """The name of a recording: its file, or its split and number in the dataset."""
    return trace.meta.get("log") or trace.meta.get("episode") or str(number)
