"""Plot a recording: currents, contact torques, and the detector's output."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tauguard.arrays import Array
from tauguard.findings import ArgumentError
from tauguard.traces import Detection, Log, Trace

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Upper end of a chart of the score in thresholds, so that both are visible.
SCORE_TOP = 8.0


def plot(result: Any, detection: Detection | None = None) -> Figure:
    """A recording or a result as a matplotlib figure.

    Args:
        result: a trace, a log, or the alarms in one (``LogDetection``), whose collisions and
            labelled contacts are shaded and whose alarms are lines; or a result with a method
            ``figure``: ``Evaluation``, ``ThresholdCard``, ``TwinOfLogs``.
        detection: a detector's output for a trace or log.

    Raises:
        ArgumentError: a detection of another recording, or a result without a figure.
    """
    if isinstance(result, Trace):
        return recording(result, detection)
    if isinstance(result, Log):
        return recording(result.trace, detection, result.labels or ())
    from tauguard.detectors import LogDetection  # here, as it takes long to import

    if isinstance(result, LogDetection):
        return recording(result.trace, result.detection, result.log.labels or ())
    if hasattr(result, "figure"):
        figure: Figure = result.figure()
        return figure
    raise ArgumentError(f"plot: a {type(result).__name__} has no figure")


def recording(
    trace: Trace, detection: Detection | None, labels: Sequence[tuple[float, float]] = ()
) -> Figure:
    """The signals of a recording; collisions and labels [s] are shaded, alarms are lines."""
    from matplotlib.figure import Figure

    if detection is not None and len(detection.t) != len(trace.t):
        raise ArgumentError(f"detection: {len(detection.t)} samples, the trace has {len(trace.t)}")
    torques = trace.meta.get("effort") == "torque"
    rows: list[tuple[str, Array]] = [
        ("position [rad]", trace.q),
        ("torque [N m]" if torques else "current [A]", trace.current),
    ]
    if trace.truth is not None:
        rows.append(("external torque, truth [N m]", trace.truth.tau_ext))
    if detection is not None:
        rows.append(("residual [N m]", detection.residual))
        rows.append(("score", np.stack([detection.score], axis=1)))
    figure = Figure(figsize=(10, 1.9 * len(rows)), layout="constrained")
    panels = np.atleast_1d(figure.subplots(len(rows), 1, sharex=True))
    for panel, (name, values) in zip(panels, rows, strict=True):
        for k in range(values.shape[1]):
            label = trace.joint_names[k] if values.shape[1] > 1 else None
            panel.plot(trace.t, values[:, k], linewidth=0.8, label=label)
        panel.set_ylabel(name)
        for hit in trace.truth.collisions if trace.truth is not None else ():
            panel.axvspan(hit.onset, hit.end, color="tab:red", alpha=0.15, linewidth=0)
        for start, end in labels:
            panel.axvspan(start, end, color="tab:red", alpha=0.15, linewidth=0)
        for alarm in detection.alarms if detection is not None else ():
            panel.axvline(alarm.start, color="black", linewidth=0.8, linestyle="--")
    if detection is not None:
        panels[-1].axhline(detection.threshold, color="tab:gray", linewidth=0.8)
        if detection.score.max() > SCORE_TOP * detection.threshold > 0:
            panels[-1].set_ylim(top=SCORE_TOP * detection.threshold)
    legend = panels[0].legend(ncol=len(trace.joint_names), fontsize="small", loc="upper right")
    for text in legend.get_texts():
        text.set_parse_math(False)  # a name may have dollar signs
    panels[-1].set_xlabel("time [s]")
    return figure
