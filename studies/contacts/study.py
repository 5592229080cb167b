"""Contact checkers beside MuJoCo's own contacts: what each sees, how early, at what cost.

Three studies. ``scenes``: every checker in every contact scene, judged by a referee on the very
path that the checkers are told. ``crossing``: a ball into pinned cloth, from starts spread over one
step's travel, where the time of impact is known in closed form. ``cost``: a large cloth, where a
checker's time is a share of MuJoCo's step. Precision, recall and lead are those of
:func:`tauguard.contacts.compare`; a time is the processor's (median, 10 % and 90 %).
``first_error_ms`` is the second yardstick: a checker's first report beside the first contact of
MuJoCo alone in steps fifty (quick: ten) times shorter, where it covers that pair. MuJoCo's flags
``speculative`` (rigid convex pairs) and ``ipc`` (cloth against what stands still, or cloth) leave
a moving ball on cloth to its ordinary contacts, so that their rows equal the plain ones.
"""

from __future__ import annotations

import itertools
from typing import Any

import mujoco
import numpy as np

from studies.framework import answer, timed
from tauguard.contacts import Report, Score, State, checker, compare, contacts_of
from tauguard.contacts.scenes import SCENES, arm_cloth, ball_cloth
from tauguard.report import Row, rate

CHECKERS = ("mujoco", "cloth", "rigid")
#: Seconds of a scene in a quick run, where its own time is long.
QUICK_SECONDS = {
    "arm_cloth": 0.35,
    "sleeve_arm": 0.3,
    "garment_chest": 0.45,
    "arm_boxes": 1.2,
    "two_arms": 1.2,
}

#: What the columns of each table mean.
NOTES = {
    "scenes": "recall: of the referee's contacts, steps_recall: of its contact steps, precision: "
    "of the checker's reports. lead_ms: before MuJoCo's first contact; first_error_ms: beside "
    "MuJoCo in far shorter steps. share: of mj_step's time. not_generated, not_held: MuJoCo "
    "alone.",
    "crossing": "starts spread over one step's travel. mujoco_generates: it makes a contact; "
    "mujoco_holds: the ball never crosses the cloth; cloth_time_error [s]: against the closed "
    "form.",
    "cost": "what a checker adds to a step; state_us: the copy of the state that it needs.",
}


def measure(quick: bool, seed: int) -> list[Row]:
    """Rows of the three studies; the scenes have no random input, so ``seed`` changes nothing."""
    timesteps = (5e-3,) if quick else (1e-3, 2e-3, 5e-3)
    rows = [
        row
        for timestep, name in itertools.product(timesteps, SCENES)
        for row in _scene(
            name, timestep, QUICK_SECONDS.get(name) if quick else None, 10 if quick else 50
        )
    ]
    speeds = (10.0, 50.0) if quick else (1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
    modes = ("plain",) if quick else ("plain", "speculative", "ipc")
    offsets = 5 if quick else 20
    for mode, timestep, speed in itertools.product(modes, timesteps, speeds):
        rows.append(_crossing(speed, timestep, mode, offsets))
    rows += _cost(0.3 if quick else 0.6)
    return rows + _summary(rows, quick)


def _scene(name: str, timestep: float, seconds: float | None, fine: int) -> list[Row]:
    """One row a checker."""
    report = compare(SCENES[name](), CHECKERS, timestep=timestep, seconds=seconds, fine=fine)
    missed = sum(not outcome.generated for outcome in report.outcomes)
    lost = sum(not outcome.held for outcome in report.outcomes)
    return [
        {
            "study": "scenes",
            "scene": name,
            "timestep_ms": 1e3 * timestep,
            "checker": score.checker,
            "precision": rate(score.correct or 0, score.reports or 0),
            "recall": rate(score.recalled or 0, score.events or 0),
            "steps_recall": rate(score.steps_found or 0, score.steps or 0),
            "delay_ms": score.delay_ms,
            "lead_ms": score.lead_ms,
            "first_error_ms": score.first_error_ms,
            "depth_mm": score.depth_mm,
            "normal_deg": score.normal_deg,
            **_times(score, report),
            "not_generated": missed if score.checker == "mujoco" else None,
            "not_held": lost if score.checker == "mujoco" else None,
        }
        for score in report.scores
    ]


def _times(score: Score, report: Report) -> Row:
    return {
        "us_per_step": {"median": score.us_per_step, "low": score.us_low, "high": score.us_high},
        "mj_step_us": report.step_us,
        "share": score.share,
    }


def _crossing(speed: float, timestep: float, mode: str, offsets: int) -> Row:
    """Runs from evenly spread starts and three impact points, until the ball has had its time."""
    generated = held = crossings = seen = 0
    error = 0.0
    for impact in ("vertex", "edge", "face"):
        for offset in np.arange(offsets) / offsets * speed * timestep:
            one = _fly(speed, timestep, mode, impact, float(offset))
            generated += one["generated"]
            held += one["held"]
            crossings += 1
            seen += np.isfinite(one["error"])
            error = max(error, one["error"]) if np.isfinite(one["error"]) else error
    return {
        "study": "crossing",
        "scene": "ball_cloth",
        "timestep_ms": 1e3 * timestep,
        "speed": speed,
        "mode": mode,
        "mujoco_generates": rate(generated, crossings),
        "mujoco_holds": rate(held, crossings),
        "cloth_recall": rate(seen, crossings),
        "cloth_time_error": error,
    }


def _fly(speed: float, timestep: float, mode: str, impact: str, offset: float) -> dict[str, Any]:
    """One flight: did MuJoCo list and hold the contact, and how far off is the checker's time?

    Before the first contact the ball moves uniformly and the cloth rests, so the time of impact is
    the gap over the speed. Held: the ball's centre never crosses the middle surface.
    """
    scene = ball_cloth(speed=speed, offset=offset, impact=impact, mode=mode)
    model, data = scene.start(timestep)
    scratch = mujoco.MjData(model)
    check = checker("cloth", model)
    before = State.of(model, data, scratch)
    ball = int(model.geom_bodyid[0])
    level = float(before.flexvert_xpos[:, 2].mean())
    gap = before.xpos[ball, 2] - level - model.geom_size[0, 0] - model.flex_radius[0]
    truth = gap / speed
    generated, held, found = False, True, np.inf
    for _ in range(int(np.ceil(scene.seconds / timestep))):
        mujoco.mj_step(model, data)
        after = State.of(model, data, scratch)
        generated |= len(contacts_of(data)) > 0
        if not np.isfinite(found):
            contacts = check.check(before, after)
            if len(contacts):
                found = before.time + float(contacts.time.min()) * timestep
        held &= _above(model, after, ball)
        before = after
    return {"generated": generated, "held": generated and held, "error": abs(found - truth)}


def _above(model: Any, state: State, ball: int) -> bool:
    """Whether the ball's centre is above the cloth's middle surface, where it came from."""
    corners = state.flexvert_xpos[model.flex_elem.reshape(-1, 3)]
    centre = state.xpos[ball]
    (ux, uy), (vx, vy) = ((corners[:, k] - corners[:, 0])[:, :2].T for k in (1, 2))
    px, py = (centre - corners[:, 0])[:, :2].T
    area = ux * vy - uy * vx
    s, t = (px * vy - py * vx) / area, (ux * py - uy * px) / area
    inside = (s >= -1e-9) & (t >= -1e-9) & (s + t <= 1 + 1e-9)
    weights = np.stack([1 - s - t, s, t], axis=1)
    heights = (weights * corners[:, :, 2]).sum(axis=1)[inside]
    return bool(len(heights) == 0 or centre[2] > heights.min())


def _cost(seconds: float) -> list[Row]:
    """The arm into cloth of 40 x 40 vertices: what a checker adds to MuJoCo's step."""
    report = compare(arm_cloth(count=40), CHECKERS, timestep=2e-3, seconds=seconds, referee=False)
    return [
        {
            "study": "cost",
            "scene": "arm_cloth",
            "cloth": "40x40",
            "timestep_ms": 2.0,
            "checker": score.checker,
            **_times(score, report),
            "state_us": report.state_us,
            "share_with_state": score.share + report.state_us / report.step_us,
        }
        for score in report.scores
    ]


def _summary(rows: list[Row], quick: bool) -> list[Row]:
    """What the tables say, beside what was asked."""
    out = []
    for name in CHECKERS:
        mine = [r for r in rows if r["study"] == "scenes" and r["checker"] == name]
        for kind in ("recall", "steps_recall", "precision"):
            counted = [r for r in mine if r[kind]["n"]]
            count = sum(round(r[kind]["value"] * r[kind]["n"]) for r in counted)
            runs = sum(r[kind]["n"] for r in counted)
            worst = min(counted, key=lambda r: r[kind]["value"])
            text = f"{count} of {runs}, lowest {worst[kind]['value']:.4f} in {worst['scene']}"
            bar = kind == "recall" and name != "mujoco"
            met = count == runs if bar else None
            out.append(answer(f"{name}: {kind}", "1.0" if bar else "figure", text, met))
        if name != "mujoco":
            for kind, what in (
                ("lead_ms", "lead over MuJoCo [ms]"),
                ("depth_mm", "depth beside MuJoCo's [mm]"),
                ("normal_deg", "normal beside MuJoCo's [deg]"),
            ):
                out.append(answer(f"{name}: {what}", "figure", _ranges(mine, kind)))
    flights = [r for r in rows if r["study"] == "crossing"]
    seen = min(r["cloth_recall"]["value"] for r in flights)
    off = max(r["cloth_time_error"] for r in flights)
    out.append(answer("ball: crossings seen by cloth", "1.0", f"{seen:.3f}", seen == 1))
    out.append(answer("ball: error of its time [s]", "below 1e-6", f"{off:.2g}", off < 1e-6))
    for mode in dict.fromkeys(r["mode"] for r in flights):
        mine = [r for r in flights if r["mode"] == mode]
        shares = [
            f"{kind} {np.mean([r[f'mujoco_{kind}']['value'] for r in mine]):.3f}"
            for kind in ("generates", "holds")
        ]
        out.append(
            answer(
                f"ball: MuJoCo alone, {mode}, all speeds and timesteps", "share", ", ".join(shares)
            )
        )
    for row in (r for r in rows if r["study"] == "cost" and r["checker"] != "mujoco"):
        text = f"{row['share']:.3f}, {row['share_with_state']:.3f} with the state's copy"
        what = f"{row['checker']}: share of mj_step, arm and 40x40 cloth"
        met = timed(row["share_with_state"] < 0.25, quick)
        out.append(answer(what, "below 0.25", text, met))
    return out


def _ranges(rows: list[Row], kind: str) -> str:
    """By scene, the least and greatest of its timesteps' medians."""
    scenes: dict[str, list[float]] = {}
    for row in rows:
        if row[kind] is not None:
            scenes.setdefault(row["scene"], []).append(row[kind])
    return ", ".join(f"{name} {min(v):.2g}..{max(v):.2g}" for name, v in scenes.items())


def draw(rows: list[Row], figure: Any) -> None:
    """Error against cost in every scene, and the ball's contacts against its speed."""
    axes = figure.subplot_mosaic([["cost", "generates"], ["cost", "holds"]])
    left = axes["cost"]
    colours = dict(zip(CHECKERS, ("C7", "C0", "C1"), strict=True))
    scenes = [r for r in rows if r["study"] == "scenes" and r["recall"]["n"]]
    for row in scenes:
        late = abs(row["delay_ms"]) if row["delay_ms"] is not None else np.inf
        missed = row["recall"]["value"] < 1
        left.plot(
            row["share"],
            row["timestep_ms"] if missed else max(late, 1e-9),
            "x" if missed else "o",
            color=colours[row["checker"]],
        )
    for name, colour in colours.items():
        left.plot([], [], "o", color=colour, label=name)
    left.plot([], [], "x", color="black", label="misses contacts (at its timestep)")
    left.set(xscale="log", yscale="log")
    left.set(xlabel="cost: share of mj_step", ylabel="error: onset to first report [ms]")
    left.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    for kind in ("generates", "holds"):
        _draw_shares([r for r in rows if r["study"] == "crossing"], axes[kind], kind)
    axes["generates"].legend(fontsize="small", loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2)
    axes["holds"].set(xlabel="ball's speed [m/s]")


def _draw_shares(rows: list[Row], axis: Any, kind: str) -> None:
    """Share of balls over their speed: a colour a timestep, a line style a mode of MuJoCo."""
    styles = {"plain": "-", "speculative": "--", "ipc": ":"}
    widths = {"plain": 4, "speculative": 2.5, "ipc": 1.2}  # equal curves stay visible
    timesteps = sorted({r["timestep_ms"] for r in rows})
    shades = dict(zip(timesteps, ("C2", "C4", "C1"), strict=False))
    for mode, timestep in itertools.product(dict.fromkeys(r["mode"] for r in rows), timesteps):
        mine = [r for r in rows if (r["mode"], r["timestep_ms"]) == (mode, timestep)]
        axis.plot(
            [r["speed"] for r in mine],
            [r[f"mujoco_{kind}"]["value"] for r in mine],
            styles[mode],
            color=shades[timestep] if mode == "plain" else "black",
            alpha=0.5 if mode == "plain" else 1,
            linewidth=widths[mode],
            label=f"MuJoCo, {mode}, {timestep:g} ms"
            if mode == "plain"
            else (f"MuJoCo, {mode}" if timestep == timesteps[0] else None),
        )
    if kind == "generates":
        speeds = sorted({r["speed"] for r in rows})
        cloth = [min(r["cloth_recall"]["value"] for r in rows if r["speed"] == v) for v in speeds]
        axis.plot(speeds, cloth, "o", color="C0", label="cloth, every timestep")
    axis.set(xscale="log", ylabel=f"share that MuJoCo {kind}", ylim=(-0.05, 1.05))
    axis.grid(alpha=0.3)
