"""Contact checkers and MuJoCo's own contacts: recall, lead time and cost.

Table ``scenes`` has each checker in each contact scene (:func:`tauguard.contacts.compare`). In
table ``crossing`` a ball flies into pinned cloth, and a closed form gives the time of impact. The
ball's start varies over its travel in one step. Table ``cost`` is of a scene with a large cloth.
"""

from collections.abc import Sequence
from itertools import product

import mujoco
import numpy as np

from oracles.tunnelling import Tunnelling
from studies.framework import answer, groups, table_rows, timed
from tauguard.contacts import Report, Score, State, checker, compare, contacts_of
from tauguard.contacts.scenes import SCENES, arm_cloth, ball_cloth
from tauguard.contacts.scenes.impacts import IMPACT_POINTS
from tauguard.report import Row, rate

CHECKERS = ("mujoco", "cloth", "rigid")
#: Duration of long scenes in a quick run [s].
QUICK_SECONDS = dict(arm_cloth=0.35, sleeve_arm=0.3, garment_chest=0.45) | dict.fromkeys(
    ("arm_boxes", "two_arms"), 1.2
)

NOTES = {
    "scenes": "recall: fraction of true contacts found; steps_recall: fraction of steps with "
    "contact found; precision: fraction of reports that are true. lead_ms: lead over MuJoCo's "
    "first contact; first_error_ms: difference from MuJoCo with steps 50 times shorter (quick: "
    "10). over_mj_step: time over mj_step's. not_generated, not_held: contacts that MuJoCo did "
    "not list, or did not hold.",
    "crossing": "balls that start at points spread over one step's travel. mujoco_generates: "
    "MuJoCo lists a contact; mujoco_holds: it also stops the ball; cloth_time_error [s]: "
    "difference from the closed form.",
    "cost": "time that a checker adds to a step; state_us: copying the state that it needs.",
}


def measure(quick: bool, seed: int) -> list[Row]:
    """Measure the three tables; the scenes have no random input, so ``seed`` has no effect."""
    timesteps = (5e-3,) if quick else (1e-3, 2e-3, 5e-3)
    rows: list[Row] = []
    for timestep, name in product(timesteps, SCENES):
        seconds = QUICK_SECONDS.get(name) if quick else None
        rows += _scene(name, timestep, seconds, 10 if quick else 50)
    speeds = (50.0,) if quick else (1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
    for timestep, speed in product(timesteps, speeds):
        rows.append(_crossing(speed, timestep, 5 if quick else 20))
    return rows + _cost(quick)


def _scene(name: str, timestep: float, seconds: float | None, fine: int) -> list[Row]:
    """A row for each checker in the scene."""
    report = compare(SCENES[name](), CHECKERS, timestep=timestep, seconds=seconds, fine=fine)
    missed = sum(not one.generated for one in report.outcomes)
    lost = sum(not one.held for one in report.outcomes)
    copied = ("delay_ms", "lead_ms", "first_error_ms", "depth_mm", "normal_deg")
    return [
        {
            "study": "scenes",
            "scene": name,
            "timestep_ms": 1e3 * timestep,
            "checker": score.checker,
            "precision": rate(score.correct or 0, score.reports or 0),
            "recall": rate(score.recalled or 0, score.events or 0),
            "steps_recall": rate(score.steps_found or 0, score.steps or 0),
            **{key: getattr(score, key) for key in copied},
            **_times(score, report),
            "not_generated": missed if score.checker == "mujoco" else None,
            "not_held": lost if score.checker == "mujoco" else None,
        }
        for score in report.scores
    ]


def _times(score: Score, report: Report) -> Row:
    time = {"median": score.us_per_step, "low": score.us_low, "high": score.us_high}
    return {"us_per_step": time, "mj_step_us": report.step_us, "over_mj_step": score.over_mj_step}


def _crossing(speed: float, timestep: float, offsets: int) -> Row:
    """One row: balls fly to each impact point from evenly spaced starts."""
    starts = np.arange(offsets) / offsets * speed * timestep
    flights = [
        _fly(speed, timestep, impact, float(start))
        for impact, start in product(IMPACT_POINTS, starts)
    ]
    generated, held, errors = (np.array(column) for column in zip(*flights, strict=True))
    seen = np.isfinite(errors)
    return {
        "study": "crossing",
        "timestep_ms": 1e3 * timestep,
        "speed": speed,
        "mujoco_generates": rate(int(generated.sum()), len(flights)),
        "mujoco_holds": rate(int(held.sum()), len(flights)),
        "cloth_recall": rate(int(seen.sum()), len(flights)),
        "cloth_time_error": float(errors[seen].max(initial=0)),
    }


def _fly(speed: float, timestep: float, impact: str, offset: float) -> tuple[bool, bool, float]:
    """Whether MuJoCo lists and holds the contact, and the error of the checker's time [s].

    Until the first contact the ball moves uniformly and the cloth rests. The time of impact is
    therefore their distance divided by the speed.
    """
    scene = ball_cloth(speed=speed, offset=offset, impact=impact)
    model, data = scene.start(timestep)
    scratch, check = mujoco.MjData(model), checker("cloth", model)
    before, ball = State.of(model, data, scratch), int(model.geom_bodyid[0])
    level = float(before.flexvert_xpos[:, 2].mean())
    distance = before.xpos[ball, 2] - level - model.geom_size[0, 0] - model.flex_radius[0]
    tunnelling, generated, found = Tunnelling(model, data), False, np.inf
    for _ in range(int(np.ceil(scene.seconds / timestep))):
        mujoco.mj_step(model, data)
        after = State.of(model, data, scratch)
        generated |= len(contacts_of(data)) > 0
        if not np.isfinite(found) and len(contacts := check.check(before, after)):
            found = before.time + float(contacts.time.min()) * timestep
        tunnelling.observe(data)
        before = after
    return generated, generated and not tunnelling.pairs, abs(found - distance / speed)


def _cost(quick: bool) -> list[Row]:
    """Added cost of a checker per MuJoCo step, for the arm in a cloth of 40 x 40 vertices."""
    seconds = 0.3 if quick else 0.6
    scene = arm_cloth(count=40)
    report = compare(scene, CHECKERS, timestep=2e-3, seconds=seconds, ground_truth=False)
    copied = {"run": "quick" if quick else "full", "state_us": report.state_us}
    return [
        {
            "study": "cost",
            "scene": "arm_cloth, 40x40",
            "checker": score.checker,
            **_times(score, report),
            **copied,
            "over_mj_step_with_state": score.over_mj_step + report.state_us / report.step_us,
        }
        for score in report.scores
    ]


def judge(rows: Sequence[Row]) -> list[Row]:
    """Recall, errors and cost beside their targets."""
    out: list[Row] = []
    for name, mine in groups(table_rows(rows, "scenes"), lambda row: str(row["checker"])).items():
        for kind in ("recall", "steps_recall", "precision"):
            counted = [row[kind] for row in mine if row[kind]["n"]]
            count = sum(round(one["value"] * one["n"]) for one in counted)
            total, asked = sum(one["n"] for one in counted), kind == "recall" and name != "mujoco"
            met = count == total if asked else None
            what = f"{name}: {kind}"
            out.append(answer(what, "1.0" if asked else "figure", f"{count} of {total}", met))
    flights = table_rows(rows, "crossing")
    seen = min(row["cloth_recall"]["value"] for row in flights)
    off = max(row["cloth_time_error"] for row in flights)
    out.append(answer("ball: crossings seen by cloth", "1.0", f"{seen:.3f}", seen == 1))
    out.append(answer("ball: error of its time [s]", "below 1e-6", f"{off:.2g}", off < 1e-6))
    for row in (row for row in table_rows(rows, "cost") if row["checker"] != "mujoco"):
        text = (
            f"{row['over_mj_step']:.3f}, {row['over_mj_step_with_state']:.3f} with the state's copy"
        )
        what = f"{row['checker']}: fraction of mj_step, arm and 40x40 cloth"
        met = timed(row["over_mj_step_with_state"] < 0.25, row["run"] == "quick")
        out.append(answer(what, "below 0.25", text, met))
    return out
