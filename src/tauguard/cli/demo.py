"""``tauguard demo``: all steps from simulation to replay."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tauguard import Detector, Evaluation
    from tauguard.detectors import CollisionAlarm
    from tauguard.envs import Episode
    from tauguard.traces import Trace

#: The threshold is set for this rate of false alarms on the training motions [1/h]. An alarm stops
#: a robot: one false alarm per hour may be acceptable in practice, ten are too many.
FALSE_ALARMS_PER_HOUR = 1.0


def command(
    out: Path = Path("demo"),
    seed: int = 0,
    robot: str = "cura6",
    arm_joints: str | None = None,
    workers: int | None = None,
    json: Path | None = None,
) -> None:
    """Simulate a moving arm with collisions, train a detector on it, and record its alarms.

    The folder --out then contains demo.mcap (a run with collisions, truth and detection), demo.rrd
    (the same for rerun), model.tauguard (the trained detector), summary.json and summary.png
    (metrics of the detector on motions and collisions that it was not trained on).

    Args:
        out: folder for the results; it is created if it does not exist.
        seed: seed of the arm and of all random draws; the same seed gives the same files.
        robot: name or file of the arm; see `tauguard robot`.
        arm_joints: for a file with several chains, the arm's joints: names separated by commas, or
            FIRST..LAST.
        workers: processes for the simulation (default: all processors).
        json: additional file for the summary.
    """
    from tauguard.cli import expect

    started = time.perf_counter()
    expect("--seed", seed, 0)
    out.mkdir(parents=True, exist_ok=True)

    import tauguard as tg
    from tauguard.datasets import demo_plan, simulate_all
    from tauguard.detectors import match_detection
    from tauguard.envs import simulate
    from tauguard.models import load_arm
    from tauguard.report import write_json

    robot = robot if arm_joints is None else f"{robot}#{arm_joints}"
    load_arm(robot)  # raises an error for an unknown arm before the simulation
    plan = demo_plan(seed, robot)
    print(
        f"simulating {plan.seconds / 60:.0f} minutes of motion, then training and testing a "
        "detector: this takes one to three minutes",
        flush=True,
    )
    training = tg.simulated(simulate_all(plan.train, workers, "simulate training"))
    judged = list(simulate_all([*plan.judge_struck, *plan.judge_free], workers, "simulate test"))
    simulated = time.perf_counter()
    detector = tg.train(training, method="srq-svr", false_alarms_per_hour=FALSE_ALARMS_PER_HOUR)
    fitted = time.perf_counter()
    alarm = detector.alarm
    detections = [alarm.detect(trace) for trace in judged]
    detected = time.perf_counter()
    pairs = zip(detections, judged, strict=True)
    matchings = [match_detection(found, trace, alarm.settle) for found, trace in pairs]
    evaluation = tg.Evaluation.of([str(k) for k in range(len(judged))], matchings)
    summary: dict[str, Any] = {
        "seed": seed,
        "simulated_seconds": plan.seconds,
        "judged_seconds": sum(m.free_seconds for m in matchings),
        "not_judged_seconds": alarm.settle * len(judged),
        "collisions_by_kind": count(judged, lambda c: c.kind),
        "collisions_by_link": count(judged, lambda c: str(c.link)),
        "threshold": alarm.threshold,
        **evaluation.metrics,
        "asked": requested(detector),
        "timing": {
            "simulate_s": simulated - started,
            "train_s": fitted - simulated,
            "detect_s": detected - fitted,
            "real_time_factor": plan.seconds / (simulated - started),
            "simulation_us_per_sample": simulation_timing(plan.judge_free[0]),
            **detector_timing(alarm, judged, detected - fitted),
        },
    }
    write_results(out, simulate(plan.showcase), detector)
    evaluation.draw(out / "summary.png")
    summary["timing"]["total_s"] = time.perf_counter() - started
    for path in filter(None, (out / "summary.json", json)):
        write_json(path, summary)
    closing(out, evaluation, summary)


def requested(detector: Detector) -> dict[str, float]:
    """Requested rate of false alarms, and 95 % interval of the rate on training motion [1/h]."""
    rate = detector.to_dict()["false_alarms_per_hour"]
    hours = sum(score.seconds for score in detector.scores) / 3600
    return {"per_hour": rate["requested"], "low": rate["low"], "high": rate["high"], "hours": hours}


def false_alarm_text(summary: dict[str, Any]) -> str:
    """The requested rate of false alarms beside the measured one, as text."""
    from tauguard.report import two_digits

    wanted, found = summary["asked"], summary["false_alarms_per_hour"]
    own, other = (
        f"{two_digits(rate['low'])} to {two_digits(rate['high'])}" for rate in (wanted, found)
    )
    return (
        f"  false alarms per hour: requested {wanted['per_hour']:g}, found {found['value']:.1f}, "
        f"95 % interval {other}, from {found['n']} alarms in {60 * found['hours']:.0f} min\n"
        f"  (The threshold was set on {60 * wanted['hours']:.0f} min of training motion, so the "
        f"95 % interval of its rate is {own} per hour. The test motions are different.)"
    )


def closing(out: Path, evaluation: Evaluation, summary: dict[str, Any]) -> None:
    """Print the results, the files in the folder, and how to open the recording."""
    timing = summary["timing"]
    print(evaluation)
    print(
        f"\n  {summary['simulated_seconds']:.0f} s simulated, "
        f"{timing['real_time_factor']:.0f} times real time; "
        f"per sample: simulation {timing['simulation_us_per_sample']:.1f} us, "
        f"observer {timing['observer_us_per_sample']:.1f} us, "
        f"detector {timing['detector_us_per_sample']:.1f} us"
    )
    print(false_alarm_text(summary))
    print(f"\n{out}/: demo.mcap  demo.rrd  model.tauguard  summary.json  summary.png")
    recording = out / "demo.rrd"
    run = ".uv/bin/uv run --no-dev " if Path(".uv/bin/uv").is_file() else ""  # of a checkout
    print(f"to see it in a browser: {run}tauguard replay --web {recording}")
    print(f"in rerun's own window:  {run}rerun {recording}")


def write_results(out: Path, showcase: Trace, detector: Detector) -> None:
    """Write the recording, its replay and the detector into the folder."""
    from tauguard.detectors import diagnose
    from tauguard.replay import write_rrd
    from tauguard.traces import write_mcap

    shown = detector.alarm.detect(showcase)
    said = diagnose(detector.alarm, showcase, shown)
    write_mcap(out / "demo.mcap", showcase, shown)
    write_rrd(out / "demo.rrd", showcase, shown, explained=said)
    detector.save(out / "model.tauguard")


def count(traces: list[Trace], key: Any) -> dict[str, int]:
    """Number of test collisions of each kind (or link)."""
    found = [key(c) for trace in traces if trace.truth for c in trace.truth.collisions]
    return {name: found.count(name) for name in sorted(set(found))}


def simulation_timing(episode: Episode) -> float:
    """Microseconds per sample of one episode's simulation, planning and labels included."""
    from tauguard.envs import simulate

    started = time.perf_counter()
    run = simulate(episode)
    return 1e6 * (time.perf_counter() - started) / len(run.t)


def detector_timing(
    detector: CollisionAlarm, traces: list[Trace], seconds: float
) -> dict[str, float]:
    """Microseconds per sample of the momentum observer, and of the rest of a detection."""
    from tauguard.detectors import observe

    arm = detector.detector.arm
    robot, gain = arm.robot, arm.drive_gain
    started = time.perf_counter()
    for trace in traces:
        observe(robot, trace.t, trace.q, trace.qd, gain * trace.current)
    observer = time.perf_counter() - started
    per_sample = 1e6 / sum(len(trace.t) for trace in traces)
    return {
        "observer_us_per_sample": observer * per_sample,
        "detector_us_per_sample": (seconds - observer) * per_sample,
    }
