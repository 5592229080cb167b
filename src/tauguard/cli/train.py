"""``tauguard train``: a detector from labelled recordings, or from collision-free logs alone."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from tauguard.datasets import AS_IS, Reading
from tauguard.findings import ArgumentError

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from tauguard import Detector


def command(
    traces: Path | None = None,
    model: Path | None = None,
    detector: str = "srq-svr",
    calibration: Path | None = None,
    false_alarms_per_hour: float | None = None,
    confidence: float | None = None,
    free: tuple[Path, ...] = (),
    twin: Path | None = None,
    robot: Path | None = None,
    columns: str | None = None,
    gains: tuple[float, ...] = (),
    payload: tuple[str, ...] = (),
    torque: bool = False,
    card: Path | None = None,
    accept: tuple[str, ...] = (),
    arm: str | None = None,
    folds: int | None = None,
    reading: Annotated[Reading, tyro.conf.arg(name="")] = AS_IS,
    json: Path | None = None,
) -> None:
    """Train a detector and write its model file.

    With --traces, the detector is trained on labelled recordings, some of them with collisions. The
    threshold comes from the collision-free recordings, each scored by a detector that was trained
    without it. With --calibration, the threshold guarantees a rate of false alarms on motion like
    that in the folder. With --free and --robot, the detector is trained on logs in which nothing
    touched a real arm, with at least 10 s of motion, better two minutes. A printed card then states
    the torques and forces that the detector can find, and the kinds of motion that the logs lack.

    Args:
        traces: folder of MCAP recordings with truth, as from `tauguard simulate`, or a dataset
            (`tauguard generate`), of which the first split is used.
        model: the model file (default: model.tauguard). A file that you name is overwritten.
        detector: with --traces, one of tauguard.detectors.DETECTORS, or module:Class of your own.
        calibration: folder of collision-free recordings that are not in --traces. Recordings with
            labelled collisions are refused; collisions without a label raise the threshold.
        false_alarms_per_hour: accepted rate on motion like that of the training (default: 10). With
            --calibration the threshold guarantees this rate. With --free, training fails if
            cross-validation shows a higher rate.
        confidence: with --calibration, the confidence of the guarantee (default: 0.95).
        free: collision-free logs of a real arm, files or a folder. A contact in them would raise
            the thresholds, so a log with far more alarms than the others is named and left out.
        twin: with --free, the TOML file of `tauguard twin` for that arm. --detector is trained on
            simulated contacts of the twin and on the logs; --robot is not needed.
        robot: URDF or MJCF file of that arm; files of `tauguard calibrate` and `tauguard twin`
            contain its gains.
        columns: columns of CSV files, see `tauguard detect`.
        gains: N m per ampere, one number for each joint (not needed for calibrated robot files and
            for the presets ur10e and ur5).
        payload: loads in the logs, see `tauguard calibrate`.
        torque: with --free, the logs hold joint torques in N m, see `tauguard calibrate`.
        card: with --free, draw the card here (PNG).
        accept: with --free, names of logs to keep even if they stand out, and of checks that may
            fail. alarms: more alarms in cross-validation than --false-alarms-per-hour, or bursts
            of torque like those of contacts. error: half of the time, the residual exceeds its
            bounds. gravity: the gravity torques differ from those of the robot file. order: two
            joints' columns seem exchanged.
        arm: for a dataset with several arms, the arm of the detector.
        folds: with --traces, number of folds of the cross-validation that sets the threshold; each
            fold needs one more training (default: 3). 1 is quicker, but only a third of the
            recordings then set the threshold.
        reading: with --free, how logs are read.
        json: write the results here as JSON.
    """
    _check_flags({name for name, value in locals().items() if value != DEFAULTS[name]})

    import tauguard as tg
    from tauguard.cli.output import print_findings
    from tauguard.cli.read import read_free
    from tauguard.datasets import twin_contacts
    from tauguard.report import write_json

    if folds is not None and folds < 1:
        raise ArgumentError(f"--folds {folds}: expected 1 or more")
    target = _target(model)
    rate = 10.0 if false_alarms_per_hour is None else false_alarms_per_hour
    if traces is not None:
        trained = labelled_motion(traces, detector, calibration, rate, confidence, arm, folds)
    elif twin is not None:
        logs = read_free(free, twin, columns, (), torque, reading)
        simulated, believed = twin_contacts(twin)
        trained = tg.train(logs, believed, detector, false_alarms_per_hour=rate, contacts=simulated)
    elif robot is None:
        raise ArgumentError("--free needs --robot")
    else:
        logs = read_free(free, robot, columns, payload, torque, reading)
        trained = tg.train(logs, gains=gains, false_alarms_per_hour=rate, accept=accept)
    trained.save(target)
    print_findings(trained.findings)
    print(f"{target}: {trained.text()}")
    if card is not None:
        trained.card().draw(card)
        print(f"{card}: drawn")
    if json is not None:
        write_json(json, trained.to_dict())


DEFAULTS = {name: one.default for name, one in inspect.signature(command).parameters.items()}
#: Flags that --traces, --free and --twin allow.
OF_TRACES = ("detector", "calibration", "confidence", "arm", "folds")
OF_FREE = ("robot", "columns", "gains", "payload", "torque", "card", "accept", "reading")
OF_TWIN = ("columns", "detector", "torque", "reading")


def _check_flags(given: Collection[str]) -> None:
    """Raise ``ArgumentError`` if flags are ``given`` that do not go together."""

    def among(names: Sequence[str]) -> str:
        found = ", ".join(f"--{name}" for name in names if name in given)
        return found.replace("--reading", "--mend or --resample")

    if ("traces" in given) == ("free" in given):
        raise ArgumentError("give --traces (labelled recordings) or --free (collision-free logs)")
    twin, traces = "twin" in given, "traces" in given
    others = [name for name in (*OF_TRACES, *OF_FREE) if name not in OF_TWIN]
    if twin and (traces or among(others)):
        raise ArgumentError(
            "--twin goes with --free, --columns, --detector, --torque, "
            "--false-alarms-per-hour, --mend and --resample only"
        )
    if not traces and not twin and (wrong := among(OF_TRACES)):
        raise ArgumentError(f"{wrong}: go with --traces only")
    if traces and (wrong := among(OF_FREE)):
        raise ArgumentError(f"{wrong}: with --free only, not with --traces")
    if "confidence" in given and "calibration" not in given:
        raise ArgumentError("--confidence belongs to a guarantee: give --calibration")


def _target(model: Path | None) -> Path:
    """The file to write; an existing file is replaced only if --model names it."""
    target = model or Path("model.tauguard")
    if not target.parent.is_dir():
        raise FileNotFoundError(f"{target}: the folder {target.parent} does not exist")
    if target.is_dir():
        raise IsADirectoryError(f"--model {target}: is a folder; expected the name of a file")
    if model is None and target.exists():
        raise FileExistsError(f"{target} is there already: name the file to write with --model")
    return target


def labelled_motion(
    traces: Path,
    method: str,
    calibration: Path | None,
    rate: float,
    confidence: float | None,
    arm: str | None,
    folds: int | None,
) -> Detector:
    """Train on labelled recordings."""
    import tauguard as tg
    from tauguard.detectors import make_detector

    if calibration is not None and calibration.resolve() == traces.resolve():
        raise ArgumentError(
            f"--calibration {calibration}: the same folder as --traces; give other recordings"
        )
    settings = make_detector(method)  # before the recordings are read, which takes a while
    return tg.train(
        tg.read_logs(traces, arm=arm),
        method=settings,
        false_alarms_per_hour=rate,
        folds=3 if folds is None else folds,
        calibration=None if calibration is None else tg.read_logs(calibration),
        confidence=0.95 if confidence is None else confidence,
    )
