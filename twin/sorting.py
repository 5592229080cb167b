"""Check that all logs are of one arm with the given loads; other logs would distort a twin."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from tauguard.arrays import Array, Bools
from tauguard.detectors import ArmModel
from tauguard.detectors.calibration.assessment import UnexplainedCheck, outlier, residual_rms
from tauguard.detectors.calibration.identification import Subsets
from tauguard.detectors.calibration.recording import Load, Recording
from tauguard.findings import RefusedError, TauguardError, cause

#: Logs are of two arms if calibrations from each of two groups of logs reduce the sum of the logs'
#: residuals by this factor, compared with one calibration from all logs. The factor is 1.0 to 1.2
#: for one arm's logs grouped by program (UR5, UR3, UR10e), and 2.9 to 66 for two arms, or if a load
#: in some logs was not given.
TWO = 2.0
ROUNDS = 4
Errors = Callable[[int, Sequence[int]], float]


def odd_logs(arm: ArmModel, names: Sequence[str], recordings: Sequence[Recording]) -> list[int]:
    """Indices of logs without a load that differ from all other logs, at most a third of them.

    Args:
        arm: nominal numbers, and gains that are kept.
        names: names of the logs.
        recordings: with their loads, all with motion.

    Raises:
        RefusedError: the logs are of two arms or two loads; names the logs of each.
    """
    told = [k for k, r in enumerate(recordings) if r.load == Load()]
    errors = _errors(arm, [recordings[k] for k in told])
    odd: list[int] = []
    while len(told) - len(odd) >= 3 and 3 * len(odd) < len(told):
        rest = [k for k in range(len(told)) if k not in odd]
        found = outlier([np.array([errors(k, rest)]) for k in rest], UnexplainedCheck.outlying)
        if found is None:
            break
        odd.append(rest[found[0]])
    rest = [k for k in range(len(told)) if k not in odd]
    if len(rest) >= 4:
        side = _split_in_two(errors, rest)
        if side is not None:
            one, two = (", ".join(names[told[k]] for k in np.array(rest)[s]) for s in (side, ~side))
            text = (
                f"{one} and {two} do not predict each other: they are of two arms, or some carry a "
                'load that was not given (`payload={"LOG": KG}` or `payload={"LOG": None}` for '
                "each that does)"
            )
            raise RefusedError(cause("two-arms", text))
    return [told[k] for k in odd]


def _errors(arm: ArmModel, recordings: Sequence[Recording]) -> Errors:
    """A function that computes a log's residual with a calibration from a group of logs [N m].

    The result is inf if the other logs of the group have too little motion.
    """
    calibrated = Subsets(replace(arm, friction=None), recordings)

    @cache
    def arm_of(own: tuple[int, ...]) -> ArmModel | None:
        try:
            return calibrated(own)
        except TauguardError:  # too little motion
            return None

    def error(k: int, group: Sequence[int]) -> float:
        found = arm_of(tuple(sorted(set(group) - {k})) or (k,))
        if found is None:
            return np.inf
        return float(np.linalg.norm(residual_rms(found, recordings[k].trace)))

    return error


def _split_in_two(errors: Errors, logs: Sequence[int]) -> Bools | None:
    """Whether each log is of the second of two arms, shape (len(logs),); None: all are of one.

    As in k-means, each log is moved to the group whose other logs predict it better, in turn.
    """

    def of(side: Bools) -> tuple[Array, Array]:
        groups = [[m for m, s in zip(logs, side, strict=True) if s == which] for which in (0, 1)]
        values = [
            [errors(k, g) if set(g) - {k} else np.inf for k in logs] for g in groups
        ]  # fmt: skip
        return np.array(values[0]), np.array(values[1])

    whole = np.array([errors(k, logs) for k in logs])
    first = logs[int(np.argmax(whole))]
    far = np.array([errors(k, [first]) if k != first else 0.0 for k in logs])
    second = logs[int(np.argmax(far))]
    side = np.array(
        [
            k == second or (k != first and errors(k, [second]) < f)
            for k, f in zip(logs, far, strict=True)
        ]
    )
    for _ in range(ROUNDS):
        one, two = of(side)
        closer = two < one
        if (closer == side).all():
            break
        side = closer
    best = np.minimum(*of(side))
    if min(side.sum(), (~side).sum()) < 2 or not np.isfinite(best).all():
        return None
    return side if whole.sum() > TWO * best.sum() else None
