"""Fast things against thin things: fixed steps, MuJoCo's own modes and guarded steps.

Studies. ``ball_cloth``: a ball (10 mm, 20 g) into stretched cloth, over starts spread across one
step's travel and three impact points. ``sphere_plate``: a rigid sphere into a plate of 2 mm.
``overhead``: what the guard costs where there is nothing to guard. *Generated*: MuJoCo made a
contact. *Held*: the ball's centre never crossed the mid-surface. The error is that of the ball's
velocity some time after the touch, against the same contacts at a fine fixed step; a run that is
not held is in it, for it is the answer that a user would get.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.benchmarks.harness import answer
from tauguard.contacts import GuardedStepper, State
from tauguard.contacts.scenes import ContactScene, arm_boxes, arm_cloth, ball_cloth, sphere_plate
from tauguard.contacts.scenes.impacts import BALL_GAP, IMPACT_POINTS
from tauguard.report import Row, rate

Array = NDArray[np.float64]

#: How long after the first touch a run goes on [s].
AFTER = 0.04
#: Timesteps that guarded steps and MuJoCo's own modes are tried at [s].
COARSE = (1e-3, 2e-3, 5e-3)
#: Finer fixed steps, down to what holds everything [s].
FINE = (5e-4, 2e-4, 1e-4, 5e-5)
#: Pieces of a step while a guarded pair touches, in the rows ``guarded, fine``.
PIECES = 10
#: Starts across one step's travel: in a quick run, with fine steps, otherwise.
OFFSETS_QUICK, OFFSETS_FINE, OFFSETS = 3, 4, 20

_IMPACT = (
    "generated: MuJoCo made a contact; held: the body never crossed the mid-surface. rebound: its "
    "velocity after the touch [m/s], reference: at a fine fixed step, error: between both. saves: "
    "time of the largest fixed step that holds every run (first_fixed_ms), over ms."
)
#: What the columns of each table mean.
NOTES = {
    "ball_cloth": _IMPACT,
    "sphere_plate": _IMPACT,
    "overhead": "a step of a scene in which nothing is to be guarded, plain and guarded.",
}


@dataclass(frozen=True)
class Run:
    """One run of one scene."""

    generated: bool
    held: bool
    velocity: float  #: of the ball along z at the end [m/s]
    steps: int  #: calls of ``mj_step``, taken-back ones included
    ms: float  #: of the processor, for stepping alone
    cuts: int
    exhausted: int


def run(quick: bool, seed: int) -> list[Row]:
    """Rows of the three studies; nothing is random, so ``seed`` changes nothing."""
    rows: list[Row] = []
    speeds = (5.0, 50.0) if quick else (1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
    for stiff, speed in itertools.product((True,) if quick else (True, False), speeds):
        rows += _cloth_rows(speed, stiff, quick)
    for stiff, speed in itertools.product((True, False), speeds):
        rows += _plate_rows(speed, stiff, quick)
    rows += _overhead_rows(quick)
    return rows + _summary(rows)


def _cloth_rows(speed: float, stiff: bool, quick: bool) -> list[Row]:
    """One row a method and timestep."""
    fine = FINE[:2] if quick else FINE
    methods = [("plain", dt) for dt in (*fine, *COARSE)]
    methods += [(mode, dt) for mode in ("speculative", "ipc") for dt in COARSE if not quick]
    methods += [(mode, dt) for mode in ("guarded", "guarded, fine") for dt in COARSE]
    reference = np.mean(
        [
            one(
                ball_cloth(speed, 0.0, impact, stiff), speed, 0.0, 5e-5 if quick else 1e-5, 0
            ).velocity
            for impact in IMPACT_POINTS
        ]
    )

    def scenes(mode: str, timestep: float) -> Iterable[tuple[ContactScene, float]]:
        count = OFFSETS_QUICK if quick else OFFSETS_FINE if timestep < COARSE[0] else OFFSETS
        for impact, k in itertools.product(IMPACT_POINTS, range(count)):
            offset = k / count * speed * timestep
            yield ball_cloth(speed, offset, impact, stiff, mode), offset

    return with_ratio(
        [
            _row("ball_cloth", method, dt, speed, stiff, float(reference), scenes)
            for method, dt in methods
        ]
    )


def _plate_rows(speed: float, stiff: bool, quick: bool) -> list[Row]:
    methods = [("plain", dt) for dt in (1e-4, *COARSE)]
    methods += [(mode, dt) for mode in ("speculative", "guarded") for dt in COARSE]
    fine = one(sphere_plate(speed, 0.0, stiff), speed, 0.0, 1e-5, 0).velocity

    def scenes(mode: str, timestep: float) -> Iterable[tuple[ContactScene, float]]:
        for k in range(OFFSETS_QUICK if quick else OFFSETS):
            offset = k / (OFFSETS_QUICK if quick else OFFSETS) * speed * timestep
            yield sphere_plate(speed, offset, stiff, mode), offset

    return with_ratio(
        [_row("sphere_plate", m, dt, speed, stiff, fine, scenes) for m, dt in methods]
    )


def _row(
    study: str,
    method: str,
    timestep: float,
    speed: float,
    stiff: bool,
    reference: float,
    scenes: Callable[[str, float], Iterable[tuple[ContactScene, float]]],
) -> Row:
    guarded = {"guarded": 1, "guarded, fine": PIECES}.get(method, 0)
    runs = [
        one(scene, speed, offset, timestep, guarded)
        for scene, offset in scenes("plain" if guarded else method, timestep)
    ]
    off = [abs(r.velocity - reference) for r in runs]
    return {
        "study": study,
        "contact": "stiff" if stiff else "soft",
        "speed": speed,
        "method": method,
        "timestep_ms": 1e3 * timestep,
        "generated": rate(sum(r.generated for r in runs), len(runs)),
        "held": rate(sum(r.held for r in runs), len(runs)),
        "rebound": float(np.median([r.velocity for r in runs])),
        "reference": reference,
        "error": {"median": float(np.median(off)), "low": min(off), "high": max(off)},
        "steps": float(np.mean([r.steps for r in runs])),
        "cuts": float(np.mean([r.cuts for r in runs])),
        "exhausted": sum(r.exhausted for r in runs),
        "ms": {
            "median": float(np.median([r.ms for r in runs])),
            "low": min(r.ms for r in runs),
            "high": max(r.ms for r in runs),
        },
    }


def with_ratio(rows: list[Row]) -> list[Row]:
    """Adds the cost of the largest fixed step that holds every run, over each row's own cost."""
    holding = [r for r in rows if r["method"] == "plain" and r["held"]["value"] == 1.0]
    # A coarse step may hold by luck where a finer one does not: all finer ones must hold, too.
    plain = sorted((r for r in rows if r["method"] == "plain"), key=lambda r: r["timestep_ms"])
    first = None
    for row in plain:
        if row not in holding:
            break
        first = row
    for row in rows:
        row["first_fixed_ms"] = None if first is None else first["timestep_ms"]
        row["first_fixed_error"] = None if first is None else first["error"]["median"]
        row["saves"] = None if first is None else first["ms"]["median"] / row["ms"]["median"]
    return rows


def one(scene: ContactScene, speed: float, offset: float, timestep: float, guarded: int) -> Run:
    """Run ``scene`` until :data:`AFTER` the touch; ``guarded``: pieces, 0 for plain steps."""
    model, data = scene.start(timestep)
    scratch = mujoco.MjData(model)
    guard = GuardedStepper(model, data, fine=guarded) if guarded else None
    dof = int(model.body("ball").dofadr[0]) + 2
    at = side(model, data, scratch)
    generated, held, steps, cuts, exhausted, spent = False, True, 0, 0, 0, 0.0
    for _ in range(round(((BALL_GAP + offset) / speed + AFTER) / timestep)):
        begin = time.process_time()
        if guard is None:
            mujoco.mj_step(model, data)
            steps, generated = steps + 1, generated or data.ncon > 0
        else:
            report = guard.step()
            steps, cuts = steps + report.steps, cuts + len(report.cuts)
            exhausted += report.exhausted
            generated |= report.contacts > 0
        spent += time.process_time() - begin
        held &= side(model, data, scratch) == at
    velocity = float(data.qvel[dof])
    return Run(generated, generated and held, velocity, steps, 1e3 * spent, cuts, exhausted)


def side(model: Any, data: Any, scratch: Any) -> float:
    """On which side of the cloth, or of the plate's middle, the ball's centre is: 1 or -1.

    For a cloth the sign of the solid angle under which the centre sees it: within (0, 4 pi) on one
    side, also in a pocket, and less by 4 pi on the other.
    """
    if not model.nflex:
        return float(np.sign(data.qpos[2]))
    state = State.of(model, data, scratch)
    corners = state.flexvert_xpos[model.flex_elem.reshape(-1, 3)]
    a, b, c = (corners - state.geom_xpos[model.geom("ball").id]).transpose(1, 2, 0)
    la, lb, lc = (np.sqrt((x * x).sum(axis=0)) for x in (a, b, c))
    top = (a * np.cross(b, c, axis=0)).sum(axis=0)
    bottom = la * lb * lc + (a * b).sum(0) * lc + (b * c).sum(0) * la + (c * a).sum(0) * lb
    return float(np.sign(np.arctan2(top, bottom).sum()))


def _overhead_rows(quick: bool) -> list[Row]:
    """Plain and guarded steps of scenes in which nothing is missed, in turn."""
    rows = []
    steps = 60 if quick else 300
    scenes = [arm_boxes(), arm_cloth(15)] if quick else [arm_boxes(), arm_cloth(15), arm_cloth(40)]
    for scene in scenes:
        times: dict[str, list[float]] = {"plain": [], "guarded": []}
        states = {name: scene.start(2e-3) for name in times}
        guard = GuardedStepper(*states["guarded"])
        cuts = 0
        for _ in range(steps):
            for name, (model, data) in states.items():
                if scene.control is not None:
                    scene.control(model, data)
                begin = time.process_time()
                if name == "plain":
                    mujoco.mj_step(model, data)
                else:
                    cuts += len(guard.step().cuts)
                times[name].append(1e6 * (time.process_time() - begin))
        same = all(
            np.array_equal(getattr(states["plain"][1], f), getattr(states["guarded"][1], f))
            for f in ("qpos", "qvel", "qacc_warmstart")
        )
        plain, guarded = (
            dict(zip(("low", "median", "high"), np.quantile(t, [0.1, 0.5, 0.9]), strict=True))
            for t in times.values()
        )
        rows.append(
            {
                "study": "overhead",
                "scene": scene.name,
                "dofs": scene.model.nv,
                "plain_us": plain,
                "guarded_us": guarded,
                "overhead_share": guarded["median"] / plain["median"] - 1,
                "cuts": cuts,
                "same_bits": same,
            }
        )
    return rows


def _summary(rows: list[Row]) -> list[Row]:
    """What the tables say, beside what was asked."""
    balls = [r for r in rows if r["study"] == "ball_cloth"]
    out = []
    for study in ("ball_cloth", "sphere_plate"):
        mine = [r for r in rows if r["study"] == study and r["method"].startswith("guarded")]
        for kind in ("generated", "held"):
            text, share = _share(mine, kind)
            out.append(answer(f"{study}, guarded at 1, 2, 5 ms: {kind}", "1.000", text, share == 1))
        cut_short = sum(r["exhausted"] for r in mine)
        out.append(answer(f"{study}, guarded: out of work", "0", str(cut_short), cut_short == 0))
    for contact, mode in itertools.product(("stiff", "soft"), ("plain", "speculative", "ipc")):
        mine = [r for r in balls if (r["contact"], r["method"]) == (contact, mode)]
        mine = [r for r in mine if r["timestep_ms"] >= 1e3 * COARSE[0]]
        if mine:
            text = ", ".join(f"{kind} {_share(mine, kind)[0]}" for kind in ("generated", "held"))
            out.append(answer(f"ball_cloth, {mode}, {contact} contact", "share", text))
    for method, timestep in itertools.product(("guarded", "guarded, fine"), COARSE):
        mine = [r for r in balls if (r["contact"], r["method"]) == ("stiff", method)]
        mine = [r for r in mine if r["timestep_ms"] == 1e3 * timestep and r["saves"] is not None]
        text = "; ".join(
            f"{r['speed']:g} m/s {r['saves']:.2g} x, {r['error']['median'] / r['speed']:.2g}"
            f" ({r['first_fixed_ms']:g} ms: {r['first_fixed_error'] / r['speed']:.2g})"
            for r in mine
        )
        what = f"{method}, {1e3 * timestep:g} ms: cheaper than the first fixed step, error / speed"
        out.append(answer(what, "figure", text))
    same = [r for r in rows if r["study"] == "overhead"]
    kept = all(r["same_bits"] for r in same)
    text = ", ".join(f"{r['scene']} ({r['dofs']}) {r['overhead_share']:.2f}" for r in same)
    out.append(answer("same bits where nothing is cut", "yes", "yes" if kept else "no", kept))
    return [*out, answer("guard's own time over mj_step's (degrees of freedom)", "figure", text)]


def _share(rows: list[Row], kind: str) -> tuple[str, float]:
    """Of all runs of these rows: ``700 of 720 (0.972)``."""
    runs = sum(r[kind]["n"] for r in rows)
    count = sum(round(r[kind]["value"] * r[kind]["n"]) for r in rows)
    return f"{count} of {runs} ({count / runs:.3f})", count / runs


def draw(rows: list[Row], figure: Any) -> None:
    """Error of the rebound over cost, a panel a speed; hollow where a run was not held."""
    rows = [r for r in rows if r["study"] == "ball_cloth" and r["contact"] == "stiff"]
    speeds = sorted({r["speed"] for r in rows})[-4:]
    axes = figure.subplots(1, len(speeds), sharey=True, squeeze=False)[0]
    looks = {"plain": ("0.35", "o"), "speculative": ("tab:orange", "s"), "ipc": ("tab:green", "^")}
    looks |= {"guarded": ("tab:blue", "D"), "guarded, fine": ("tab:purple", "v")}
    for axis, speed in zip(axes, speeds, strict=True):
        for method, (color, marker) in looks.items():
            chosen = [r for r in rows if r["speed"] == speed and r["method"] == method]
            chosen.sort(key=lambda r: r["timestep_ms"])
            if not chosen:
                continue
            x = [r["ms"]["median"] for r in chosen]
            y = [max(r["error"]["median"] / speed, 1e-4) for r in chosen]
            if method not in ("speculative", "ipc"):
                axis.plot(x, y, color=color, lw=0.7, zorder=1)
            full = [color if r["held"]["value"] == 1.0 else "white" for r in chosen]
            axis.scatter(x, y, c=full, edgecolors=color, marker=marker, label=method, zorder=2)
            if method in ("speculative", "ipc"):
                continue
            above = 3 if method == "plain" else -10
            for row, x0, y0 in zip(chosen, x, y, strict=True):
                text = f"{row['timestep_ms']:g}"
                shift = {"xytext": (4, above), "textcoords": "offset points"}
                axis.annotate(text, (x0, y0), **shift, color=color, fontsize=7)
        axis.set(xscale="log", yscale="log", title=f"{speed:g} m/s", xlabel="ms per run")
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("rebound error / speed")
    handles, labels = axes[0].get_legend_handles_labels()
    title = "ball into cloth, stiff contact; labels: timestep in ms; hollow: not every run held"
    figure.legend(handles, labels, title=title, loc="outside upper center", ncols=len(labels))
