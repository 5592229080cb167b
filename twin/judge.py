"""A twin beside its arm on logs that it has not seen: residuals, their peaks, and a classifier."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import roc_auc_score
from sklearn.model_selection import GroupKFold, cross_val_predict
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from threadpoolctl import threadpool_limits

from tauguard.arrays import Array, Bools
from tauguard.detectors import ArmModel
from tauguard.models import Drive
from tauguard.traces import Trace
from tauguard.twin.play import played, residual_of
from tauguard.twin.signals import SLOW

#: Lengths of what is compared [s]: windows of the classifier, spans of peaks, groups of windows
#: that are kept together, and what the estimator needs to begin.
WINDOW, SPAN, GROUP, BEGIN = 0.2, 0.5, 5.0, 1.0
#: Fewest windows of each kind for an area under a curve.
FEWEST = 40


@dataclass(frozen=True, eq=False)
class Likeness:
    """Simulated over real residuals of held-out logs; NaN where the logs show too little."""

    rms: Array  #: ratio while the joint moves, shape (n,)
    peaks: Array  #: ratio of the 99 % quantiles of peaks of 0.5 s, moving, shape (n,)
    standing_rms: Array  #: ratio while no joint moves, shape (n,)
    standing_peaks: Array  #: the same of the peaks, shape (n,)
    high: Array  #: fraction of the residual's power in sample-to-sample change, real and simulated
    correlation: Array  #: of residuals 0.1 s apart, real and simulated, shape (2, n)
    moving_auc: tuple[float, float]
    """Areas of two classifiers, trees with boosting and logistic regression; .5: real and simulated
    cannot be told apart."""
    standing_auc: tuple[float, float]
    real_auc: tuple[float, float]  #: of real against real, moving
    real_residuals: tuple[Array, ...]  #: of each log [N m]
    twin_residuals: tuple[Array, ...]


def compare(arm: ArmModel, drive: Drive, traces: Sequence[Trace], seed: int = 0) -> Likeness:
    """Play the twin along logs and compare its residuals with the real ones.

    Args:
        arm: calibrated, without a look at these logs.
        drive: drive of the twin.
        traces: held-out logs.
        seed: seed of sensor noise and classifier.
    """
    real: list[Array] = []
    twin: list[Array] = []
    moves: list[Bools] = []
    still: list[Bools] = []
    for k, trace in enumerate(traces):
        other = replace(trace, current=played(arm, drive, trace, seed + k))
        dt = float(np.median(np.diff(trace.t)))
        begin = int(BEGIN / dt)
        real.append(residual_of(arm, trace)[begin:])
        twin.append(residual_of(arm, other)[begin:])
        fast = np.asarray(np.abs(trace.qd[begin:]) > SLOW)
        moves.append(fast)
        still.append(np.asarray(~fast.any(axis=1)))
    dt = float(np.median(np.concatenate([np.diff(trace.t) for trace in traces])))
    stand = [np.repeat(s[:, None], arm.robot.joints, axis=1) for s in still]
    real_, twin_ = np.concatenate(real), np.concatenate(twin)
    moving, standing = np.concatenate(moves), np.concatenate(stand)
    lag = max(1, round(0.1 / dt))
    both = np.array([np.concatenate(real), np.concatenate(twin)])
    return Likeness(
        _rms(twin_, moving) / _rms(real_, moving),
        _peaks(twin, moves, dt) / _peaks(real, moves, dt),
        _rms(twin_, standing) / _rms(real_, standing),
        _peaks(twin, stand, dt) / _peaks(real, stand, dt),
        (np.diff(both, axis=1) ** 2).mean(axis=1) / (2 * both.var(axis=1) + 1e-12),
        ((both[:, lag:] * both[:, :-lag]).mean(axis=1) / ((both**2).mean(axis=1) + 1e-12)),
        _auc(real, twin, [~s for s in still], dt, seed),
        _auc(real, twin, still, dt, seed),
        _real_auc(real, [~s for s in still], dt, seed),
        tuple(real),
        tuple(twin),
    )


def _rms(values: Array, rows: Bools) -> Array:
    """Of each joint's own rows, shape (n,); NaN where there are fewer than 100."""
    count = rows.sum(axis=0)
    square = (rows * values**2).sum(axis=0)
    out: Array = np.where(count >= 100, np.sqrt(square / np.maximum(count, 1)), np.nan)
    return out


def _peaks(values: Sequence[Array], rows: Sequence[Bools], dt: float) -> Array:
    """The 99 % quantile of the largest |residual| in spans, shape (n,)."""
    size = max(1, round(SPAN / dt))
    peaks: list[list[float]] = [[] for _ in range(values[0].shape[1])]
    for value, wanted in zip(values, rows, strict=True):
        for k in range(0, len(value) - size + 1, size):
            inside = wanted[k : k + size]
            largest = np.abs(value[k : k + size]).max(axis=0)
            for j in np.flatnonzero(inside.all(axis=0)):
                peaks[j].append(float(largest[j]))
    return np.array([np.quantile(p, 0.99) if len(p) >= 10 else np.nan for p in peaks])


def _windows(values: Sequence[Array], rows: Sequence[Bools], dt: float) -> tuple[Array, Array]:
    """Features of each window, and the group of windows that it belongs to."""
    size, long = max(4, round(WINDOW / dt)), round(GROUP / dt)
    table, groups = [], []
    for log, (value, wanted) in enumerate(zip(values, rows, strict=True)):
        for k in range(0, len(value) - size + 1, size):
            if wanted[k : k + size].all():
                part = value[k : k + size]
                steps = np.diff(part, axis=0)
                table.append(
                    np.concatenate([
                        part.mean(axis=0), part.std(axis=0), steps.std(axis=0),
                        np.abs(steps).max(axis=0), np.abs(part).max(axis=0), part[-1] - part[0],
                    ])
                )  # fmt: skip
                groups.append(1000 * log + k // long)
    return np.array(table), np.array(groups)


def _auc(
    real: Sequence[Array], twin: Sequence[Array], rows: Sequence[Bools], dt: float, seed: int
) -> tuple[float, float]:
    a, groups = _windows(real, rows, dt)
    b, _ = _windows(twin, rows, dt)
    labels = np.repeat([0, 1], [len(a), len(b)])
    return _area(np.concatenate([a, b]), labels, np.concatenate([groups, groups]), seed)


def _real_auc(
    real: Sequence[Array], rows: Sequence[Bools], dt: float, seed: int
) -> tuple[float, float]:
    """Of windows of like motion: successive windows are given one label each in turn."""
    a, groups = _windows(real, rows, dt)
    return _area(a, np.arange(len(a), dtype=np.float64) % 2, groups, seed)


def _area(table: Array, labels: Array, groups: Array, seed: int) -> tuple[float, float]:
    if len(table) < 2 * FEWEST or len(np.unique(groups)) < 5:
        return (float("nan"),) * 2
    models = (
        HistGradientBoostingClassifier(max_iter=100, random_state=seed),
        make_pipeline(StandardScaler(), LogisticRegression(max_iter=1000)),
    )
    with threadpool_limits(1):  # small tables: threads cost more than they save
        chances = [
            cross_val_predict(
                model, table, labels, groups=groups, cv=GroupKFold(5), method="predict_proba"
            )
            for model in models
        ]
    first, second = (float(roc_auc_score(labels, chance[:, 1])) for chance in chances)
    return first, second
