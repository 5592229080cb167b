"""Compare a twin with the real arm on held-out logs: residuals, peaks, and classifiers."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import roc_auc_score
from sklearn.model_selection import GroupKFold, cross_val_predict
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from threadpoolctl import threadpool_limits

from tauguard.arrays import Array, Bools
from tauguard.detectors import ArmModel
from tauguard.detectors.alarms.alarm import CollisionAlarm
from tauguard.detectors.calibration.recording import Load, Recording
from tauguard.detectors.scores.free_motion import CONFIRMATION, FreeMotion
from tauguard.models import Drive
from tauguard.traces import Trace
from tauguard.twin.play import played, residual_of
from tauguard.twin.signals import SLOW

WINDOW = 0.2  # length of a classifier's window [s]
SPAN = 0.5  # length of a span whose peak is used [s]
GROUP = 5.0  # length of a group of windows that are in one fold [s]
BEGIN = 1.0  # time at a log's beginning that is left out, because the estimator settles [s]
#: Units of position [rad] and velocity [rad/s] in the distance between two windows.
PLACE, SPEED = 0.1, 0.2
#: Two windows repeat a motion if their distance is below ALIKE and the time between them is above
#: APART [s]. They are put into the group of the first window, which has the length REPEATED [s].
ALIKE, APART, REPEATED = 2.0, 1.5, 1.0
#: Least duration for a root mean square [s].
SHORTEST = 1.0
FEWEST = 40  # least number of windows of each kind for an area under a curve
FOLDS = 5  # number of folds


@dataclass(frozen=True, eq=False)
class Likeness:
    """Ratios of simulated to real residuals of held-out logs; NaN without enough motion."""

    rms: Array  #: ratio while the joint moves, shape (n,)
    peaks: Array  #: ratio of the 99 % quantiles of peaks of 0.5 s, moving, shape (n,)
    standing_rms: Array  #: ratio while no joint moves, shape (n,)
    standing_peaks: Array  #: ratio of the peaks while no joint moves, shape (n,)
    high: Array  #: fraction of the residual's power in sample-to-sample change, real and simulated
    correlation: Array  #: of residuals 0.1 s apart, real and simulated, shape (2, n)
    moving_auc: tuple[float, float]
    """Areas under the curves of two classifiers of real and simulated residuals, boosted trees and
    logistic regression; 0.5: they cannot distinguish them."""
    standing_auc: tuple[float, float]
    programs_auc: tuple[float, float]
    """Areas for classifiers of real residuals in motion: these logs against the logs from which the
    twin was identified. 0.5: the errors in both are alike. NaN: the latter logs are not given."""
    real_residuals: tuple[Array, ...]  #: of each log [N m]
    twin_residuals: tuple[Array, ...]
    times: tuple[Array, ...]  #: of the residuals [s]
    played: tuple[Trace, ...]  #: the logs with the twin's currents
    alarms: tuple[int, int] = (0, 0)
    """Numbers of alarms of free-motion in the real logs and in ``played``, see
    :func:`with_alarms`."""

    @property
    def seconds(self) -> float:
        """Total length of the logs [s]."""
        return sum(float(trace.t[-1] - trace.t[0]) for trace in self.played)


def with_alarms(
    likeness: Likeness, recordings: Sequence[Recording], arm: ArmModel, traces: Sequence[Trace]
) -> Likeness:
    """The comparison with the alarms of a free-motion detector trained on the twin's logs.

    Args:
        likeness: comparison on ``traces``.
        recordings: the collision-free logs from which the twin was identified.
        arm: nominal arm, as in :func:`tauguard.detectors.calibration.identification.identify`.
        traces: held-out logs without a load.

    Raises:
        ValueError: the recordings are too short.
    """
    free = FreeMotion().fit(list(recordings), arm).carrying(Load())
    alarm = CollisionAlarm(free, 1.0, CONFIRMATION)
    arms, twins = (
        sum(len(alarm.detect(trace).alarms) for trace in logs) for logs in (traces, likeness.played)
    )
    return replace(likeness, alarms=(arms, twins))


def compare(
    arm: ArmModel,
    drive: Drive,
    traces: Sequence[Trace],
    own: Sequence[Trace] = (),
) -> Likeness:
    """Compute the twin's currents along logs, and compare its residuals with the real ones.

    Args:
        arm: calibrated without these logs.
        drive: drive of the twin.
        traces: held-out logs.
        own: the logs from which the twin was identified, for ``programs_auc``.
    """
    others = [
        replace(trace, current=played(arm, drive, trace, k)) for k, trace in enumerate(traces)
    ]
    real, twin = ([track(arm, trace) for trace in logs] for logs in (traces, others))
    moving = [one.fast for one in real]
    standing = [np.broadcast_to(one.still[:, None], one.fast.shape) for one in real]
    dt = float(np.median(np.concatenate([np.diff(trace.t) for trace in traces])))
    lag = max(1, round(0.1 / dt))
    both = np.array([np.concatenate([one.residual for one in logs]) for logs in (real, twin)])
    return Likeness(
        _rms(twin, moving) / _rms(real, moving),
        _peaks(twin, moving) / _peaks(real, moving),
        _rms(twin, standing) / _rms(real, standing),
        _peaks(twin, standing) / _peaks(real, standing),
        (np.diff(both, axis=1) ** 2).mean(axis=1) / (2 * both.var(axis=1) + 1e-12),
        ((both[:, lag:] * both[:, :-lag]).mean(axis=1) / ((both**2).mean(axis=1) + 1e-12)),
        classifier_areas(real, twin, False),
        classifier_areas(real, twin, True),
        _programs_auc([track(arm, trace) for trace in own], real),
        tuple(one.residual for one in real),
        tuple(one.residual for one in twin),
        tuple(one.t for one in real),
        tuple(others),
    )


@dataclass(frozen=True, eq=False)
class Track:
    """Motion and residuals along a log after :data:`BEGIN`."""

    t: Array  #: [s], shape (T,)
    motion: Array  #: positions and velocities in units of PLACE and SPEED, shape (T, 2 n)
    residual: Array  #: [N m], shape (T, n)
    fast: Bools  #: whether each joint moves, shape (T, n)

    @property
    def still(self) -> Bools:
        """Whether no joint moves, shape (T,)."""
        return np.asarray(~self.fast.any(axis=1))


def track(arm: ArmModel, trace: Trace) -> Track:
    """The residuals of an arm model along a log."""
    rows = slice(int(BEGIN / float(np.median(np.diff(trace.t)))), None)
    motion = np.hstack([trace.q / PLACE, trace.qd / SPEED])
    fast = np.asarray(np.abs(trace.qd[rows]) > SLOW)
    return Track(trace.t[rows], motion[rows], residual_of(arm, trace)[rows], fast)


def _rms(logs: Sequence[Track], rows: Sequence[Bools]) -> Array:
    """Root mean square over each joint's rows, shape (n,); NaN if shorter than SHORTEST."""
    seconds = np.concatenate([np.gradient(one.t) for one in logs])
    weight = np.concatenate(rows) * seconds[:, None]
    total = weight.sum(axis=0)
    square = (weight * np.concatenate([one.residual for one in logs]) ** 2).sum(axis=0)
    out: Array = np.where(total >= SHORTEST, np.sqrt(square / np.maximum(total, 1e-9)), np.nan)
    return out


def _spans(t: Array, length: float) -> list[slice]:
    """The samples of successive spans of time; spans with fewer than four are left out."""
    ends = np.searchsorted(t, np.arange(t[0], t[-1], length))
    return [slice(a, b) for a, b in itertools.pairwise(ends) if b - a >= 4]


def _peaks(logs: Sequence[Track], rows: Sequence[Bools]) -> Array:
    """The 99 % quantile of the largest |residual| in spans, shape (n,)."""
    peaks: list[list[float]] = [[] for _ in range(rows[0].shape[1])]
    for one, wanted in zip(logs, rows, strict=True):
        for span in _spans(one.t, SPAN):
            largest = np.abs(one.residual[span]).max(axis=0)
            for j in np.flatnonzero(wanted[span].all(axis=0)):
                peaks[j].append(float(largest[j]))
    return np.array([np.quantile(p, 0.99) if len(p) >= 10 else np.nan for p in peaks])


def _windows(logs: Sequence[Track], still: bool) -> list[tuple[int, slice]]:
    """Log and samples of each window in which the arm stands throughout, or moves throughout."""
    found = []
    for log, one in enumerate(logs):
        wanted = one.still == still
        found += [(log, span) for span in _spans(one.t, WINDOW) if wanted[span].all()]
    return found


def _features(logs: Sequence[Track], windows: Sequence[tuple[int, slice]]) -> Array:
    table = []
    for log, span in windows:
        part = logs[log].residual[span]
        steps = np.diff(part, axis=0)
        table.append(
            np.concatenate([
                part.mean(axis=0), part.std(axis=0), steps.std(axis=0),
                np.abs(steps).max(axis=0), np.abs(part).max(axis=0), part[-1] - part[0],
            ])
        )  # fmt: skip
    return np.array(table)


def _groups_of(logs: Sequence[Track], windows: Sequence[tuple[int, slice]]) -> NDArray[np.int64]:
    """The group of each window, see :func:`_groups`."""
    place = [logs[log].motion[span].mean(axis=0) for log, span in windows]
    starts = [logs[log].t[span.start] - logs[log].t[0] for log, span in windows]
    return _groups(np.array(place), np.array([log for log, _ in windows]), np.array(starts))


def _groups(place: Array, logs: NDArray[np.int64], starts: Array) -> NDArray[np.int64]:
    """Groups of windows that stay in one fold: those of one motion, or of one part of a log.

    If a program repeats a cycle, a classifier without groups would be tested on motion that it was
    trained on, and could distinguish even two draws of one process. If there are fewer motions than
    folds, as for an arm that stands in few poses, the groups are parts of a log. The areas can then
    be too large.

    Args:
        place: position and velocity in units of :data:`PLACE` and :data:`SPEED`, shape (W, 2 n).
        logs: in ascending order, shape (W,).
        starts: time since the log's beginning [s], ascending in each log, shape (W,).
    """
    if not len(place):
        return np.empty(0, dtype=np.int64)
    parts = 100_000 * logs + (starts / GROUP).astype(np.int64)
    before, repeated = _alike(place, logs, starts)
    length = np.where(repeated, REPEATED, GROUP)
    groups = 2 * (100_000 * logs + (starts / length).astype(np.int64)) + repeated
    for i in np.flatnonzero(before >= 0):  # in order, so that groups[before[i]] is final
        groups[i] = groups[before[i]]
    return groups if len(np.unique(groups)) >= FOLDS else parts


def _alike(place: Array, logs: NDArray[np.int64], starts: Array) -> tuple[NDArray[np.int64], Bools]:
    """The nearest earlier window of the same motion (-1: none), and whether any window repeats it.

    Of windows at equal places only the first and the last are compared: if they are too near in
    time, so are those between. The number of neighbours grows until an earlier one is found.
    """
    count = len(place)
    # Mean positions at rest differ in the last bits.
    places, first, which = np.unique(
        np.round(place, 9), axis=0, return_index=True, return_inverse=True
    )
    last = np.zeros(len(places), dtype=np.int64)
    np.maximum.at(last, which.ravel(), np.arange(count))
    tree = cKDTree(places)

    def apart(i: NDArray[np.int64], j: NDArray[np.int64]) -> Bools:
        out: Bools = (logs[i] != logs[j]) | (np.abs(starts[i] - starts[j]) > APART)
        return out

    before, repeated = np.full(count, -1), np.zeros(count, dtype=np.bool_)
    left, near = np.arange(count), 32
    while len(left):
        near, more = min(near, len(places)), []
        for rows in np.array_split(left, 1 + len(left) * near // 2_000_000):
            far, at = tree.query(place[rows], near, distance_upper_bound=ALIKE)
            far, at, own = far.reshape(len(rows), -1), at.reshape(len(rows), -1), rows[:, None]
            within = np.isfinite(far)
            at[~within] = 0
            early, late = first[at], last[at]
            usable = within & (early < own) & apart(early, own)
            far[~usable] = np.inf
            least = far.min(axis=1)
            found = np.isfinite(least)
            nearest = np.where(usable & (far <= least[:, None] + 1e-9), early, count).min(axis=1)
            before[rows[found]] = nearest[found]
            repeated[rows] |= (within & (apart(early, own) | apart(late, own))).any(axis=1)
            more.append(rows[within[:, -1] & ~found])
        left = np.concatenate(more) if near < len(places) else np.empty(0, dtype=np.int64)
        near *= 4
    return before, repeated


def classifier_areas(
    real: Sequence[Track], twin: Sequence[Track], still: bool
) -> tuple[float, float]:
    """Areas under the curves of two classifiers of windows of real and simulated residuals.

    Args:
        real: real logs.
        twin: the twin along the same motion.
        still: whether windows in which the arm stands are used, or those in which it moves.

    Returns:
        Areas of boosted trees and of logistic regression; NaN with too few windows or groups.
    """
    windows = _windows(real, still)
    table = np.concatenate([_features(real, windows), _features(twin, windows)])
    groups = np.tile(_groups_of(real, windows), 2)
    return _area(table, np.repeat([0, 1], len(windows)), groups)


def _programs_auc(own: Sequence[Track], real: Sequence[Track]) -> tuple[float, float]:
    """Areas for moving windows of real residuals: the twin's own logs against held-out logs."""
    logs = [*own, *real]
    windows = _windows(logs, False)
    labels = np.array([float(log >= len(own)) for log, _ in windows])
    if min(np.sum(labels == 0), np.sum(labels == 1)) < FEWEST:
        return (float("nan"),) * 2
    return _area(_features(logs, windows), labels, _groups_of(logs, windows))


def _area(table: Array, labels: Array, groups: NDArray[np.int64]) -> tuple[float, float]:
    if len(table) < 2 * FEWEST or len(np.unique(groups)) < FOLDS:
        return (float("nan"),) * 2
    models = (
        HistGradientBoostingClassifier(max_iter=100, random_state=0),
        make_pipeline(StandardScaler(), LogisticRegression(max_iter=1000)),
    )
    with threadpool_limits(1):  # for small tables, threads cost more time than they save
        chances = [
            cross_val_predict(
                model, table, labels, groups=groups, cv=GroupKFold(FOLDS), method="predict_proba"
            )
            for model in models
        ]
    first, second = (float(roc_auc_score(labels, chance[:, 1])) for chance in chances)
    return first, second
