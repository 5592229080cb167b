"""A figure of ten seconds: score, threshold, and speed of the fastest joint."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tauguard.arrays import Array
    from tauguard.traces import Detection, Trace

#: The scale is logarithmic if the score exceeds this many thresholds.
CROWDED = 8.0


def draw_event(path: Path, trace: Trace, detection: Detection, held: Array, title: str) -> None:
    """Draw a part of a recording as PNG; the file is written atomically.

    Args:
        path: path of the picture.
        trace: the part, with its truth.
        detection: detection of that part.
        held: lowest score of the last confirmation time at each sample of the part, shape (T,). It
            is an alarm if it exceeds the threshold.
        title: title of the picture.

    Raises:
        OSError: the folder cannot be written.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    import numpy as np

    from tauguard.atomic_write import atomic_file
    from tauguard.report.charts import COLOURS, STYLE

    with plt.rc_context(STYLE):
        figure, (score, speed) = plt.subplots(
            2, 1, sharex=True, figsize=(8.0, 4.4), height_ratios=(3, 2), layout="constrained"
        )
        thin = {"color": COLOURS[5], "linewidth": 0.6}
        score.plot(detection.t, _drawn(detection.score), label="score", **thin)
        score.plot(
            detection.t, _drawn(held), label="score held for the confirmation time", linewidth=1.0
        )
        score.axhline(detection.threshold, color="black", linestyle="--", label="threshold")
        _shade(score, trace, detection)
        names = {"parse_math": False}  # a name may have dollar signs
        score.set_title(title, **names)
        score.set_ylabel(f"score of\n{detection.detector}", **names)
        _spread(score, detection)
        figure.legend(*score.get_legend_handles_labels(), loc="outside lower center", ncols=5)
        fastest = np.abs(trace.qd).max(axis=1)
        speed.plot(trace.t, fastest)
        speed.set(xlabel="time in the recording [s]", ylabel="fastest joint\n[rad/s]")
        speed.set(ylim=(0, None), xlim=(trace.t[0], trace.t[-1]))
        with atomic_file(path) as stream:
            figure.savefig(stream, dpi=100, format="png")
        plt.close(figure)


def _spread(axes: Any, detection: Detection) -> None:
    """Use a logarithmic scale above usual scores if peaks would hide the threshold."""
    import numpy as np

    scores, edge = detection.score[np.isfinite(detection.score)], abs(detection.threshold)
    if not scores.size or scores.max() <= CROWDED * edge:
        return
    usual = max(2 * edge, float(np.quantile(np.abs(scores), 0.9)))
    linear = 10 ** np.ceil(np.log10(usual)) if usual > 0 else np.inf
    if scores.max() > linear:  # otherwise a logarithmic axis may have no round number to label
        axes.set_yscale("symlog", linthresh=linear)


def _drawn(values: Array) -> Array:
    """Values with NaN for infinite scores, which mean that the detector has not settled."""
    import numpy as np

    return np.where(np.isfinite(values), values, np.nan)


def _shade(axes: Any, trace: Trace, detection: Detection) -> None:
    """Draw contacts and alarms as bands, each with one entry of the legend."""
    from tauguard.report.charts import COLOURS

    truth = trace.truth
    contacts = () if truth is None else [(c.onset, c.end) for c in truth.collisions]
    alarms = [(a.start, a.end) for a in detection.alarms]
    first, last = float(trace.t[0]), float(trace.t[-1])
    bands = (("contact", contacts, COLOURS[2], 0.4), ("alarm", alarms, COLOURS[1], 0.25))
    for name, spans, colour, alpha in bands:
        for number, (start, end) in enumerate(spans):
            axes.axvspan(
                max(start, first),
                min(end, last),
                color=colour,
                alpha=alpha,
                label=name if number == 0 else None,
            )
