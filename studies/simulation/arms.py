"""Any arm: what is simulated well of arms that nothing was developed on."""

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
#: A blow's peak torque [N m], at most these shares of the strongest joint's limit; links to try.
BLOW, BLOW_SHARE, LINKS = (15.0, 60.0), (0.1, 0.4), (4, 3, 5, 2)
#: Operational space control: integral [1/s^3] and seconds, without and with friction.
IDEAL_HOLD, HOLD = (0.0, 3.0), (1500.0, 5.0)
#: Actions an episode of random actions.
ACTIONS = 100
#: Where a user keeps robot files of the list, as NAME/NAME.urdf.
DATA = "TAUGUARD_DATA"

#: What the columns mean.
NOTES = {
    "arms": "compile: processor seconds of one environment. servo: largest rms speed error of any "
    "joint over a random motion at 20, 50 and 100 % of the largest speed, as a share of it. "
    "residual: the plain observer's largest, of any joint, as a share of its torque limit, without "
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
        robot: names or files, parted by commas, instead of :data:`ARMS`.
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
    left.set_ylabel("rms speed error, share of the largest speed")
    right.set_ylabel("largest residual, share of the torque limit")
    left.legend()
    for axes in (left, right):
        axes.set_xticks(at, [Path(str(row["arm"])).stem for row in known], rotation=45)


def _row(name: str, quick: bool, seed: int) -> Row:
    row: Row = {"study": "arms", "arm": Path(name).stem if os.path.isfile(name) else name}
    source = _at_hand(name)
    began = time.process_time()
    try:
        compiled = compile_scene(Settings(robot=source, obstacles=("hand",), detector="observer"))
    except (FileNotFoundError, ValueError) as error:
        return row | {"note": str(error).split(";")[0]}
    row |= {"joints": len(compiled.scene.joint_names), "compile [s]": time.process_time() - began}
    seconds = 6.0 if quick else 30.0
    for speed in SPEEDS:
        row[f"servo {speed:g} %"] = _servo_error(source, speed, seconds, seed)
    return (
        row
        | _free(compiled, source, seconds, seed)
        | _random(source, quick, seed)
        | _tool(compiled, source)
        | _strike(compiled, source, seed)
    )


def _at_hand(name: str) -> str:
    file = Path(os.environ.get(DATA, ""), name, f"{name}.urdf")
    return str(file) if DATA in os.environ and file.is_file() else name


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
    share = np.abs(residuals) / compiled.torque_limit
    moving = np.where(np.abs(trace.qd) > MOVING, share, 0.0)
    return {"residual moving": float(moving.max()), "residual": float(share.max())}


def _random(source: str, quick: bool, seed: int) -> Row:
    """Random episodes in every control mode: divergences, alarms, and Gymnasium's own check."""
    copies, rounds = (4, 1) if quick else (20, 10)
    diverged = alarms = episodes = 0
    for control in CONTROLS:
        envs: Any = gymnasium.make_vec(
            "tauguard/Reach-v0",
            num_envs=copies,
            robot=source,
            control=control,
            obstacles=(),
            detector="observer",
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


def _tool(compiled: CompiledScene, source: str) -> Row:
    if len(compiled.scene.joint_names) < 6:
        return {"tool, ideal [mm]": None, "tool [mm]": None}
    return {
        "tool, ideal [mm]": tool_error(source, True, *IDEAL_HOLD),
        "tool [mm]": tool_error(source, False, *HOLD),
    }


def _strike(compiled: CompiledScene, source: str, seed: int) -> Row:
    """One blow, scaled by the arm's torque, against the fourth link or the next that has a surface.

    A link may lie wholly within another's shape: the Z1's fourth does.
    """
    limits = compiled.torque_limit[:4][np.isfinite(compiled.torque_limit[:4])]
    low, high = (
        min(b, s * max(limits, default=np.inf)) for b, s in zip(BLOW, BLOW_SHARE, strict=True)
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
