"""The methods of the table: what each is, its source, its inputs, its knob, and its scores.

A method is fitted to collision-free logs of an arm and then gives every sample of a log a score. An
alarm is a score above the knob for 40 ms. The knob is relative: with 1 the threshold is the one
that the method learns from its training logs. Observers use tauguard's calibration of the arm, so
that the rows compare rules of detection and not calibrations.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from studies.real_arms.observers import OBSERVERS, sliding_mode
from tauguard.arrays import Array, Bools
from tauguard.benchmark.judging import SETTLE
from tauguard.detectors import ArmModel, make_detector
from tauguard.detectors.calibration.log_torques import drive_torque
from tauguard.detectors.scores.free_motion import FreeMotion, with_load_of
from tauguard.traces.logs import Recording

Score = Callable[[Recording], Array]
#: Bandwidths of observers [1/s] among which the tuning chooses.
BANDWIDTHS = (10.0, 30.0, 60.0)


@dataclass
class Training:
    """Collision-free logs of an arm, and what every method may use of them."""

    logs: list[Recording]
    start: ArmModel  #: the arm without a calibration
    standing: bool  #: subtract the mean at the beginning of a log: the arm carries an unknown load
    _residuals: dict[tuple[int, str, float], tuple[Recording, Array]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Calibrate."""
        self.free_motion = FreeMotion().fit(self.logs, self.start)
        self.arm = self.free_motion.arm
        enough = [log for log in self.logs if log.trace.t[-1] - log.trace.t[0] > 2 * SETTLE]
        self.logs = enough or self.logs

    def residual(self, log: Recording, rate: float, observer: str = "momentum observer") -> Array:
        """External torque that an observer gives [N m], shape (T, n)."""
        key = id(log), observer, rate
        if key not in self._residuals:
            arm = with_load_of(log, self.free_motion).arm
            tau = drive_torque(arm, log.trace)
            if observer == "sliding-mode observer":  # slow, so that all bandwidths run at once
                every = np.array(BANDWIDTHS)[:, None]
                values = sliding_mode(arm, log.trace, tau, every).swapaxes(0, 1)
                observed = dict(zip(BANDWIDTHS, values, strict=True))
            else:
                observed = {rate: OBSERVERS[observer](arm, log.trace, tau, rate)}
            t = log.trace.t - log.trace.t[0]
            for bandwidth, value in observed.items():
                if self.standing:
                    value = value - value[(t > SETTLE) & (t < 2 * SETTLE)].mean(axis=0)
                self._residuals[id(log), observer, bandwidth] = log, value
        return self._residuals[key][1]

    def settled(self, log: Recording) -> Bools:
        """Rows after the beginning of a log, shape (T,)."""
        return np.asarray(log.trace.t - log.trace.t[0] > SETTLE)

    def over(self, signal: Callable[[Recording], Array]) -> Array:
        """A signal in the settled rows of all training logs."""
        found: Array = np.concatenate([signal(log)[self.settled(log)] for log in self.logs])
        return found

    def windows(self, log: Recording, length: float) -> Array:
        """Five residuals of every joint over ``length`` [s], each over its spread, (T, 5 n)."""
        rate = BANDWIDTHS[1]
        spread = self.over(lambda one: self.residual(one, rate)).std(axis=0) + 1e-9
        signal = self.residual(log, rate) / spread
        step = max(1, round(length / 4 / log.trace.dt))
        rows = np.arange(len(signal))[:, None] - step * np.arange(5)
        windows: Array = signal[np.maximum(rows, 0)].reshape(len(signal), -1)
        return windows


@dataclass(frozen=True)
class Method:
    """One method of the table."""

    name: str
    source: str
    inputs: str
    fit: Callable[[Training, float], Score]
    tuned: str = "nothing"  #: the constant that the tuning chooses
    settings: tuple[float, ...] = (1.0,)  #: values of this constant


# -- floors: methods that know nothing -------------------------------------------------------------


def every_half_second(training: Training, _: float) -> Score:
    """An alarm every half second; with a higher knob every 1, 2, 4 ... s."""

    def score(log: Recording) -> Array:
        t = log.trace.t - log.trace.t[0]
        number = np.maximum(np.floor(t / 0.5).astype(int), 1)
        doublings = np.log2(number & -number)
        # Up for 80 ms: 40 ms to confirm, and an alarm of 40 ms.
        return np.where(t % 0.5 < 0.08, 1.01 + 0.8 * doublings, 0.0)

    return score


def at_random(training: Training, _: float) -> Score:
    """Alarms at random times, two a second; with a higher knob fewer."""

    def score(log: Recording) -> Array:
        t = log.trace.t - log.trace.t[0]
        rng = np.random.default_rng(zlib.crc32(np.round(log.trace.q[0], 6).tobytes()))
        out = np.zeros(len(t))
        for time in np.sort(rng.uniform(0, t[-1], rng.poisson(2 * t[-1]))):
            rows = (t >= time) & (t < time + 0.08)
            out[rows] = 1.01 + rng.exponential(1 / 0.9)
        return out

    return score


# -- ours ------------------------------------------------------------------------------------------


def free_motion(training: Training, _: float) -> Score:
    """The detector of ``tauguard train --free``."""
    return lambda log: with_load_of(log, training.free_motion).scores(log.trace)


def own(name: str) -> Callable[[Training, float], Score]:
    """A method of the package, or a user's ``module:Class``, on the calibrated arm."""

    def fit(training: Training, _: float) -> Score:
        fitted = make_detector(name).fit([log.trace for log in training.logs], training.arm)
        return lambda log: fitted.scores(log.trace)

    return fit


# -- thresholds on observers and currents ----------------------------------------------------------


def constant(observer: str) -> Callable[[Training, float], Score]:
    """A joint's threshold is its largest value in training."""

    def fit(training: Training, rate: float) -> Score:
        limit = np.abs(training.over(lambda log: training.residual(log, rate, observer))).max(0)
        return lambda log: (np.abs(training.residual(log, rate, observer)) / limit).max(axis=1)

    return fit


def one_ampere(training: Training, rate: float) -> Score:
    """1 A of current that the model does not explain; 10 N m on arms that measure torques."""
    gain = np.abs(training.arm.drive_gain)
    limit = gain if (gain != 1).any() else 10.0
    return lambda log: (np.abs(training.residual(log, rate)) / limit).max(axis=1)


def by_speed(training: Training, rate: float) -> Score:
    """The 99.9 % quantile of the residual in each of five classes of the joint's speed."""
    edges = np.array([0.02, 0.1, 0.3, 0.8])
    size = np.abs(training.over(lambda log: training.residual(log, rate)))
    kind = np.digitize(np.abs(training.over(lambda log: log.trace.qd)), edges)
    limit = np.empty((len(edges) + 1, size.shape[1]))
    for speed in range(len(limit)):
        for joint in range(size.shape[1]):
            rows = size[kind[:, joint] == speed, joint]
            enough = len(rows) > 100
            limit[speed, joint] = np.quantile(rows, 0.999) if enough else size[:, joint].max()

    def score(log: Recording) -> Array:
        now = np.take_along_axis(limit, np.digitize(np.abs(log.trace.qd), edges), axis=0)
        ratio: Array = (np.abs(training.residual(log, rate)) / now).max(axis=1)
        return ratio

    return score


def conformal(training: Training, rate: float) -> Score:
    """Split conformal prediction: spreads from every second log, the quantile from the others."""
    halves = training.logs[::2], training.logs[1::2] or training.logs

    def sizes(logs: Sequence[Recording]) -> Array:
        return np.concatenate(
            [np.abs(training.residual(log, rate))[training.settled(log)] for log in logs]
        )

    spread = np.sqrt((sizes(halves[0]) ** 2).mean(axis=0)) + 1e-9
    scores = np.sort((sizes(halves[1]) / spread).max(axis=1))
    rank = min(len(scores) - 1, int(np.ceil(0.999 * (len(scores) + 1))) - 1)
    limit = scores[rank]
    return lambda log: (np.abs(training.residual(log, rate)) / spread).max(axis=1) / limit


def band_pass(training: Training, upper: float) -> Score:
    """Currents (torques) from 1 Hz to ``upper`` [Hz]; the threshold is the largest in training."""
    from scipy.signal import lfilter

    def low(x: Array, frequency: float, dt: float) -> Array:
        keep = float(np.exp(-2 * np.pi * frequency * dt))
        out: Array = lfilter([1 - keep], [1, -keep], x, axis=0, zi=keep * x[:1])[0]
        return out

    def band(log: Recording) -> Array:
        x, dt = log.trace.current, log.trace.dt
        return np.abs(low(x, upper, dt) - low(x, 1.0, dt))

    limit = training.over(band).max(axis=0)
    return lambda log: (band(log) / limit).max(axis=1)


# -- one class of windows --------------------------------------------------------------------------


def one_class_svm(training: Training, length: float) -> Score:
    """A one-class SVM on windows of the residual."""
    from sklearn.svm import OneClassSVM

    x = _sample(training.over(lambda log: training.windows(log, length)))
    svm = OneClassSVM(nu=0.001, gamma=1 / (10 * x.shape[1])).fit(x)
    limit = max(float(svm.offset_[0]), 1e-9)
    return lambda log: limit / np.maximum(svm.score_samples(training.windows(log, length)), 1e-9)


def mahalanobis(training: Training, length: float) -> Score:
    """The distance of a window from the mean of all windows."""
    x = _sample(training.over(lambda log: training.windows(log, length)))
    mean, inverse = x.mean(axis=0), np.linalg.pinv(np.cov(x.T) + 1e-6 * np.eye(x.shape[1]))

    def distance(windows: Array) -> Array:
        off = windows - mean
        out: Array = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", off, inverse, off), 0.0))
        return out

    limit = np.quantile(distance(x), 0.999)
    return lambda log: distance(training.windows(log, length)) / limit


def linear_autoencoder(training: Training, length: float) -> Score:
    """The error with which as many components as joints reconstruct a window (PCA)."""
    x = _sample(training.over(lambda log: training.windows(log, length)))
    mean = x.mean(axis=0)
    vectors = np.linalg.eigh(np.cov(x.T))[1]
    rest = vectors[:, : x.shape[1] * 4 // 5]

    def error(windows: Array) -> Array:
        out: Array = np.linalg.norm((windows - mean) @ rest, axis=1)
        return out

    limit = np.quantile(error(x), 0.999)
    return lambda log: error(training.windows(log, length)) / limit


def _sample(x: Array, most: int = 3000) -> Array:
    return x[:: max(1, len(x) // most)]


#: Lengths of windows [s] among which the tuning chooses.
LENGTHS = (0.05, 0.1, 0.2)
#: Upper corners of the band pass [Hz].
CORNERS = (5.0, 10.0, 20.0)
_PARK = "Park et al., Sensors 21 (2021)"
_CALIBRATED = "q, qd, current or torque, calibration"
METHODS = {
    method.name: method
    for method in (
        Method("knows nothing", "floor: an alarm of 40 ms every 0.5 s", "none", every_half_second),
        Method("alarm at random", "floor: two alarms of 40 ms a second", "none", at_random),
        Method("tauguard free-motion", "tauguard", "q, qd, current or torque", free_motion),
        *(
            Method(f"tauguard {name}", "tauguard", _CALIBRATED, own(name))
            for name in ("residual-thresholds", "moving-thresholds")
        ),
        *(
            Method(name, source, _CALIBRATED, constant(name), "bandwidth", BANDWIDTHS)
            for name, source in {
                "momentum observer": "De Luca et al., IROS 2006",
                "disturbance observer": "Chen et al. 2000, Mohammadi et al. 2013",
                "sliding-mode observer": "Garofalo et al., RA-L 2019",
                "Kalman filter": "Wahrburg et al., T-ASE 2018",
            }.items()
        ),
        Method("1 A rule", "a constant limit", _CALIBRATED, one_ampere, "bandwidth", BANDWIDTHS),
        Method("quantile by speed", "a table", _CALIBRATED, by_speed, "bandwidth", BANDWIDTHS),
        Method("conformal", "split conformal", _CALIBRATED, conformal, "bandwidth", BANDWIDTHS),
        Method("band pass", "a filter", "current or torque", band_pass, "corner", CORNERS),
        Method("one-class SVM", _PARK, _CALIBRATED, one_class_svm, "window", LENGTHS),
        Method("Mahalanobis", "distance", _CALIBRATED, mahalanobis, "window", LENGTHS),
        Method("linear autoencoder", _PARK, _CALIBRATED, linear_autoencoder, "window", LENGTHS),
    )
}
