"""``tauguard demo``: all steps from simulation to replay."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tauguard.detectors import CollisionAlarm, Matching
    from tauguard.detectors.thresholds.free_scores import FreeScores
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

    from tauguard.datasets import demo_plan, simulate_all
    from tauguard.detectors import SrqSvr, match_detection
    from tauguard.detectors.alarms.training import train_and_score
    from tauguard.detectors.calibration.nominal import nominal_arm
    from tauguard.detectors.evaluation.metrics_page import draw
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
    training = list(simulate_all(plan.train, workers, "simulate training"))
    judged = list(simulate_all([*plan.judge_struck, *plan.judge_free], workers, "simulate test"))
    simulated = time.perf_counter()
    arm = nominal_arm(training)
    detector, scores = train_and_score(SrqSvr(), training, arm, FALSE_ALARMS_PER_HOUR)
    fitted = time.perf_counter()
    detections = [detector.detect(trace) for trace in judged]
    detected = time.perf_counter()
    pairs = zip(detections, judged, strict=True)
    matchings = [match_detection(found, trace, detector.settle) for found, trace in pairs]
    summary: dict[str, Any] = {
        "seed": seed,
        "simulated_seconds": plan.seconds,
        **judged_figures(detector, judged, matchings),
        "asked": requested(detector, scores),
        "timing": {
            "simulate_s": simulated - started,
            "train_s": fitted - simulated,
            "detect_s": detected - fitted,
            "real_time_factor": plan.seconds / (simulated - started),
            "simulation_us_per_sample": simulation_timing(plan.judge_free[0]),
            **detector_timing(detector, judged, detected - fitted),
        },
    }
    write_results(out, simulate(plan.showcase), detector)
    draw(out / "summary.png", summary, matchings)
    summary["timing"]["total_s"] = time.perf_counter() - started
    for path in filter(None, (out / "summary.json", json)):
        write_json(path, summary)
    closing(out, summary)


def judged_figures(
    detector: CollisionAlarm, judged: list[Trace], matchings: list[Matching]
) -> dict[str, Any]:
    """Duration and collisions of the test motion, and the detector's metrics on it."""
    from tauguard.detectors import detection_metrics

    return {
        "judged_seconds": sum(m.free_seconds for m in matchings),
        "not_judged_seconds": detector.settle * len(judged),
        "collisions_by_kind": count(judged, lambda c: c.kind),
        "collisions_by_link": count(judged, lambda c: str(c.link)),
        "threshold": detector.threshold,
        **detection_metrics(matchings),
    }


def requested(detector: CollisionAlarm, scores: Sequence[FreeScores]) -> dict[str, float]:
    """Requested rate of false alarms, and 95 % interval of the rate on training motion [1/h]."""
    from tauguard.detectors.thresholds.expected_rate import ExpectedRate

    expected = ExpectedRate.of(scores)
    low, high = expected.interval(detector.threshold)
    return {"per_hour": FALSE_ALARMS_PER_HOUR, "low": low, "high": high, "hours": expected.hours}


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


def closing(out: Path, summary: dict[str, Any]) -> None:
    """Print the results, the files in the folder, and how to open the recording."""
    from tauguard.detectors.evaluation.metrics_page import text

    print(text(summary))
    print(false_alarm_text(summary))
    print(f"\n{out}/: demo.mcap  demo.rrd  model.tauguard  summary.json  summary.png")
    recording = out / "demo.rrd"
    run = ".uv/bin/uv run --no-dev " if Path(".uv/bin/uv").is_file() else ""  # of a checkout
    print(f"to see it in a browser: {run}tauguard replay --web {recording}")
    print(f"in rerun's own window:  {run}rerun {recording}")


def write_results(out: Path, showcase: Trace, detector: CollisionAlarm) -> None:
    """Write the recording, its replay and the detector into the folder."""
    from tauguard.detectors import diagnose, save_model
    from tauguard.replay import write_rrd
    from tauguard.traces import write_mcap

    shown = detector.detect(showcase)
    said = diagnose(detector, showcase, shown)
    write_mcap(out / "demo.mcap", showcase, shown)
    write_rrd(out / "demo.rrd", showcase, shown, explained=said)
    save_model(detector, out / "model.tauguard")


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
