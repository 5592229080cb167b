"""Any arm: servo, residual, divergences, false alarms and a collision, arm by arm."""

from __future__ import annotations

import os
import time
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium.utils.env_checker import check_env
from numpy.typing import NDArray

from oracles.tool_error import tool_error
from tauguard.arrays import Array
from tauguard.envs import CollisionPlan, Episode, Simulation
from tauguard.envs.gym.compiled import CompiledScene, compile_scene
from tauguard.envs.gym.sensing import listening
from tauguard.envs.gym.settings import CONTROLS, Settings
from tauguard.report import Row
from tauguard.traces import Trace

if TYPE_CHECKING:
    from matplotlib.figure import Figure


#: Arms that are asked for without `--robot`; a file of the data folder stands for the UR10e.
ARMS = ("cura6", "ur3", "ur5", "ur10", "ur10e", "panda", "xarm7", "z1", "j2s6s200", "so100")
#: Percent of the largest joint speed that the servo is tried at.
SPEEDS = (20.0, 50.0, 100.0)
#: A joint moves above this speed [rad/s]: below it static friction hides what it may.
MOVING = 0.1
#: Peak torque of the collision [N m], at most these fractions of the strongest joint's limit.
PEAK, FRACTION = (15.0, 60.0), (0.1, 0.4)
#: Links that the collision is tried on, in this order.
LINKS = (4, 3, 5, 2)
#: Operational space control: integral [1/s^3] and seconds, without and with friction.
IDEAL_HOLD, HOLD = (0.0, 3.0), (1500.0, 5.0)
#: Actions an episode of random actions.
ACTIONS = 100
#: Where a user keeps robot files of the list, as NAME/NAME.urdf.
DATA = "TAUGUARD_DATA"

#: What the columns mean.
NOTES = {
    "arms": "compile: processor seconds of one environment. servo: largest rms speed error of any "
    "joint over a random motion at 20, 50 and 100 % of the largest speed, as a fraction of it. "
    "residual: the plain observer's largest of any joint over its torque limit, without "
    "contact: while the joint moves, and at all (static friction of the file is in it). diverged: "
    "of random episodes in all five control modes. alarms: without contact, in the seconds named. "
    "tool: how far operational space control leaves the tool from its goal, on ideal drives and on "
    "those of the arm (six joints or more). strike: delay of the alarm of the plain observer [s].",
}


def measure(quick: bool, seed: int, robot: str = "") -> list[Row]:
    """A row an arm; arms whose model is not at hand have a row that says so.

    Args:
        quick: fewer arms and episodes.
        seed: of motions and actions.
        robot: names or files, separated by commas, instead of :data:`ARMS`.
    """
    wanted = [name.strip() for name in robot.split(",")] if robot else list(ARMS)
    if quick and not robot:
        wanted = wanted[:3]
    return [_row(name, quick, seed) for name in wanted]


def draw(rows: list[Row], figure: Figure) -> None:
    """Servo error and residual, an arm a group."""
    known = [row for row in rows if "servo 20 %" in row]
    left, right = figure.subplots(1, 2)
    at = np.arange(len(known))
    for k, speed in enumerate(SPEEDS):
        values = [row[f"servo {speed:g} %"] for row in known]
        left.bar(at + 0.27 * (k - 1), values, 0.25, label=f"{speed:g} % of the speed")
    right.bar(at, [row["residual moving"] for row in known], 0.5)
    right.axhline(0.02, color="black", linewidth=0.8)
    left.set_ylabel("rms speed error, fraction of the largest speed")
    right.set_ylabel("largest residual, fraction of the torque limit")
    left.legend()
    for axes in (left, right):
        axes.set_xticks(at, [Path(str(row["arm"])).stem for row in known], rotation=45)


def _row(name: str, quick: bool, seed: int) -> Row:
    row: Row = {"study": "arms", "arm": Path(name).stem if os.path.isfile(name) else name}
    own = Path(os.environ.get(DATA, ""), name, f"{name}.urdf")
    source = str(own) if DATA in os.environ and own.is_file() else name
    began = time.process_time()
    try:
        compiled = compile_scene(Settings(robot=source, obstacles=("hand",), detector="observer"))
    except (FileNotFoundError, ValueError) as error:
        return row | {"note": str(error).split(";")[0]}
    row |= {"joints": len(compiled.scene.joint_names), "compile [s]": time.process_time() - began}
    seconds = 6.0 if quick else 30.0
    for speed in SPEEDS:
        row[f"servo {speed:g} %"] = _servo_error(source, speed, seconds, seed)
    row |= _free(compiled, source, seconds, seed) | _random(source, quick, seed)
    if len(compiled.scene.joint_names) >= 6:
        row["tool, ideal [mm]"] = tool_error(source, True, *IDEAL_HOLD)
        row["tool [mm]"] = tool_error(source, False, *HOLD)
    return row | _strike(compiled, source, seed)


def _servo_error(source: str, speed: float, seconds: float, seed: int) -> float:
    simulation = Simulation(Episode(seed=seed, seconds=seconds, speed=speed, arm=source))
    trace = simulation.run()
    assert trace.qd_des is not None
    error = np.sqrt(np.mean((trace.qd - trace.qd_des) ** 2, axis=0))
    return float((error / simulation.scene.facts.max_speed).max())


def _judged(compiled: CompiledScene, trace: Trace) -> tuple[Array, NDArray[np.bool_]]:
    """Residuals [N m], (T, n), and alarms, (T,), of the plain observer along a trace."""
    make = listening(compiled, "observer")
    assert make is not None
    return make().steps(trace.q, trace.qd, trace.current)


def _free(compiled: CompiledScene, source: str, seconds: float, seed: int) -> Row:
    trace = Simulation(Episode(seed=seed + 1, seconds=seconds, speed=60.0, arm=source)).run()
    residuals, _ = _judged(compiled, trace)
    fraction = np.abs(residuals) / compiled.torque_limit
    moving = np.where(np.abs(trace.qd) > MOVING, fraction, 0.0)
    return {"residual moving": float(moving.max()), "residual": float(fraction.max())}


def _random(source: str, quick: bool, seed: int) -> Row:
    """Random episodes in every control mode: divergences, alarms, and Gymnasium's own check."""
    copies, rounds = (4, 1) if quick else (20, 10)
    diverged = alarms = episodes = 0
    for control in CONTROLS:
        options: dict[str, Any] = {"robot": source, "control": control, "detector": "observer"}
        envs: Any = gymnasium.make_vec(
            "tauguard/Reach-v0", num_envs=copies, obstacles=(), **options
        )
        rng = np.random.default_rng(seed)
        for k in range(rounds):
            envs.reset(seed=seed + copies * k)
            ended, alarmed = np.zeros((2, copies), dtype=bool)
            for _ in range(ACTIONS):
                info = envs.step(rng.uniform(-1, 1, envs.action_space.shape))[-1]
                ended |= np.array([reason.startswith("diverged") for reason in info["reason"]])
                alarmed |= info["alarm"] & ~ended
            diverged, alarms = diverged + int(ended.sum()), alarms + int(alarmed.sum())
            episodes += copies
        envs.close()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        env = gymnasium.make("tauguard/Reach-v0", robot=source).unwrapped
        check_env(env, skip_render_check=True)
    return {
        "check_env": "passes",
        "diverged": f"{diverged} of {episodes}",
        "alarms": f"{alarms} in {episodes * ACTIONS / 100:g} s",
    }


def _strike(compiled: CompiledScene, source: str, seed: int) -> Row:
    """One collision, scaled by the arm's torque, on the first of the links that has a surface."""
    limits = compiled.torque_limit[:4][np.isfinite(compiled.torque_limit[:4])]
    low, high = (
        min(p, f * max(limits, default=np.inf)) for p, f in zip(PEAK, FRACTION, strict=True)
    )
    links = [link for link in LINKS if link <= len(compiled.scene.joint_names)]
    for link in links:
        plan = CollisionPlan("strike", 2.0, link, (low, high))
        episode = Episode(seed=seed, seconds=6.0, speed=40.0, arm=source, collisions=(plan,))
        trace = Simulation(episode).run()
        found = trace.truth.collisions if trace.truth else ()
        if found:
            break
    else:
        return {"strike": "no target"}
    _, alarms = _judged(compiled, trace)
    after = np.flatnonzero(alarms & (trace.t >= found[0].onset) & (trace.t < found[0].onset + 0.5))
    return {"strike": float(trace.t[after[0]] - found[0].onset) if len(after) else "missed"}
