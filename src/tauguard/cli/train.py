"""``tauguard train``: a detector from labelled recordings, or from collision-free logs alone."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tauguard.detectors.methods.free_motion import FreeMotionDetector
    from tauguard.traces import Trace


def command(
    traces: Path | None = None,
    model: Path | None = None,
    detector: str = "srq-svr",
    calibration: Path | None = None,
    false_alarms_per_hour: float | None = None,
    confidence: float | None = None,
    free: tuple[Path, ...] = (),
    robot: Path | None = None,
    columns: str | None = None,
    gains: tuple[float, ...] = (),
    payload: tuple[str, ...] = (),
    sensitivity: bool = False,
    arm: str | None = None,
) -> None:
    """Train a detector and write its model file.

    With --traces: on labelled recordings, some with collisions; a third of the collision-free ones
    is kept for the threshold. With --calibration the threshold is guaranteed instead: no more than
    the false alarms per hour that you name, on motion like that.
    With --free and --robot: a detector of a real arm from logs in which nothing touched it; three
    or more, with dwells and with moves of single joints among them, or those raise alarms later.

    Args:
        traces: folder of MCAP recordings with truth (`tauguard simulate` writes such), or a
            dataset (`tauguard generate`), whose first split it is trained on.
        model: the model file; one that is there is replaced if it is named (default: model.skops,
            or model.json with --free).
        detector: with --traces, one of tauguard.detectors.DETECTORS, or module:Class of your own.
        calibration: folder of collision-free recordings that are not in --traces. Those with
            labelled collisions are refused; collisions without a label raise the threshold.
        false_alarms_per_hour: what the threshold aims at on motion like the training's
            (default: 10, or 1 with --free), or guarantees with --calibration.
        confidence: with --calibration, the confidence of the guarantee (default: 0.95).
        free: collision-free logs of a real arm, files or a folder; a contact in them raises the
            bounds, so that others like it are missed later.
        robot: URDF or MJCF of that arm; one that `tauguard calibrate` wrote brings its gains.
        columns: of CSV files, see `tauguard detect`.
        gains: N m per ampere, one a joint (known for calibrated robot files and for ur10e).
        payload: what the logs carried, see `tauguard calibrate`.
        sensitivity: with --free, also print the smallest added blow that is found, for each joint.
        arm: of a dataset with several arms, the one that the detector is for.
    """
    if (traces is None) == (not free):
        raise ValueError("give --traces (labelled recordings) or --free (collision-free logs)")
    target = _target(model, "model.json" if free else "model.skops")
    if free and (calibration or confidence is not None or detector != "srq-svr"):
        raise ValueError("--detector, --calibration and --confidence go with --traces only")
    if calibration is None and confidence is not None:
        raise ValueError("--confidence belongs to a guarantee: give --calibration")
    if traces is not None:
        own: dict[str, object] = {
            "--robot": robot,
            "--columns": columns,
            "--gains": gains,
            "--payload": payload,
            "--sensitivity": sensitivity,
        }
        if given := [name for name, value in own.items() if value]:
            raise ValueError(f"{', '.join(given)}: with --free only, not with --traces")
        rate = 10.0 if false_alarms_per_hour is None else false_alarms_per_hour
        sure = 0.95 if confidence is None else confidence
        labelled_motion(traces, target, detector, calibration, rate, sure, arm)
        return
    if target.suffix == ".skops":
        raise ValueError(f"--model {target}: --free writes JSON; give a name that ends in .json")
    if robot is None:
        raise ValueError("--free needs --robot")
    rate = 1.0 if false_alarms_per_hour is None else false_alarms_per_hour
    free_motion(free, robot, target, rate, columns, gains, payload, sensitivity)


def _target(model: Path | None, default: str) -> Path:
    """The file to write, in a folder that there is; one that was not named is not replaced."""
    target = model or Path(default)
    if not target.parent.is_dir():
        raise FileNotFoundError(f"{target}: the folder {target.parent} does not exist")
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
) -> None:
    """Train on labelled recordings."""
    from tauguard.cli.fitting import trained
    from tauguard.cli.folder import labelled
    from tauguard.detectors import make_detector, save_model, with_guarantee
    from tauguard.detectors.thresholds.guarantee import check_guarantee

    # First: what cannot be used, or cannot be guaranteed, is better named before training.
    make_detector(name)
    if calibration is not None and calibration.resolve() == traces.resolve():
        raise ValueError(f"--calibration {calibration}: is --traces; give recordings not in it")
    free = labelled(calibration) if calibration is not None else []
    if free:
        check_guarantee([float(t.t[-1] - t.t[0]) for t in free], rate, confidence)
    recordings = labelled(traces, arm)
    alarm, guarantee = trained(recordings, rate, name), None
    if free:
        alarm, guarantee = with_guarantee(alarm, free, rate, confidence)
    save_model(alarm, model)
    collisions = sum(len(t.truth.collisions) for t in recordings if t.truth)
    print(
        f"{model}: {name} trained on {len(recordings)} recordings with {collisions} collisions, "
        f"threshold {alarm.threshold:.3g}"
    )
    if guarantee:
        print(
            f"guaranteed: at most {rate:g} false alarms per hour on motion like that of "
            f"{calibration} ({guarantee.episodes} episodes, {guarantee.hours:.2g} h), with a "
            f"confidence of {guarantee.confidence:.0%}"
        )


def free_motion(
    free: tuple[Path, ...],
    robot: Path,
    model: Path,
    rate: float,
    columns: str | None,
    gains: tuple[float, ...],
    payload: tuple[str, ...],
    sensitivity: bool,
) -> None:
    """Train on collision-free logs."""
    from tauguard.cli.real_logs import doubts, loaded, read_logs, robot_numbers, start
    from tauguard.detectors.calibration.arm_file import load_arm
    from tauguard.detectors.calibration.assessment import left_out
    from tauguard.detectors.methods.free_motion import FreeMotionDetector, FreeMotionSettings
    from tauguard.detectors.methods.free_motion_file import save_free_motion

    numbers = robot_numbers(robot)
    traces = read_logs(free, columns, numbers)
    recordings = loaded(traces, payload)
    arm = load_arm(robot)
    if arm is None or gains:
        arm, _ = start(numbers, recordings, columns, gains, "gains")
    settings = FreeMotionSettings(false_alarms_per_hour=rate)
    detector = FreeMotionDetector(settings).fit(recordings, arm)
    held = left_out(arm, recordings)
    unseen = never_moved(list(traces.values()))
    for note in (*doubts(detector.arm, traces, recordings, held), *unseen):
        print(f"note: {note}")
    save_free_motion(detector, model)
    report(detector, model, len(traces))
    if sensitivity:
        blows(detector, list(traces.values()))


def never_moved(traces: list[Trace]) -> list[str]:
    """A note on each joint that all logs show standing still only."""
    from tauguard.detectors.methods.free_motion import resting

    still = [resting(t.q, t.qd, t.dt).all(axis=0) for t in traces]
    return [
        f"{name} moves in none of the logs: its friction is not known, and moving it may raise an "
        "alarm; add a log in which it moves"
        for name, rests in zip(traces[0].joint_names, zip(*still, strict=True), strict=True)
        if all(rests)
    ]


def report(detector: FreeMotionDetector, model: Path, logs: int) -> None:
    """What was learned."""
    assert detector.resting is not None
    assert detector.moving is not None
    print(
        f"{model}: trained on {logs} collision-free logs, {detector.seconds:.0f} s; "
        f"{sum(detector.left_out)} alarms in them, each under a calibration from the others"
    )
    names = detector.arm.robot.joint_names
    pairs = zip(names, detector.moving.weights, detector.resting.weights, strict=True)
    for name, moving, rest in pairs:
        print(f"  {name}: its residual may be {moving[0]:.1f} N m in motion, {rest[0]:.1f} at rest")
    print(
        "  more with speed and acceleration, less where several joints have some at once; a "
        "contact has to add more than is free: --sensitivity"
    )


def blows(detector: FreeMotionDetector, traces: list[Trace]) -> None:
    """The smallest semi-real blow on each joint that is found in 95 % of trials."""
    import numpy as np

    from tauguard.detectors.evaluation.semi_real import moments, smallest_found

    quiet = [t for t in traces if not detector.detect(t).alarms]
    for joint, name in enumerate(detector.arm.robot.joint_names):
        found: list[float] = []
        for k, trace in enumerate(quiet):
            starts = moments(~detector.rests(trace)[:, joint], trace.t, 4, k)
            gain = detector.arm.drive_gain
            found += list(
                smallest_found(lambda t: detector.detect(t).alarm, trace, gain, joint, starts)
            )
        if found:
            peak = float(np.quantile(found, 0.95, method="higher"))
            if not np.isfinite(peak):
                print(
                    f"  {name}: WARNING: no blow tried is found in 95 % of {len(found)} trials; "
                    "was a load not told (--payload)?"
                )
                continue
            print(
                f"  {name}: a semi-real blow of 0.1 s in motion is found from {peak:.1f} N m on "
                f"(95 % of {len(found)} trials)"
            )
