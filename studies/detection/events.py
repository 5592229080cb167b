"""Events of the diagnosis study: collisions, pushes and payloads, with their truth."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from studies.detection.motions import FORCES, PAYLOADS, Conditions, struck_pool
from tauguard.datasets.plans import BEGIN, collision_plans, episode_seconds
from tauguard.detectors import CollisionAlarm
from tauguard.detectors.diagnosis.post_alarm import AFTER
from tauguard.detectors.events import detection_window
from tauguard.envs import Episode, PayloadPick, simulate
from tauguard.traces import STRATA, Alarm, Collision, Trace

#: A clamp must touch without a break in this last part of the diagnosis's window [s].
END = 0.03
#: Duration of a hand's push, half a sine of force [s].
PUSH_SECONDS = (0.6, 1.4)
PUSH_STRATA = STRATA[:4]  #: severity of pushes [N m]
PICKED = (500.0, 1000.0, 2000.0, 3500.0)  #: payloads that are unknown to detectors [g]
UP, DOWN = 4.0, 8.0  #: times at which a payload is picked up and put down [s]
LONG = 10.0  #: length of a payload episode [s]


@dataclass(frozen=True)
class Event:
    """One event and the alarm that it raised, if any."""

    arm: int  #: seed of the arm's model errors
    speed: float  #: joint speed [% of the maximum]
    kind: str  #: one of :data:`~tauguard.detectors.diagnosis.classification.KINDS`
    trace: Trace
    alarm: Alarm | None
    collision: Collision | None  #: None for a payload change
    mass: float = 0.0  #: change of the payload [kg]


def struck_events(
    seed: int, speed: float, trained: dict[int, CollisionAlarm], per_stratum: int
) -> Iterator[Event]:
    """Collisions of the detection study: strikes, pulses and clamps of all severities."""
    for struck in struck_pool(seed, speed, list(trained), per_stratum):
        alarms = trained[struck.arm].detect(struck.trace).alarms
        assert struck.trace.truth is not None
        for collision, kept in zip(struck.trace.truth.collisions, struck.kept, strict=True):
            if kept:
                alarm = first_alarm(alarms, collision)
                kind = contact_kind(struck.trace, collision, alarm)
                yield Event(struck.arm, speed, kind, struck.trace, alarm, collision)


def push_events(
    seed: int, speed: float, trained: dict[int, CollisionAlarm], episodes: int, each: int = 5
) -> Iterator[Event]:
    """Intended pushes of a hand, half of them while the arm dwells."""
    rng = np.random.default_rng([seed, round(100 * speed), 21])
    arms = list(trained)
    for k in range(episodes):
        plans = tuple(
            replace(
                plan,
                kind="pulse",
                at_rest=bool(rng.random() < 0.5),
                duration=float(rng.uniform(*PUSH_SECONDS)),
                severity=PUSH_STRATA[int(rng.integers(len(PUSH_STRATA)))],
                force=FORCES,
            )
            for plan in collision_plans(rng, each)
        )
        arm = arms[k % len(arms)]
        trace = simulate(_episode(rng, speed, arm, PAYLOADS[k % len(PAYLOADS)], plans=plans))
        alarms = trained[arm].detect(trace).alarms
        assert trace.truth is not None
        for collision in trace.truth.collisions:
            yield Event(arm, speed, "push", trace, first_alarm(alarms, collision), collision)


def payload_events(
    seed: int, speed: float, trained: dict[int, CollisionAlarm], episodes: int
) -> Iterator[Event]:
    """Payloads that are picked up and put down, unknown to the detector."""
    rng = np.random.default_rng([seed, round(100 * speed), 22])
    arms = list(trained)
    for k in range(episodes):
        arm, grams = arms[k % len(arms)], PICKED[k % len(PICKED)]
        picks = (PayloadPick(UP, grams), PayloadPick(DOWN, 0.0))
        trace = simulate(_episode(rng, speed, arm, 0.0, picks=picks))
        alarms = trained[arm].detect(trace).alarms
        for time, mass in ((UP, grams / 1000), (DOWN, -grams / 1000)):
            alarm = next((a for a in alarms if time <= a.start <= time + 0.5), None)
            yield Event(arm, speed, "payload", trace, alarm, None, mass)


def _episode(
    rng: np.random.Generator,
    speed: float,
    arm: int,
    payload: float,
    plans: Sequence[object] = (),
    picks: tuple[PayloadPick, ...] = (),
) -> Episode:
    return Episode(
        seed=int(rng.integers(2**62)),
        seconds=episode_seconds(len(plans), BEGIN) if plans else LONG,
        speed=speed,
        payload_g=payload,
        collisions=tuple(plans),  # type: ignore[arg-type]
        picks=picks,
        mismatch=Conditions().arm(arm),
        temperature=float(rng.uniform(25, 45)),
    )


def first_alarm(alarms: Sequence[Alarm], collision: Collision) -> Alarm | None:
    """The alarm that detects ``collision``, if any."""
    low, high = detection_window(collision)
    return next((a for a in alarms if low <= a.start <= high), None)


def contact_kind(trace: Trace, collision: Collision, alarm: Alarm | None) -> str:
    """The kind of a contact: a clamp still presses at the end of the window."""
    if collision.kind != "clamp" or alarm is None or trace.truth is None:
        return "transient"
    end = alarm.start + AFTER
    rows = slice(*np.searchsorted(trace.t, (end - END, end)))
    force = trace.truth.contact_force[rows]
    return "clamp" if len(force) and force.min() > 0 else "transient"
