"""Train a detector on the logs of a real arm, or on recordings of a simulated one."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from tauguard.detectors.alarms import training
from tauguard.detectors.alarms.alarm import CollisionAlarm
from tauguard.detectors.alarms.beside_free_motion import BesideFreeMotion
from tauguard.detectors.arm_calibration import (
    Calibration,
    accepted_words,
    column_findings,
    explained,
)
from tauguard.detectors.calibration.checks import gravity_finding, sign_findings, unit_finding
from tauguard.detectors.calibration.column_order import order_findings
from tauguard.detectors.calibration.initial_arm import known_arm
from tauguard.detectors.calibration.joints import is_torque, linear_axes, matched, of_log
from tauguard.detectors.calibration.nominal import nominal_arm
from tauguard.detectors.calibration.recording import Recording
from tauguard.detectors.detection import LogDetection
from tauguard.detectors.detector import Detector, detected
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.evaluation.acceptance import (
    alarm_finding,
    bound_finding,
    odd_log_findings,
)
from tauguard.detectors.evaluation.cross_validation import cross_validate
from tauguard.detectors.faults.inputs import UsualInput
from tauguard.detectors.features.motion_regimes import unseen_motion
from tauguard.detectors.registry import make_detector
from tauguard.detectors.samples import same_rate
from tauguard.detectors.scores.free_motion import CONFIRMATION, FreeMotion
from tauguard.detectors.scores.method import Method
from tauguard.detectors.thresholds.guarantee import check_guarantee
from tauguard.findings import (
    ArgumentError,
    Finding,
    Findings,
    MismatchError,
    RefusedError,
    TauguardError,
    cause,
    note,
    preceded_by,
    raise_errors,
)
from tauguard.traces.loads import Load, LoadLike, load_of, log_named
from tauguard.traces.logs import Log, Logs

#: Words of ``accept=`` that name checks; all others name logs.
ACCEPTABLE = ("alarms", "error", "gravity", "order")


def train(
    logs: Logs | Log,
    arm: Calibration | ArmModel | None = None,
    method: str | Method = "free-motion",
    *,
    gains: Sequence[float] = (),
    false_alarms_per_hour: float = 10.0,
    folds: int = training.FOLDS,
    accept: str | Collection[str] = (),
    validate: bool = True,
    calibration: Logs | None = None,
    confidence: float = 0.95,
    contacts: Logs | None = None,
) -> Detector:
    """Train a method and set its threshold.

    The method free-motion learns bounds of the residual from logs in which nothing touched the arm.
    All other methods learn from recordings with truth, some of them with collisions; their
    threshold comes from the collision-free ones, each scored by a detector that was trained without
    it. With ``contacts``, such a method learns from these and from free logs of the real arm, and
    runs together with free-motion.

    Args:
        logs: of :func:`tauguard.read_logs` or :func:`tauguard.simulated`.
        arm: of :func:`tauguard.calibrate` (default: that of a calibrated robot file, of the file
            with ``gains`` or those of the preset, or the arm attached to recordings).
        method: a name in ``tauguard.detectors.DETECTORS``, ``"module:Class"`` or an object of your
            own, see :class:`~tauguard.detectors.Method`.
        gains: drive gains [N m/A], one per joint.
        false_alarms_per_hour: accepted rate on motion like that of the logs [1/h]. The method
            free-motion refuses the logs if cross-validation shows a higher rate.
        folds: of the cross-validation that sets the threshold; each needs one more training.
        accept: free-motion: findings that become warnings (``"order"``, ``"gravity"``,
            ``"alarms"``, ``"error"``), and names of logs to keep although they stand out.
        validate: free-motion: judge each log with calibration and bounds from the others.
        calibration: collision-free recordings, not in ``logs``, with which the threshold guarantees
            the rate of false alarms.
        confidence: of this guarantee, between 0 and 1.
        contacts: simulated contacts of a twin of the real arm.

    Raises:
        RefusedError: the logs do not fit, or are too short; ``error.findings`` has all causes.
        ArgumentError: arguments that do not go together, or are out of range.
        MismatchError: logs of different arms or sample rates, or no arm.
    """
    if isinstance(logs, Log):
        logs = one_log(logs)
    settings = make_detector(method) if isinstance(method, str) else method
    words, gains = accepted_words(accept), tuple(gains)
    if arm is not None and gains:
        raise ArgumentError("`gains=`: the arm has gains; give one of the two")
    per_hour = false_alarms_per_hour
    with preceded_by(logs.findings):
        if isinstance(settings, FreeMotion):
            if calibration is not None or contacts is not None:
                raise ArgumentError("free-motion takes neither `calibration=` nor `contacts=`")
            detector = _train_free(settings, logs, arm, gains, per_hour, words, validate)
        elif words or gains:
            raise ArgumentError(f"{settings.name} takes neither `accept=` nor `gains=`")
        elif contacts is not None:
            detector = _train_beside(settings, logs, _model(arm), contacts, per_hour)
        else:
            believed = _model(arm) or nominal_arm(logs.traces)
            guarantee = None if calibration is None else (calibration, confidence)
            detector = _train_labelled(settings, logs, believed, per_hour, folds, guarantee)
    return replace(detector, findings=Findings((*logs.findings, *detector.findings)))


def _train_labelled(
    settings: Method,
    logs: Logs,
    arm: ArmModel,
    per_hour: float,
    folds: int,
    asked: tuple[Logs, float] | None,
) -> Detector:
    """A method trained on recordings with truth; ``asked``: calibration logs and confidence."""
    free = [] if asked is None else asked[0].traces
    if asked is not None:
        check_guarantee([float(t.t[-1] - t.t[0]) for t in free], per_hour, asked[1])
        folds = 1  # the calibration replaces the threshold
    alarm, scores = training.train_and_score(settings, logs.traces, arm, per_hour, folds)
    guarantee = None
    if asked is not None:
        alarm, guarantee = training.with_guarantee(alarm, free, per_hour, asked[1])
    return Detector(
        alarm,
        logs.robot,
        logs=logs,
        scores=tuple(scores),
        guarantee=guarantee,
        false_alarms_per_hour=per_hour,
    )


def _model(arm: Calibration | ArmModel | None) -> ArmModel | None:
    return arm.arm if isinstance(arm, Calibration) else arm


def _believed(
    logs: Logs, arm: Calibration | ArmModel | None, gains: tuple[float, ...]
) -> tuple[ArmModel, str]:
    """The arm before a training on free logs, and the source of its gains, as text."""
    if arm is not None:
        model = _model(arm)
        assert model is not None
        if model.robot.joint_names != logs.joint_names:
            text = (
                f"the arm's joints are {', '.join(model.robot.joint_names)}, the logs' "
                f"{', '.join(logs.joint_names)}"
            )
            raise MismatchError(cause("joints", text))
        if is_torque(logs.traces[0]) and not (model.drive_gain == 1).all():
            text = "the arm was calibrated on currents, the logs hold torques"
            raise MismatchError(cause("torques", text))
        return model, "those of the calibration"
    if logs.robot is None or logs.numbers is None:
        return nominal_arm(logs.traces), "those of the attached arm"
    return known_arm(logs.robot, logs.numbers, list(logs.values()), gains)


def _train_free(
    settings: FreeMotion,
    logs: Logs,
    arm: Calibration | ArmModel | None,
    gains: tuple[float, ...],
    per_hour: float,
    words: frozenset[str],
    validate: bool,
) -> Detector:
    struck = [n for n, log in logs.items() if log.trace.truth and log.trace.truth.collisions]
    logs = logs.only(logs.keys() - set(struck)) if struck else logs
    believed, source = _believed(logs, arm, gains)
    findings = list[Finding]()
    if not validate:
        findings.append(note("gains", f"gains: {source}"))
    own: Mapping[str, Recording] = logs
    columns = [*_unit(believed, own), *sign_findings(believed, own)]
    if columns:
        columns = [*_unit(believed, own), *column_findings(believed, own)]
        findings = list(raise_errors(RefusedError, [*findings, *columns], words))
    validation = None
    if validate:
        names = sorted(words - set(ACCEPTABLE))
        kept = [log_named(name, f'`accept="{name}"`', list(own)) for name in names]
        validation = cross_validate(own, believed, kept)
        findings += odd_log_findings(validation)
        left_out = {log.name for log in validation.left_out}
        logs = logs.only(logs.keys() - left_out) if left_out else logs
        own = logs
    recordings, traces = list(own.values()), logs.traces
    findings += order_findings(believed, own)
    findings = list(raise_errors(RefusedError, findings, words))
    fitted = settings.fit(recordings, believed)
    doubts = [gravity_finding(believed.robot, fitted.arm.robot, traces)]
    doubts += explained(fitted.arm, own, (), words)
    if validation is not None:
        doubts += unseen_motion(traces)
        judged = [log for log in validation.kept if log not in validation.accepted]
        doubts += [bound_finding(judged), alarm_finding(judged, per_hour)]
    findings += [doubt for doubt in doubts if doubt is not None]
    judged_findings = raise_errors(RefusedError, findings, words)
    alarm = training.free_alarm(fitted, traces)
    return Detector(
        alarm,
        logs.robot,
        judged_findings,
        logs,
        validation,
        false_alarms_per_hour=per_hour,
    )


def _unit(arm: ArmModel, logs: Mapping[str, Recording]) -> list[Finding]:
    traces = [log.trace for log in logs.values()]
    finding = None if is_torque(traces[0]) else unit_finding(arm, traces)
    return [] if finding is None else [finding]


def _train_beside(
    settings: Method, logs: Logs, arm: ArmModel | None, contacts: Logs, per_hour: float
) -> Detector:
    """A learned score from simulated contacts, beside free-motion from the real arm's logs."""
    if arm is None:
        raise ArgumentError("`contacts=` needs `arm=`, the calibrated arm of the twin")
    names, traces = arm.robot.joint_names, logs.traces
    rate = 1 / contacts.traces[0].dt
    for name, log in logs.items():
        if not same_rate(log.trace.dt, 1 / rate):
            text = (
                f"{name}: {1 / log.trace.dt:.4g} samples a second, the contacts have {rate:.4g}; "
                f"expected logs of that rate, or `resample={rate:.4g}`"
            )
            raise MismatchError(cause("rate", text, name))
    struck = [replace(trace, joint_names=names) for trace in contacts.traces]
    plain = {name: log.trace for name, log in logs.items()}
    learned, scores, notes = training.train_beside(settings, struck, plain, arm, per_hour)
    quiet = FreeMotion().fit(traces, arm)
    usual = UsualInput.of(traces, quiet.arm)
    alarm = CollisionAlarm(BesideFreeMotion(quiet, learned), 1.0, CONFIRMATION, inputs=usual)
    return Detector(
        alarm,
        logs.robot,
        notes,
        logs,
        scores=tuple(scores),
        false_alarms_per_hour=per_hour,
        contacts=sum(len(trace.truth.collisions) for trace in struck if trace.truth),
    )


def one_log(log: Log) -> Logs:
    """A log with its joints in the robot's order, as logs.

    Raises:
        MismatchError: joints that the robot does not have.
        LogError: a linear axis that was read in degrees.
    """
    if log.robot is None or log.numbers is None:
        return Logs({log.name: log})
    numbers, lacking = of_log(log.numbers, log.trace.joint_names, log.robot)
    axes = linear_axes(numbers, {log.name: log})
    log = replace(log, trace=matched(log.trace, numbers.joint_names), numbers=numbers)
    return Logs({log.name: log}, log.robot, numbers, Findings((*lacking, *axes)))


def detect_after_quiet(
    log: Log,
    *,
    quiet: float = 20.0,
    gains: Sequence[float] = (),
    payload: LoadLike = None,
    at_tool: bool = False,
) -> LogDetection:
    """Train free-motion on the beginning of a log, in which nothing touches the arm, and detect.

    A detector from whole logs (:func:`train`) is better.

    Args:
        log: of :func:`tauguard.read_log`, with a robot file.
        quiet: length of the beginning [s]. A contact in this time raises the thresholds, so that
            later collisions may be missed.
        gains: drive gains [N m/A], one per joint (not needed for calibrated robot files and for
            presets with known gains).
        payload: as for :meth:`Detector.detect`.
        at_tool: as for :meth:`Detector.detect`.

    Raises:
        RefusedError: a label marks a contact in this time, or as :func:`train`.
        ArgumentError: ``quiet`` is not within the log, or no robot.
    """
    begin = float(log.trace.t[0])
    length = float(log.trace.t[-1]) - begin
    early = [start - begin for start, _ in log.labels or () if start < begin + quiet]
    if early:
        text = (
            f"{log.source}: a column labels a contact {early[0]:.2f} s after the beginning, within "
            f"the first {quiet:g} s (`quiet=`), on which the detector is trained; give a shorter "
            "`quiet=`, or a `model=`"
        )
        raise RefusedError(*log.findings, cause("labelled-contact", text, log.name))
    if not 0 < quiet < length:
        text = (
            f"`quiet={quiet:g}`: expected above 0 and below the log's {length:.1f} s; or train a "
            "detector on logs of free motion and give `model=`"
        )
        raise ArgumentError(*log.findings, cause("argument", text))
    load = load_of(payload) or Load()
    joints = one_log(log)
    log = joints[log.name]
    beginning = replace(joints, logs={log.name: replace(log.until(quiet), load=load)})
    before = (*log.findings, *joints.findings)
    beginning = replace(beginning, findings=Findings())
    try:
        detector = train(beginning, gains=gains, validate=False)
    except TauguardError as error:
        raise type(error)(*before, *_of_beginning(error, log, quiet)) from None
    source = detector.findings.of("gains")[0].text
    trained = note("gains", f"trained on the first {quiet:g} s; {source}")
    alarm = (detector if payload is None else detector.carrying(load)).alarm
    alarm = replace(alarm, detector=replace(alarm.detector, settle=quiet))  # type: ignore[type-var]
    checks = (*before, *detector.findings.without("gains"), trained)
    found = detected(alarm, log, log.trace, checks, log.robot, at_tool, payload is not None)
    return found


def _of_beginning(error: TauguardError, log: Log, quiet: float) -> list[Finding]:
    """The findings of a failed training on the beginning of a log, which has no ``accept=``."""
    findings = list[Finding](error.findings.without("gains"))
    for k, finding in enumerate(findings):
        if finding.severity == "error":
            text = f"{log.source}, its first {quiet:g} s (`quiet=`): {finding.text}"
            findings[k] = replace(finding, text=text, accept="")
    last = findings[-1]
    doubt = "or did something touch the arm in this time? If not, train a detector on whole logs"
    findings[-1] = replace(last, text=f"{last.text}; {doubt}")
    return findings
