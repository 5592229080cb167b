"""``tauguard listen``: run a detector on a running robot, read-only."""

from __future__ import annotations

import sys
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tauguard.findings import ArgumentError, as_flags

if TYPE_CHECKING:
    from collections.abc import Callable

    from tauguard.detectors import CollisionAlarm
    from tauguard.detectors.alarms.monitor import Answer
    from tauguard.live import RobotStream, Sample
    from tauguard.live.session import Session

#: Frame rate in rerun [Hz].
FRAMES = 30
DISCLAIMER = "tauguard listens only: it stops nothing and certifies nothing"


def command(
    model: Path,
    robot: Path,
    ur: str | None = None,
    port: int = 30004,
    play: Path | None = None,
    columns: str | None = None,
    stdin: bool = False,
    ros: str | None = None,
    payload: str | None = None,
    torque: bool = False,
    seconds: float = float("inf"),
    reconnect: float = 10.0,
    json: Path | None = None,
    record: Path | None = None,
    rerun: str | None = None,
) -> None:
    """Detect collisions of a running robot: free, collision or fault. Nothing is sent to the robot.

    One of --ur, --play, --stdin and --ros names the source of the samples. The command ends with
    Ctrl-C, after --seconds, or if the robot is disconnected for --reconnect seconds (exit code 3).
    After 20 ms without a sample (or 2.5 sample intervals, if longer) the state is `fault: no
    samples`.

    Args:
        model: a model file of `tauguard train` for this arm and sample rate.
        robot: URDF or MJCF file of the arm alone, or a name that `tauguard robot` lists.
        ur: host of a Universal Robots controller, read by RTDE.
        port: port of RTDE.
        play: a log (CSV or MCAP) to play in real time instead.
        columns: columns of a CSV file, see `tauguard detect`.
        stdin: read lines "t, q1.., qd1.., current1.." from the standard input.
        ros: topic with sensor_msgs/JointState, currents (or torques) in effort; needs ROS 2.
        payload: load that the arm carries, as KG or KG,X,Y,Z, see `tauguard detect`.
        torque: the source gives joint torques [N m] instead of currents.
        seconds: duration (default: without end).
        reconnect: time for attempts to reconnect after a broken connection [s].
        json: write events and latencies here.
        record: write the received samples as MCAP here.
        rerun: `view` opens the rerun viewer; FILE.rrd records the same display in a file.
    """
    import tauguard as tg
    from tauguard.cli import expect
    from tauguard.cli.payload import load
    from tauguard.live.display import BackgroundDisplay
    from tauguard.live.session import listen

    sources = (ur is not None, play is not None, stdin, ros is not None)
    if sum(sources) != 1:
        raise ArgumentError("give one of --ur HOST, --play LOG, --stdin and --ros TOPIC")
    if ur is not None and torque:
        raise ArgumentError(
            "--torque cannot be combined with --ur, whose controller sends currents"
        )
    shown = None if rerun in (None, "view") else Path(str(rerun))
    if shown is not None and shown.suffix != ".rrd":
        raise ArgumentError(f"--rerun {rerun}: expected `view`, or a file that ends with .rrd")
    for name, path in (("--json", json), ("--record", record), ("--rerun", shown)):
        if path is not None and not path.absolute().parent.is_dir():
            raise ArgumentError(f"{name} {path}: the folder {path.parent} does not exist")
    expect("--seconds", seconds, 0)
    expect("--reconnect", reconnect, 0)
    expect("--port", port, 1, 65535)
    carried = None if payload is None else load(payload)
    detector = tg.load_detector(model, robot)
    if torque and not (detector.arm.drive_gain == 1).all():
        raise ArgumentError(f"--torque: {model} was trained on currents")
    detector = detector if carried is None else detector.carrying(carried)
    alarm, monitor = detector.alarm, detector.stream()
    robot = detector.robot or robot
    with ExitStack() as stack:
        print(DISCLAIMER, flush=True)
        source = stack.enter_context(opened(ur, port, play, columns, stdin, ros, reconnect, alarm))
        check_source(source, alarm, model)
        views = [stack.enter_context(BackgroundDisplay(Terminal(alarm.threshold).show))]
        if rerun is not None:
            views.append(stack.enter_context(BackgroundDisplay(charts(robot, shown, alarm))))

        def show(sample: Sample, answer: Answer) -> None:
            for view in views:
                view.put(sample, answer)

        session = listen(source, monitor, seconds, show, keep=record is not None)
        events = list(source.events)
    result = summary(session, events, alarm)
    report(result)
    if record is not None:
        save(record, session, alarm)
    if json is not None:
        from tauguard.report import write_json

        write_json(json, result)
    if session.lost:
        raise SystemExit(3)


def check_source(source: RobotStream, alarm: CollisionAlarm, model: Path) -> None:
    """Raise ``ArgumentError`` if joints or sample rate differ from those of training."""
    from tauguard.detectors.samples import same_rate

    joints, dt = alarm.detector.arm.robot.joints, alarm.detector.dt
    if len(source.joint_names) != joints:
        raise ArgumentError(
            f"the source has {len(source.joint_names)} joints, {model} has {joints}"
        )
    if not same_rate(1 / source.rate, dt):
        raise ArgumentError(
            f"the source gives {source.rate:.0f} samples a second, {model} was trained at "
            f"{1 / dt:.0f}: train a detector on logs of that rate"
        )


def opened(
    ur: str | None,
    port: int,
    play: Path | None,
    columns: str | None,
    stdin: bool,
    ros: str | None,
    reconnect: float,
    alarm: CollisionAlarm,
) -> Any:
    """The connected source that the flags name."""
    from tauguard.live import LineStream, PlayedStream, UrStream

    names, dt = alarm.detector.arm.robot.joint_names, alarm.detector.dt
    if ur is not None:
        return UrStream(ur, port, 1 / dt, reconnect)
    if play is not None:
        from tauguard.datasets.columns import column_map
        from tauguard.datasets.log_table import Options
        from tauguard.datasets.logs import read_source
        from tauguard.detectors.calibration.joints import matched

        options = Options(column_map(columns), names, robot_joints=names)
        log = read_source(play, play.name, options)
        for note in log.findings:
            print(f"note: {play.name}: {as_flags(note.text)}")
        return PlayedStream(matched(log.trace, names))
    if ros is not None:
        from tauguard.live.ros import RosStream

        return RosStream(ros, names, 1 / dt)
    assert stdin
    return LineStream(sys.stdin, names, 1 / dt)


class Terminal:
    """Prints a line when the state changes and, on a terminal, the current score."""

    def __init__(self, threshold: float = 1.0, every: float = 0.1) -> None:
        """Keep the threshold of the score and the interval of its display [s]."""
        self._threshold, self._every, self._next = threshold, every, 0.0
        self._state, self._said = "", set[str]()
        self._live = sys.stdout.isatty()

    def show(self, sample: Sample, answer: Answer) -> None:
        """Print a line if the state changes or a new kind of reason occurs."""
        now = time.monotonic()
        kind = answer.reason.removeprefix("settling again after ").partition(":")[0]
        changed = answer.state != self._state
        if changed or (kind and kind not in self._said):
            self._said = {kind} if changed else self._said | {kind}
            self._state = answer.state
            why = why_text(answer, self._threshold)
            print(f"\r{_at(sample.t)}  {answer.state}{why}".ljust(79), flush=True)
        elif self._live and now >= self._next:
            self._next = now + self._every
            print(f"\r{_at(sample.t)}  {answer.state}  score {answer.score:.2f} ", end="")
            sys.stdout.flush()


def _at(t: float) -> str:
    """The robot's time as text, if it is known."""
    return f"{t:10.3f} s" if t == t else f"{'-':>10}  "


def why_text(answer: Answer, threshold: float) -> str:
    """The reason for a fault or a collision; empty for a free sample."""
    above = f"score {answer.score:.2f} above {threshold:.2f}"
    held = "the alarm was on already"
    parts = [above if answer.score > threshold else held] if answer.alarm else []
    parts += [answer.reason] if answer.reason else []
    return f": {'; '.join(parts)}" if parts else ""


def charts(
    robot: Path, save: Path | None, alarm: CollisionAlarm
) -> Callable[[Sample, Answer], None]:
    """A function that shows arm, score and state in rerun's viewer, or records them in a file."""
    import mujoco
    import numpy as np

    from tauguard.replay.live import LiveView
    from tauguard.replay.robot import load_model as load_robot

    names = alarm.detector.arm.robot.joint_names
    model = load_robot(robot)
    view, data = LiveView(model, save), mujoco.MjData(model)
    rows = [model.jnt_qposadr[model.joint(name).id] for name in names]
    view.layout({"score": "Score (1: threshold)", "state": "0 free, 1 collision, 2 fault"})
    states, due = {"free": 0, "collision": 1, "fault": 2}, [-np.inf, 0.0]

    def show(sample: Sample, answer: Answer) -> None:
        soon = due[0] <= sample.t < due[0] + 1 / FRAMES
        if soon or not np.isfinite(sample.t):
            return
        due[0] = sample.t
        if np.isfinite(sample.q).all():  # during silence the arm keeps its pose
            data.qpos[rows] = sample.q
            mujoco.mj_kinematics(model, data)
        view.show(data, sample.t, [])
        view.chart("score", ["score"], [answer.score / max(alarm.threshold, 1e-9)])
        view.chart("state", ["state"], [states[answer.state]])

    return show


def summary(session: Session, events: list[str], alarm: CollisionAlarm) -> dict[str, Any]:
    """The results of a run, as JSON values."""
    collisions = session.spans.of("collision")
    return {
        "name": "listen",
        "joints": list(session.joint_names),
        "detector": alarm.detector.name,
        "score_threshold": alarm.threshold,
        "samples": session.samples,
        "seconds": session.last - session.first if session.first == session.first else 0.0,
        "alarms": len(collisions),
        "events": [{"start": s.start, "end": s.end, "score": s.score} for s in collisions],
        "faults": [{"start": s.start, "end": s.end, "reason": s.reason} for s in session.faults()],
        "state": session.state,
        "connection": events,
        "ended": session.ended,
        "latency_us": session.quantiles(),
    }


def report(result: dict[str, Any]) -> None:
    """Print the results as text."""
    for event in result["events"]:
        line = (
            f"collision {event['start']:.3f} s to {event['end']:.3f} s: score {event['score']:.2f}"
        )
        print(f"{line} above {result['score_threshold']:.2f}")
    for fault in result["faults"]:
        print(f"fault {fault['start']:.3f} s to {fault['end']:.3f} s: {fault['reason']}")
    for line in result["connection"]:
        print(f"connection: {line}")
    latency = result["latency_us"]
    if latency:
        print(
            f"{result['samples']} samples in {result['seconds']:.1f} s, {result['ended']}; packet "
            f"to answer: median {_us(latency['median'])} us, p99 {_us(latency['p99'])}, "
            f"p99.9 {_us(latency['p99_9'])}, p99.99 {_us(latency['p99_99'])}, "
            f"longest {_us(latency['max'])}"
        )
    else:
        print(f"no sample was received: {result['ended']}")
    print(f"state at the end: {result['state']}")


def _us(value: float | None) -> str:
    """Microseconds as text; None: above the range of the histogram."""
    return "100,000 or more" if value is None else f"{value:,.0f}"


def save(path: Path, session: Session, alarm: CollisionAlarm) -> None:
    """Write the recorded samples and their alarms as MCAP."""
    import numpy as np

    from tauguard.detectors import find_alarms
    from tauguard.traces import Detection, write_mcap

    if len(session.rows) < 2:
        raise ArgumentError(
            f"--record {path}: fewer than 2 samples were received; nothing is written"
        )
    trace, up = session.trace(), np.array(session.alarms)
    detection = Detection(
        detector=alarm.detector.name,
        t=trace.t,
        residual=np.zeros_like(trace.q),
        score=np.array(session.scores),
        threshold=alarm.threshold,
        alarm=up,
        alarms=find_alarms(trace.t, up),
    )
    write_mcap(path, trace, detection)
    print(f"{path}: {len(session.rows)} samples")
