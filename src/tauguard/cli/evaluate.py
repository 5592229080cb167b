"""``tauguard evaluate``: a detector's figures on labelled recordings."""

from __future__ import annotations

from pathlib import Path


def command(
    traces: Path,
    model: Path = Path("model.skops"),
    json: Path | None = None,
    figure: Path | None = None,
) -> None:
    """Judge a trained detector on labelled recordings that it was not trained on.

    Args:
        traces: folder of MCAP recordings with truth.
        model: a model file that `tauguard train` wrote.
        json: write the figures here.
        figure: draw them here (PNG).
    """
    from tauguard.benchmarks.report import machine, versions, write_json
    from tauguard.cli.folder import labelled
    from tauguard.cli.summary import draw, text
    from tauguard.detectors import figures, judge, load_model

    watched = load_model(model)
    recordings = labelled(traces)
    matchings = [
        judge(watched.detect(trace), trace, watched.detector.settle) for trace in recordings
    ]
    summary = figures(matchings)
    print(text(summary))
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
