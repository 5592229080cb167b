"""``tauguard train``: a detector from labelled recordings, or from collision-free logs alone."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from tauguard.datasets.columns import AS_IS, Reading
from tauguard.findings import ArgumentError

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from tauguard.detectors import ArmModel
    from tauguard.detectors.calibration.recording import Recording
    from tauguard.detectors.evaluation.cross_validation import CrossValidation
    from tauguard.detectors.scores.free_motion import FittedFreeMotion
    from tauguard.traces import Trace


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
    """
    _check_flags({name for name, value in locals().items() if value != DEFAULTS[name]})
    if folds is not None and folds < 1:
        raise ArgumentError(f"--folds {folds}: expected 1 or more")
    target = _target(model)
    rate = 10.0 if false_alarms_per_hour is None else false_alarms_per_hour
    if traces is not None:
        sure = 0.95 if confidence is None else confidence
        labelled_motion(traces, target, detector, calibration, rate, sure, arm, folds)
    elif twin is not None:
        from tauguard.cli.train_twin import twin_contacts

        twin_contacts(twin, free, target, columns, detector, rate, torque, reading)
    elif robot is None:
        raise ArgumentError("--free needs --robot")
    else:
        from tauguard.models.robot import bodies_file

        args = (columns, gains, payload, torque, card, accept, rate, reading)
        free_motion(free, bodies_file(robot), target, *args)


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
    model: Path,
    name: str,
    calibration: Path | None,
    rate: float,
    confidence: float,
    arm: str | None = None,
    folds: int | None = None,
) -> None:
    """Train on labelled recordings."""
    from tauguard.datasets.recordings import labelled
    from tauguard.detectors import make_detector, save_model, with_guarantee
    from tauguard.detectors.alarms.training import FOLDS, train_and_score
    from tauguard.detectors.calibration.nominal import nominal_arm
    from tauguard.detectors.thresholds.expected_rate import ExpectedRate
    from tauguard.detectors.thresholds.guarantee import check_guarantee
    from tauguard.report import two_digits

    # Check inputs and guarantee first, because the training takes minutes.
    method = make_detector(name)
    if calibration is not None and calibration.resolve() == traces.resolve():
        raise ArgumentError(
            f"--calibration {calibration}: the same folder as --traces; give other recordings"
        )
    free = labelled(calibration) if calibration is not None else []
    if free:
        check_guarantee([float(t.t[-1] - t.t[0]) for t in free], rate, confidence)
    recordings = labelled(traces, arm)
    parts = 1 if free else folds or FOLDS  # --calibration replaces the threshold
    alarm, scores = train_and_score(method, recordings, nominal_arm(recordings), rate, parts)
    guarantee = None
    if free:
        alarm, guarantee = with_guarantee(alarm, free, rate, confidence)
    save_model(alarm, model)
    collisions = sum(len(t.truth.collisions) for t in recordings if t.truth)
    print(
        f"{model}: {name} trained on {len(recordings)} recordings with {collisions} collisions, "
        f"threshold {alarm.threshold:.3g}"
    )
    if guarantee is None:
        print(ExpectedRate.of(scores).at(alarm.threshold, rate))
    else:
        hours = two_digits(guarantee.hours)
        print(
            f"guaranteed: at most {rate:g} false alarms per hour on motion like that of "
            f"{calibration} ({guarantee.episodes} episodes, {hours} h), with a "
            f"confidence of {guarantee.confidence:.0%}"
        )


def free_motion(
    free: tuple[Path, ...],
    robot: Path,
    model: Path,
    columns: str | None,
    gains: tuple[float, ...],
    payload: tuple[str, ...],
    torque: bool,
    card: Path | None,
    accept: tuple[str, ...] = (),
    per_hour: float = 10.0,
    reading: Reading | None = None,
) -> None:
    """Train on logs in which nothing should have touched the arm."""
    from tauguard.cli.free_logs import ACCEPTABLE, free_arm, free_detector, read_real, run_check
    from tauguard.cli.help_text import print_notes
    from tauguard.detectors import save_model
    from tauguard.detectors.alarms.training import free_alarm
    from tauguard.detectors.evaluation.acceptance import check_own_alarms, check_own_error
    from tauguard.detectors.features.motion_regimes import unseen_motion

    read = read_real(free, robot, columns, payload, torque, reading)
    print_notes(read.findings)
    own: dict[str, Recording] = dict(read)
    arm, _ = free_arm(robot, read.numbers, own, gains)
    logs_kept = [name for name in accept if name not in ACCEPTABLE]
    own, validation = validated_logs(own, arm, logs_kept)
    traces = {name: recording.trace for name, recording in own.items()}
    detector = free_detector(arm, own, accept)
    print_notes(unseen_motion(list(traces.values())))
    held = [log for log in validation.kept if log not in validation.accepted]
    run_check("error", accept, lambda: check_own_error(held))
    run_check("alarms", accept, lambda: check_own_alarms(held, per_hour))
    save_model(free_alarm(detector, list(traces.values())), model, robot)
    logs = "1 log" if len(traces) == 1 else f"{len(traces)} logs"
    print(f"{model}: trained on {logs}, {detector.seconds:.0f} s")
    show_card(detector, list(traces.values()), validation, card)


def validated_logs(
    recordings: dict[str, Recording], arm: ArmModel, accept: Sequence[str]
) -> tuple[dict[str, Recording], CrossValidation]:
    """Return the logs for the training, and print notes on logs that are left out or differ.

    Args:
        recordings: by file name.
        arm: nominal numbers and drive gains.
        accept: names of logs to keep in any case.

    Raises:
        ArgumentError: a name in ``accept`` is not that of a log.
    """
    from tauguard.cli.help_text import print_notes
    from tauguard.detectors.evaluation.cross_validation import cross_validate
    from tauguard.traces.logs import log_named

    names = list(recordings)
    accepted = [log_named(name, f"--accept {name}", names) for name in accept]
    validation = cross_validate(recordings, arm, accepted)
    print_notes(odd_notes(validation))
    out = {log.name for log in validation.left_out}
    return {name: recordings[name] for name in names if name not in out}, validation


def odd_notes(validation: CrossValidation) -> list[str]:
    """A line on each log with far more alarms than the others, or with other torques throughout."""
    from tauguard.detectors.evaluation.card_page import times

    notes = []
    count = sum(len(log.alarms) for log in validation.kept) or "none"
    others = f"{count} in {sum(log.seconds for log in validation.kept) / 60:.1f} min"
    for log in validation.left_out:
        cause = (
            f"a load (then give --payload {log.name}=KG or =unknown), another temperature"
            if log.throughout
            else "something touched the arm"
        )
        notes.append(
            f"{log.name} stands out: {times(log)}, judged by thresholds from the other logs, which "
            f"have {others}. Possible causes: {cause}, or a motion that the others lack. The log "
            "is left out of the training; if nothing touched the arm, keep it with --accept "
            f"{log.name}"
        )
    notes += [
        f"{log.name} stands out ({times(log)}) and is kept as --accept says: if it contains a "
        "contact, the thresholds rise, and similar contacts are missed"
        for log in validation.accepted
    ]
    notes += [
        f"{log.name}: its torques differ throughout from those of the other logs: did the arm "
        f"carry something (then give --payload {log.name}=KG or =unknown)?"
        for log in validation.kept
        if log.throughout
    ]
    return notes


def show_card(
    detector: FittedFreeMotion,
    traces: list[Trace],
    validation: CrossValidation,
    target: Path | None,
) -> None:
    """Print the threshold card of the detector, and draw it if ``target`` is given."""
    from tauguard.detectors.evaluation.card_page import draw, text
    from tauguard.detectors.evaluation.threshold_card import threshold_card

    found = threshold_card(detector, traces, validation)
    print(text(found))
    if target is not None:
        draw(target, found)
        print(f"{target}: drawn")
