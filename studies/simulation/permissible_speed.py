"""Forces of clamped and free contacts beside MuJoCo, and contacts at the permissible speed.

The tool of an arm hits a body region at a random pose, in a random direction. The truth is MuJoCo's
contact between two balls with the whole arm, its drives, friction and torque limits.
"""

from __future__ import annotations

import math

import numpy as np

from oracles.tool_contact import Hit, ToolContacts, first_contact
from studies.framework import answer, table_rows
from tauguard.arrays import Array
from tauguard.models import BODY_REGIONS
from tauguard.report import Row
from tauguard.speed import Stop, Tool
from tauguard.speed.arm_states import ArmStates, ContactArm
from tauguard.speed.contact import Contacts, follow
from tauguard.speed.tool import Spring

ARMS = ("cura6", "ur5e", "panda", "iiwa14", "cura6-small")
REGIONS = ("hand", "lower_arm", "chest")
DELAYS = (0.005, 0.02, 0.05, 0.1)
NOTES = {
    "contact": "force in MuJoCo over the predicted one: 2.5 %, 50 %, 97.5 % of the contacts. peak: "
    "of 0.6 s (free: until they part); lasting: after 0.5 s, if above 20 N are predicted.",
    "at_limit": "contacts at the permissible speed. force_over_limit: the larger of peak and "
    "lasting force in MuJoCo over its limit; above, above_1_1: fraction of contacts above 1, 1.1.",
}


def measure(quick: bool, seed: int) -> list[Row]:
    """Rows of ``contact`` and ``at_limit``."""
    count = 2 if quick else 17  # full: 17 x 3 regions x 5 arms x 5 kinds: 1,275 contacts
    rng = np.random.default_rng(seed)
    rows: list[Row] = []
    for arm in ARMS[:2] if quick else ARMS:
        model = ContactArm.of(arm, Tool())
        for delay in (*DELAYS, math.inf):
            rows.append(_contacts(arm, model, delay, count, rng))
    for arm in ARMS[:2] if quick else ARMS:
        model = ContactArm.of(arm, Tool())
        rows += [_at_limit(arm, model, delay, 4 * count, rng) for delay in DELAYS]
    return rows


def judge(rows: list[Row]) -> list[Row]:
    """Judge predictions of clamped contacts, and contacts at the permissible speed."""
    clamped = [row for row in table_rows(rows, "contact") if row["contact"] == "clamped"]
    free = [row for row in table_rows(rows, "contact") if row["contact"] == "free"]
    limit = table_rows(rows, "at_limit")
    above = sum(row["above"] * row["contacts"] for row in limit) / sum(
        row["contacts"] for row in limit
    )
    found = {
        "clamped peak, 95 % of the contacts": _range(clamped, "peak"),
        "free first peak, 95 % of the contacts": _range(free, "peak"),
    }
    return [
        *(
            answer(what, "0.85 to 1.15", f"{low:.2f} to {high:.2f}", low >= 0.85 and high <= 1.15)
            for what, (low, high) in found.items()
        ),
        answer(
            "contacts above the limit at the permissible speed",
            "5 %",
            f"{above:.1%}",
            above <= 0.05,
        ),
    ]


def _range(rows: list[Row], name: str) -> tuple[float, float]:
    return min(row[f"{name}_low"] for row in rows), max(row[f"{name}_high"] for row in rows)


def _batch(
    model: ContactArm,
    hit: Hit,
    factors: Array,
    region: str,
    mass: float,
    delay: float,
) -> Contacts:
    """The contact at some multiples of its speed."""
    states = ArmStates.of(model, hit.q[None], hit.qd[None])
    lever = np.einsum("ij,i->j", states.jacobian[0, -1], hit.normal)
    count = len(factors)
    return Contacts(
        np.repeat(states.inverse_mass, count, axis=0),
        np.repeat(states.gravity, count, axis=0),
        np.tile(lever, (count, 1)),
        factors[:, None] * hit.qd,
        Spring(np.full(count, BODY_REGIONS[region].stiffness)),
        np.full(count, mass),
        np.full(count, delay),
        np.full(count, math.inf),
    )


def _contacts(
    arm: str, model: ContactArm, delay: float, count: int, rng: np.random.Generator
) -> Row:
    free = math.isinf(delay)
    peaks: list[float] = []
    lasting: list[float] = []
    for region in REGIONS:
        bench = ToolContacts(arm, region, clamped=not free)
        for _ in range(count):
            hit = bench.draw(rng, rng.uniform(0.1, 0.5), delay, Stop().deceleration)
            mass = BODY_REGIONS[region].mass if free else math.inf
            batch = _batch(model, hit, np.ones(1), region, mass, delay)
            course = follow(model, batch, Stop(), keep=True)
            assert course.force is not None
            simulated, predicted = hit.force, course.force[:, 0]
            if free:
                simulated, predicted = first_contact(simulated), first_contact(predicted)
            peaks.append(float(simulated.max() / predicted.max()))
            if not free and course.lasting[0] > 20:
                lasting.append(
                    float(hit.force[len(hit.force) * 5 // 6 :].max() / course.lasting[0])
                )
    row: Row = {
        "study": "contact",
        "arm": arm,
        "contact": "free" if free else "clamped",
        "delay_ms": None if free else 1e3 * delay,
        "contacts": len(peaks),
    }
    for name, ratios in (("peak", peaks), ("lasting", lasting)):
        quantiles = np.quantile(ratios, [0.025, 0.5, 0.975]) if ratios else [math.nan] * 3
        row |= dict(zip((f"{name}_low", name, f"{name}_high"), map(float, quantiles), strict=True))
    return row


def _at_limit(
    arm: str, model: ContactArm, delay: float, count: int, rng: np.random.Generator
) -> Row:
    worst: list[float] = []
    speeds: list[float] = []
    trials = np.geomspace(0.02, 1.5, 40)
    benches = {region: ToolContacts(arm, region, clamped=True) for region in REGIONS}
    for number in range(count):
        region = REGIONS[number % len(REGIONS)]
        limits, bench = BODY_REGIONS[region], benches[region]
        hit = bench.draw(rng, 0.25, math.inf, Stop().deceleration)
        course = follow(model, _batch(model, hit, trials / 0.25, region, math.inf, delay), Stop())
        over = (course.peak > limits.transient_force) | (course.lasting > limits.quasi_static_force)
        last = int(np.argmax(over)) - 1 if over.any() else len(trials) - 1
        speed = float(trials[last]) if last >= 0 else 0.0
        again = bench.repeat(hit, speed / 0.25, delay, Stop().deceleration) if speed else None
        if again is None:
            continue
        late = again.force[len(again.force) * 5 // 6 :].max()
        worst.append(
            max(again.force.max() / limits.transient_force, late / limits.quasi_static_force)
        )
        speeds.append(speed)
    ratios = np.array(worst)
    return {
        "study": "at_limit",
        "arm": arm,
        "delay_ms": 1e3 * delay,
        "contacts": len(ratios),
        "speed_m_s": float(np.median(speeds)),
        "force_over_limit": float(np.median(ratios)),
        "largest": float(ratios.max()),
        "above": float((ratios > 1).mean()),
        "above_1_1": float((ratios > 1.1).mean()),
    }
