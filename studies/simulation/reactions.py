"""What reactions to a collision are worth: swings into the chest."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np

from tauguard.datasets import demo_plan, simulate_all
from tauguard.detectors import CollisionAlarm, make_detector, train
from tauguard.detectors.calibration.nominal import nominal_arm
from tauguard.envs.adapters.reactions import REACTIONS, Reaction
from tauguard.envs.gym.react import ReactEnv
from tauguard.models import body_region
from tauguard.report import Row, rate

#: False alarms accepted per hour of the trained detector, as in the demo.
PER_HOUR = 10.0
REACT = "tauguard:tauguard/React-v0"
#: Of the swings [m/s].
SPEEDS = (0.25, 0.5, 1.0)
#: What a swing comes to.
OUTCOMES = (
    "peak_force_N", "energy_J", "delay_s", "stopping_time_s", "stopping_distance_m", "end_m",
    "force_over_limit",
)  # fmt: skip
#: The tool counts as stopped this near to the farthest place that it comes to [m].
NEAR = 5e-4


def trained_detector(seed: int) -> CollisionAlarm:
    """The demo's: trained on its arm and motions, none of which is a swing of this study."""
    episodes = list(simulate_all(demo_plan(seed).train, None, "simulate training"))
    return train(make_detector("srq-svr"), episodes, nominal_arm(episodes), PER_HOUR)


def reactions(count: int, seed: int, known: Mapping[str, Any]) -> list[Row]:
    """Each reaction at three speeds, the collision known from the contact itself or a detector.

    ``known`` names the detectors; ``None`` stands for the contact. A swing with an alarm before the
    touch counts as a false alarm and nowhere else.
    """
    rows: list[Row] = []
    for speed in SPEEDS:
        for source, detector in known.items():
            for reaction in REACTIONS:
                runs = [swing(speed, detector, reaction, seed, seed + k) for k in range(count)]
                heard = [run for run in runs if not run["delay_s"] < 0]
                rows.append(
                    {
                        "study": "reaction",
                        "speed_m_s": speed,
                        "known_from": source,
                        "reaction": reaction,
                        "false_alarms": rate(count - len(heard), count),
                        **{key: spread([run[key] for run in heard]) for key in runs[0]},
                    }
                )
    return rows


def spread(values: list[float]) -> dict[str, float | None]:
    """Median, smallest and largest of those that are finite."""
    known = [v for v in values if np.isfinite(v)]
    if not known:
        return {"median": None, "low": None, "high": None}
    return {"median": float(np.median(known)), "low": min(known), "high": max(known)}


def swing(speed: float, detector: Any, reaction: str, arm: int, seed: int) -> dict[str, float]:
    """One swing into the chest: peak force, energy, and how long and far the tool went on.

    ``arm`` is the seed of how the arm differs from its nominal model, the same as in the training
    of a detector; ``seed`` that of the swing.
    """
    made = gymnasium.make(
        REACT,
        speed=speed,
        detector=detector,
        mismatch=arm,
        approach=False,
        max_episode_steps=10**6,
    )
    env = Reaction(made, reaction, "contact" if detector is None else "alarm")
    env.reset(seed=seed)
    inner = env.unwrapped
    assert isinstance(inner, ReactEnv)
    way = np.diff(inner.task.swing[0], axis=0) * 100 / inner.compiled.max_speed  # type: ignore[attr-defined]
    n = len(inner.compiled.scene.joint_names)
    tools, times, force, onset, begun = [], [], 0.0, -1.0, -1.0
    for step in range(len(way) + 150):
        action = way[step] if step < len(way) else np.zeros(n)
        observation, _, _, _, info = env.step(action)
        tools.append(observation[3 * n : 3 * n + 3].copy())
        times.append(info["time"])
        force, onset = max(force, info["force"]), info["onset_time"] if onset < 0 else onset
        if begun < 0 and info["reacting"]:
            begun = info["time"]
    return swing_figures(np.array(tools), np.array(times), force, onset, begun)


def swing_figures(
    tools: np.ndarray, times: np.ndarray, force: float, onset: float, begun: float
) -> dict[str, float]:
    """The figures of one swing, which goes along y.

    The tool has stopped where it is farthest forward from where it was at the touch, to within
    :data:`NEAR`; ``end_m`` is where it is in the end.
    """
    if 0 <= begun < (onset if onset >= 0 else np.inf):
        return dict.fromkeys(OUTCOMES, np.nan) | {"delay_s": -np.inf}
    touch = int(np.searchsorted(times, onset))
    gone = tools[touch:, 1] - tools[touch, 1]
    stop = touch + int(np.flatnonzero(gone >= gone.max() - NEAR)[0])
    region = body_region("chest")
    found = (
        force,
        force**2 / (2 * region.stiffness),
        begun - onset if begun >= 0 else np.nan,
        float(times[stop] - onset),
        float(gone.max()),
        float(gone[-1]),
        force / region.transient_force,
    )
    return dict(zip(OUTCOMES, found, strict=True))
