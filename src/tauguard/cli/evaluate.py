"""``tauguard evaluate``: a detector's metrics on labelled recordings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from tauguard.findings import ArgumentError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tauguard import Detector, Evaluation
    from tauguard.replay import EventFolder


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
    from tauguard.replay import EventFolder, command_to_open
    from tauguard.report import measured, write_json

    errors = None
    if alarms is not None:
        if data is None or detector is not None or events is not None:
            raise ArgumentError("--alarms goes with --data, and not with --detector or --events")
        parts = of_file(data, alarms, splits)
    else:
        if (traces is None) == (data is None):
            raise ArgumentError("give --traces (a folder of recordings) or --data (a dataset)")
        trained = loaded(model, detector)
        errors = None if events is None else EventFolder(events, late, trained.alarm)
        parts = of_model(trained, traces, data, splits, errors)
    rows: list[dict[str, Any]] = []
    for name, found in parts:
        metrics = found.to_dict()
        rows.append(metrics if data is None else {"split": name, **metrics})
        print(f"{len(found.names)} recordings in {name}\n{found.text()}")
        if figure is not None:
            found.draw(figure if data is None else figure.with_stem(f"{figure.stem}-{name}"))
    if errors is not None:
        page = errors.finish()
        print(f"{page}: open it with `{command_to_open(page.parent)}`")
    if json is not None:
        write_json(json, measured("evaluate", rows))


def loaded(model: Path, method: str | None) -> Detector:
    """The detector in a file; ``method`` names its class if that is the user's own."""
    import tauguard as tg
    from tauguard.detectors import make_detector

    if method is not None:
        make_detector(method)
    return tg.load_detector(model)


def of_file(data: Path, alarms: Path, splits: tuple[str, ...]) -> Iterator[tuple[str, Evaluation]]:
    """Match the alarms of a file with the collisions of a dataset, split by split."""
    from tauguard import Evaluation
    from tauguard.datasets import judged_alarms

    for name, matchings in judged_alarms(data, alarms, splits):
        yield name, Evaluation.of([str(k) for k in range(len(matchings))], matchings)


def of_model(
    detector: Detector,
    traces: Path | None,
    data: Path | None,
    splits: tuple[str, ...],
    errors: EventFolder | None,
) -> Iterator[tuple[str, Evaluation]]:
    """Evaluate a detector on the splits of a dataset, or on a folder of recordings."""
    import tauguard as tg
    from tauguard.datasets import episodes_of_splits

    visit = None if errors is None else errors.add
    if data is None:
        yield str(traces), tg.evaluate(detector, tg.read_logs(str(traces)), visit)
        return
    for name, recordings in episodes_of_splits(data, detector.arm.robot, splits):
        yield name, tg.evaluate(detector, recordings, visit)
