"""``tauguard listen``: a detector beside a running robot, read-only."""

from __future__ import annotations

import sys
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tauguard.datasets.live import LiveSource, Sample
    from tauguard.datasets.live.listening import Heard
    from tauguard.detectors import CollisionAlarm
    from tauguard.detectors.faults.monitor import Answer

DISCLAIMER = "tauguard listens only: it stops nothing and certifies nothing"


def command(
    model: Path,
    robot: Path,
    ur: str | None = None,
    port: int = 30004,
    play: Path | None = None,
    columns: str | None = None,
    stdin: bool = False,
    seconds: float = float("inf"),
    reconnect: float = 10.0,
    json: Path | None = None,
    record: Path | None = None,
) -> None:
    """Watch a robot as it runs: free, collision or fault, live. Nothing is sent to the robot.

    One of --ur, --play and --stdin names where the samples come from. It ends after --seconds, with
    Ctrl-C, or when the robot has been gone for --reconnect seconds.

    Args:
        model: a detector that `tauguard train` wrote, for this arm and this rate.
        robot: URDF or MJCF file of the arm alone.
        ur: host of a Universal Robots controller, read by RTDE.
        port: of RTDE.
        play: a log (CSV or MCAP) to play at its own pace instead.
        columns: of a CSV file, see `tauguard detect`.
        stdin: read lines "t, q1.., qd1.., current1.." from the standard input.
        seconds: how long.
        reconnect: seconds to go on trying when the connection breaks.
        json: write events and latencies here.
        record: write what was heard as MCAP here.
    """
    from tauguard.cli.real_logs import check_robot
    from tauguard.datasets.live.listening import listen
    from tauguard.detectors import load_model
    from tauguard.detectors.faults.monitor import Monitor

    if sum((ur is not None, play is not None, stdin)) != 1:
        raise ValueError("give one of --ur HOST, --play LOG and --stdin")
    for name, path in (("--json", json), ("--record", record)):
        if path is not None and not path.absolute().parent.is_dir():
            raise ValueError(f"{name} {path}: the folder {path.parent} does not exist")
    alarm = load_model(model)
    if alarm.inputs is None:
        raise ValueError(f"{model}: does not say what samples look like; train the detector anew")
    check_robot(robot, alarm.detector.arm.robot.joint_names, model)
    with ExitStack() as stack:
        source = stack.enter_context(opened(ur, port, play, columns, stdin, reconnect, alarm))
        check_source(source, alarm, model)
        print(DISCLAIMER, flush=True)
        display = stack.enter_context(Display())
        monitor = Monitor(alarm, alarm.inputs)
        heard = listen(source, monitor, seconds, display.show, keep=record is not None)
        events = list(source.events)
    result = summary(heard, events, alarm)
    report(result)
    if json is not None:
        from tauguard.report import write_json

        write_json(json, result)
    if record is not None:
        save(record, heard, alarm)


def check_source(source: LiveSource, alarm: CollisionAlarm, model: Path) -> None:
    """Refuse another number of joints or another rate than training's: ``ValueError``."""
    from tauguard.detectors.detector import same_rate

    joints, dt = alarm.detector.arm.robot.joints, alarm.detector.dt
    if len(source.joint_names) != joints:
        raise ValueError(f"the source has {len(source.joint_names)} joints, {model} {joints}")
    if not same_rate(1 / source.rate, dt):
        raise ValueError(
            f"the source gives {source.rate:.0f} samples a second, {model} was trained at "
            f"{1 / dt:.0f}: train a detector on logs of that rate"
        )


def opened(
    ur: str | None,
    port: int,
    play: Path | None,
    columns: str | None,
    stdin: bool,
    reconnect: float,
    alarm: CollisionAlarm,
) -> Any:
    """The source that was asked for, connected."""
    from tauguard.datasets.live import LineSource, PlayedSource, UrSource
    from tauguard.datasets.logs import read_log

    names, dt = alarm.detector.arm.robot.joint_names, alarm.detector.dt
    if ur is not None:
        return UrSource(ur, port, 1 / dt, reconnect)
    if play is not None:
        return PlayedSource(read_log(play, columns, names).trace)
    assert stdin
    return LineSource(sys.stdin, names, 1 / dt)


class Display:
    """The state in the terminal: a line where it changes, and the score where it is a terminal.

    Writing never holds up the detector: what a slow terminal cannot take is left out.
    """

    def __init__(self, every: float = 0.1) -> None:
        """Show the score every so many seconds."""
        self._every, self._next, self._state = every, 0.0, ""
        self._live = sys.stdout.isatty()

    def __enter__(self) -> Display:
        """Ready."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the line."""
        if self._live:
            print()

    def show(self, sample: Sample, answer: Answer) -> None:
        """One answer."""
        now = time.monotonic()
        if answer.state != self._state:
            self._state = answer.state
            why = f": {answer.reason}" if answer.reason else ""
            print(f"\r{sample.t:10.3f} s  {answer.state}{why}".ljust(79), flush=True)
        elif self._live and now >= self._next:
            self._next = now + self._every
            print(f"\r{sample.t:10.3f} s  {answer.state}  score {answer.score:.2f} ", end="")
            sys.stdout.flush()


def summary(heard: Heard, events: list[str], alarm: CollisionAlarm) -> dict[str, Any]:
    """The figures of a run, ready for JSON; events as `tauguard detect` writes them."""
    collisions = heard.spans.of("collision")
    faults = heard.spans.of("fault")
    return {
        "name": "listen",
        "joints": list(heard.joint_names),
        "detector": alarm.detector.name,
        "score_threshold": alarm.threshold,
        "samples": heard.samples,
        "seconds": heard.last - heard.first if heard.samples else 0.0,
        "alarms": len(collisions),
        "events": [{"start": s.start, "end": s.end} for s in collisions],
        "faults": [{"start": s.start, "end": s.end, "reason": s.reason} for s in faults],
        "connection": events,
        "ended": heard.ended,
        "latency_us": heard.quantiles(),
    }


def report(result: dict[str, Any]) -> None:
    """The figures for a reader."""
    for event in result["events"]:
        print(f"collision {event['start']:.3f} s to {event['end']:.3f} s")
    for fault in result["faults"]:
        print(f"fault {fault['start']:.3f} s to {fault['end']:.3f} s: {fault['reason']}")
    for line in result["connection"]:
        print(f"connection: {line}")
    latency = result["latency_us"]
    if latency:
        print(
            f"{result['samples']} samples in {result['seconds']:.1f} s, {result['ended']}; packet "
            f"to answer: median {latency['median']:.0f} us, p99 {latency['p99']:.0f}, "
            f"p99.9 {latency['p99_9']:.0f}, p99.99 {latency['p99_99']:.0f}, "
            f"longest {latency['max']:.0f}"
        )
    else:
        print(f"no sample came: {result['ended']}")


def save(path: Path, heard: Heard, alarm: CollisionAlarm) -> None:
    """What was heard, with alarms, as MCAP."""
    import numpy as np

    from tauguard.detectors import find_alarms
    from tauguard.traces import Detection, write_mcap

    if len(heard.rows) < 2:
        raise ValueError(f"--record {path}: fewer than 2 samples were heard; nothing is written")
    trace, up = heard.trace(), np.array(heard.alarms)
    detection = Detection(
        detector=alarm.detector.name,
        t=trace.t,
        residual=np.zeros_like(trace.q),
        score=np.array(heard.scores),
        threshold=alarm.threshold,
        alarm=up,
        alarms=find_alarms(trace.t, up),
    )
    write_mcap(path, trace, detection)
    print(f"{path}: {len(heard.rows)} samples")
