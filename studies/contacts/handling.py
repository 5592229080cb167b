"""Scenes of handling: guarded steps beside plain ones and beside a fine reference.

The reference is ``mj_step`` at 1/50 of the step with the same contact parameters. It may tunnel:
its floors are planes or thick, so that it does not.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from studies.framework import answer, table_rows
from tauguard.contacts import GuardedStepper
from tauguard.report import Row

#: Steps of the reference for each step.
FINE = 50
METHODS = ("guarded", "plain", "reference")

NOTES = {
    "handling": "speeds and heights of all parts in a run. highest: highest centre of a rising "
    "part after the first contact [m]; up: largest upward speed after it [m/s]; speed, "
    "mean_x_speed: mean speed of the parts, and along the belt, at the end [m/s]; energy: kinetic "
    "energy at the end / at the start; out: parts below the floor at the end; contacts: most "
    "contacts; seconds: processor time of the steps. The reference has 1/50 of the step.",
}


@dataclass(frozen=True)
class Scene:
    """A model, its start, and the commands at a time."""

    model: Any
    data: Any
    seconds: float
    parts: list[int]  #: ids of bodies
    control: Callable[[Any], None] | None = None
    floor: float = -0.02  #: a part whose centre is lower is out [m]


def _parts(rng: np.random.Generator, count: int, place: Callable[[int], Any]) -> str:
    kinds = ("box", "cylinder", "capsule", "ellipsoid", "sphere")
    text = ""
    for k in range(count):
        x, y, z = place(k)
        size = " ".join(f"{s:.4g}" for s in rng.uniform(0.012, 0.025, 3))
        turn = " ".join(f"{a:.4g}" for a in rng.uniform(0, 360, 3))
        text += f"""<body name="part{k}" pos="{x:.4g} {y:.4g} {z:.4g}" euler="{turn}"><freejoint/>
          <geom type="{kinds[k % 5]}" size="{size}" mass=".05"/></body>"""
    return text


def _scene(xml: str, seconds: float, count: int, **more: Any) -> Scene:
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    parts = [model.body(f"part{k}").id for k in range(count)]
    return Scene(model, data, seconds, parts, **more)


def poured(timestep: float, cone: str, fine: bool) -> Scene:
    """A bin of 0.3 m into which 30 parts are poured at 12 m/s."""
    rng = np.random.default_rng(3)
    half = 0.5 if fine else 0.002  # the reference has thick walls
    walls = "".join(
        f'<geom type="box" pos="{x} {y} .4" size="{a} {b} .4" rgba=".6 .7 .8 .3"/>'
        for x, y, a, b in (
            *((0.15 + half, 0, half, 0.16), (-0.15 - half, 0, half, 0.16)),
            *((0, 0.15 + half, 0.16, half), (0, -0.15 - half, 0.16, half)),
        )
    )
    bottom = '<geom type="box" pos="0 0 -.002" size=".16 .16 .002"/>'
    parts = _parts(rng, 30, lambda k: (*rng.uniform(-0.1, 0.1, 2), 0.3 + 0.07 * k))
    scene = _scene(
        f"""<mujoco><option timestep="{timestep}" cone="{cone}" jacobian="dense"
        integrator="implicitfast"/><worldbody>
        {'<geom type="plane" size="2 2 .1"/>' if fine else bottom}{walls}{parts}
        </worldbody></mujoco>""",
        1.5,
        30,
    )
    for body in scene.parts:
        scene.data.qvel[scene.model.body_dofadr[body] + 2] = -12.0
    return scene


def belted(timestep: float, cone: str, fine: bool) -> Scene:
    """A flat part that is dropped at 10 m/s on a thin belt of 3 m/s."""
    belt = '<geom type="box" size="20 .5 .002" pos="0 0 -.002" surfacevel="3 0 0 0 0 0"/>'
    thick = '<geom type="plane" size="20 2 .1" surfacevel="3 0 0 0 0 0"/>'
    scene = _scene(
        f"""<mujoco><option timestep="{timestep}" cone="{cone}"/><worldbody>
        {thick if fine else belt}<body name="part0" pos="0 0 .3"><freejoint/>
        <geom type="box" size=".03 .02 .004" mass=".1"/></body></worldbody></mujoco>""",
        1.0,
        1,
    )
    scene.data.qvel[2] = -10
    return scene


def conveyor(timestep: float, cone: str, fine: bool) -> Scene:
    """A busy conveyor of 1 m/s in a loop: 12 parts that are dropped again at its end."""
    rng = np.random.default_rng(5)
    half = 0.2 if fine else 0.002
    belt = f"""<geom type="box" size="2 .2 {half}" pos="-.4 0 {-half}" surfacevel="1 0 0 0 0 0"/>
      <geom type="box" size="2 {half} .1" pos="-.4 {0.2 + half} .1"/>
      <geom type="box" size="2 {half} .1" pos="-.4 {-0.2 - half} .1"/>"""
    count = 12
    parts = _parts(rng, count, lambda k: (-1 + 0.15 * k, rng.uniform(-0.12, 0.12), 0.1))
    scene = _scene(
        f"""<mujoco><option timestep="{timestep}" cone="{cone}" jacobian="dense"
        integrator="implicitfast"/><worldbody>{belt}{parts}</worldbody></mujoco>""",
        60.0,
        count,
    )
    model = scene.model

    def drop(data: Any) -> None:
        for body in scene.parts:
            at, dof = model.jnt_qposadr[model.body_jntadr[body]], model.body_dofadr[body]
            if data.qpos[at] > 1.0:  # the end of the belt: dropped again at 6 m/s
                data.qpos[at : at + 3] = -1.0, 0.1 * np.sin(7.0 * body + data.time), 0.3
                data.qvel[dof : dof + 6] = 0, 0, -6, 0, 0, 0

    return Scene(model, scene.data, scene.seconds, scene.parts, drop)


def pinched(timestep: float, cone: str, fine: bool) -> Scene:
    """Two fingers pinch a cloth on a table and lift it; its vertices are the parts."""
    half = 0.2 if fine else 0.02
    fingers = "".join(
        f"""<body pos="{x} 0 -.06"><joint name="{name}" type="slide" axis="1 0 0" damping="5"/>
        <geom type="box" size=".008 .012 .04" mass=".05" friction="2"/></body>"""
        for name, x in (("l", 0.04), ("r", -0.04))
    )
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><option timestep="{timestep}" cone="{cone}"
      integrator="implicitfast" solver="CG" tolerance="1e-6"/><worldbody>
      <geom type="box" size=".3 .3 {half}" pos="0 0 {-half}"/>
      <flexcomp name="cloth" type="grid" dim="2" count="13 13 1" spacing=".02 .02 .02"
        pos="0 0 .004" radius=".002" mass=".05"><edge equality="true" damping=".01"/>
        <contact selfcollide="auto" solref=".005 1"/></flexcomp>
      <body pos="0 0 .12"><joint name="lift" type="slide" axis="0 0 1" damping="20"/>
        <geom type="box" size=".05 .03 .01" mass=".7"/>{fingers}</body></worldbody><actuator>
      <position joint="lift" kp="5000" dampratio="1"/>
      <position joint="l" kp="500" forcerange="-20 20" forcelimited="true"/>
      <position joint="r" kp="500" forcerange="-20 20" forcelimited="true"/>
      </actuator></mujoco>""")

    def grip(data: Any) -> None:
        close = 0.035 if data.time > 0.1 else 0.0
        data.ctrl[:] = [0.05 if data.time > 0.3 else -0.035, -close, close]

    data = mujoco.MjData(model)
    return Scene(model, data, 0.5, model.flex_vertbodyid.tolist(), grip)


SCENES = {"bin": poured, "belt": belted, "conveyor": conveyor, "cloth": pinched}


def measure(quick: bool, seed: int) -> list[Row]:
    """Every scene with both cones; the scenes do not depend on the seed."""
    return [
        run(name, cone, method, quick)
        for name in SCENES
        for cone in ("pyramidal", "elliptic")
        for method in METHODS
        if not (quick and name == "cloth" and method == "reference")
    ]


def run(name: str, cone: str, method: str, quick: bool) -> Row:
    """Simulate one scene."""
    fine = method == "reference"
    timestep = 5e-3 / FINE if fine else 5e-3
    scene = SCENES[name](timestep, cone, fine)
    seconds = min(scene.seconds, 3.0) if fine or quick else scene.seconds
    model, data = scene.model, scene.data
    guard = GuardedStepper(model, data) if method == "guarded" else None
    dofs = model.body_dofadr[scene.parts]
    start, touched = _kinetic(model, data), False
    up, highest, most, spent, exhausted = 0.0, -np.inf, 0, 0.0, False
    for k in range(round(seconds / timestep)):
        if scene.control is not None and k % (FINE if fine else 1) == 0:
            scene.control(data)
        begin = time.thread_time()
        if guard is None:
            mujoco.mj_step(model, data)
        else:
            exhausted |= guard.step().exhausted
        spent += time.thread_time() - begin
        touched |= data.ncon > 0
        most = max(most, data.ncon)
        if touched:
            rising = data.qvel[dofs + 2] > 0
            up = max(up, float(data.qvel[dofs + 2].max()))
            highest = max(highest, float(data.xpos[scene.parts, 2][rising].max(initial=-np.inf)))
    velocity = data.qvel[dofs[:, None] + np.arange(3)]
    at = data.xpos[scene.parts]
    return {
        "study": "handling",
        "scene": name,
        "cone": cone,
        "method": method,
        "motion_s": seconds,
        "highest": highest if np.isfinite(highest) else None,
        "up": up,
        "speed": float(np.linalg.norm(velocity, axis=1).mean()),
        "mean_x_speed": float(velocity[:, 0].mean()),
        "energy": _kinetic(model, data) / start if start else None,
        "out": int((at[:, 2] < scene.floor).sum()),
        "exhausted": exhausted,
        "contacts": most,
        "seconds": spent,
    }


def _kinetic(model: Any, data: Any) -> float:
    mujoco.mj_forward(model, data)
    momentum = np.zeros(model.nv)
    mujoco.mj_mulM(model, data, momentum, data.qvel)
    return 0.5 * float(momentum @ data.qvel)


def judge(rows: Sequence[Row]) -> list[Row]:
    """No part out, and no upward speed that the reference does not have."""
    own = table_rows(rows, "handling")
    out = []
    for row in own:
        if row["method"] != "guarded":
            continue
        key = (row["scene"], row["cone"], "reference")
        same = [r for r in own if (r["scene"], r["cone"], r["method"]) == key]
        name = f"{row['scene']}, {row['cone']}"
        out.append(answer(f"{name}: parts out", "0", str(row["out"]), not row["out"]))
        for fine in same:
            met = row["up"] <= fine["up"]
            text = f"{row['up']:.3g}"
            out.append(answer(f"{name}: upward speed", f"<= {fine['up']:.3g} m/s", text, met))
    return out
