"""``tauguard listen``: run a detector on a running robot, read-only."""

from __future__ import annotations

import sys
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tauguard.findings import ArgumentError

if TYPE_CHECKING:
    from collections.abc import Callable

    from tauguard import Detector, Log
    from tauguard.live import Answer, Listening, Sample

DISCLAIMER = "tauguard listens only: it stops nothing and certifies nothing"


def command(
    model: Path,
    robot: Path | None = None,
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
        robot: URDF or MJCF file of the arm alone, or a name that `tauguard robot` lists (default:
            the robot in the model file).
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
    from tauguard.live import BackgroundDisplay

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
    detector = detector if carried is None else detector.carrying(carried)
    with ExitStack() as stack:
        print(DISCLAIMER, flush=True)
        source: Any
        if play is None:
            source = stack.enter_context(opened(ur, port, stdin, ros, reconnect, detector))
        else:
            source = read_log(play, columns, detector)
        views = [stack.enter_context(BackgroundDisplay(Terminal(detector.threshold).show))]
        if rerun is not None:
            show = charts(detector, shown)
            views.append(stack.enter_context(BackgroundDisplay(show)))

        def put(sample: Sample, answer: Answer) -> None:
            for view in views:
                view.put(sample, answer)

        keep = record is not None
        result = tg.listen(detector, source, torque=torque, seconds=seconds, report=put, keep=keep)
    print(result.text())
    if record is not None:
        save(record, result)
    if json is not None:
        from tauguard.report import write_json

        write_json(json, result.to_dict())
    if result.lost:
        raise SystemExit(3)


def opened(
    ur: str | None,
    port: int,
    stdin: bool,
    ros: str | None,
    reconnect: float,
    detector: Detector,
) -> Any:
    """The connected stream that the flags name."""
    from tauguard.live import LineStream, RosStream, UrStream

    names, rate = detector.joints, 1 / detector.dt
    if ur is not None:
        return UrStream(ur, port, rate, reconnect)
    if ros is not None:
        return RosStream(ros, names, rate)
    assert stdin
    return LineStream(sys.stdin, names, rate)


def read_log(play: Path, columns: str | None, detector: Detector) -> Log:
    """A log to play in real time; prints what was found in it."""
    import tauguard as tg
    from tauguard.cli.output import print_findings

    robot = detector.robot or detector
    log = tg.read_log(play, columns, robot=robot, joint_names=detector.joints)
    print_findings(log.findings)
    return log


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


def charts(detector: Detector, save: Path | None) -> Callable[[Sample, Answer], None]:
    """A function that shows arm, score and state in rerun's viewer, or records them in a file."""
    from tauguard.replay import StateView

    with detector.robot_file() as robot:
        if robot is None:
            raise ArgumentError("--rerun needs --robot: the model file has no robot in it")
        view = StateView(robot, detector.joints, detector.threshold, save)
    return lambda sample, answer: view.show(sample.t, sample.q, answer.state, answer.score)


def save(path: Path, result: Listening) -> None:
    """Write the recorded samples and their alarms as MCAP."""
    from tauguard.traces import write_mcap

    try:
        trace = result.trace()
    except ArgumentError as error:
        raise ArgumentError(f"--record {path}: {error}") from None
    write_mcap(path, trace, result.detection())
    print(f"{path}: {len(trace.t)} samples")
