"""``tauguard train``: a detector from labelled recordings."""

from __future__ import annotations

from pathlib import Path


def command(
    traces: Path, model: Path = Path("model.skops"), false_alarms_per_hour: float = 10.0
) -> None:
    """Train the momentum-observer SVR detector on labelled recordings and write its model file.

    Args:
        traces: folder of MCAP recordings with truth (`tauguard simulate` writes such), with
            collisions and collision-free ones.
        model: the model file (skops: arrays and scikit-learn's own types only).
        false_alarms_per_hour: what the threshold aims at on collision-free training motion.
    """
    from tauguard.cli.fitting import trained
    from tauguard.cli.folder import labelled

    recordings = labelled(traces)
    if not model.parent.is_dir():
        raise FileNotFoundError(f"{model}: the folder {model.parent} does not exist")
    detector = trained(recordings, false_alarms_per_hour)
    detector.save(model)
    collisions = sum(len(t.truth.collisions) for t in recordings if t.truth)
    print(
        f"{model}: trained on {len(recordings)} recordings with {collisions} collisions, "
        f"threshold {detector.threshold:.3f}"
    )
