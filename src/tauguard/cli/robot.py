"""``tauguard robot``: the parameters of an arm, each with its source."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from tauguard.findings import ArgumentError

if TYPE_CHECKING:
    from tauguard.envs import Gains
    from tauguard.models import Facts


def command(
    robot: Annotated[str | None, tyro.conf.Positional] = None,
    /,
    arm_joints: str | None = None,
    download: bool = False,
    json: Path | None = None,
    try_: Annotated[bool, tyro.conf.arg(name="try")] = False,
    episodes: int = 10,
    seed: int = 0,
    pictures: Path | None = None,
) -> None:
    """Print the parameters with which tauguard simulates an arm; without ROBOT, all named arms.

    Args:
        robot: a name, an MJCF or URDF file, or a TOML file that describes a robot.
        arm_joints: for a file with several chains, the arm's joints: names separated by commas, or
            FIRST..LAST.
        download: download a missing model through mujoco-menagerie.
        json: write the description as JSON.
        try_: run episodes of every environment with the arm, and print initial contacts, the
            largest force and its bound, divergences, and tasks in which an arm at rest succeeds.
            The exit code is 1 if something is wrong.
        episodes: with --try, number of episodes of each environment.
        seed: with --try, seed of the first episode.
        pictures: with --try, write a PNG of the start of an episode in each environment.
    """
    from tauguard.cli import expect
    from tauguard.envs import Gains
    from tauguard.models import SceneSpec, compose, download_arm, largest_force, named_arms
    from tauguard.report import write_json

    if robot is None:
        print(*(f"{name:<14} {source}" for name, source in named_arms().items()), sep="\n")
        print("or an MJCF or URDF file, a TOML file, any arm of mujoco-menagerie by its name")
        return
    expect("--episodes", episodes, 1)
    expect("--seed", seed, 0)
    if download:
        download_arm(robot)
    robot = robot if arm_joints is None else f"{robot}#{arm_joints}"
    scene = compose(SceneSpec(arm=robot), visuals=False)
    gains = Gains.for_scene(scene)
    rows = table(scene.facts, gains)
    print(text(scene.facts, rows, largest_force(scene)))
    if try_ or pictures is not None:
        run_trial(robot, episodes, seed, pictures)
    if json is not None:
        sources = dict(scene.facts.sources)
        write_json(json, {"name": "robot", "robot": robot, "sources": sources, "rows": rows})


def run_trial(robot: str, episodes: int, seed: int, pictures: Path | None) -> None:
    """Run the trial and print a line for each environment.

    Raises:
        ArgumentError: ``pictures`` need OpenGL, which is missing; raised before the trial.
        SystemExit: an environment does not pass.
    """
    from tauguard.envs import first_picture, try_arm
    from tauguard.models import check_opengl
    from tauguard.report import table as text_table

    if pictures is not None:
        try:
            check_opengl()
        except RuntimeError as error:
            raise ArgumentError(f"--pictures: {error}") from None
    rows = try_arm(robot, episodes, seed)
    tried = [
        {
            "environment": row.environment,
            "episodes": row.episodes,
            "initial contacts": row.overlaps,
            "largest force [N]": round(row.force),
            "bound [N]": round(row.bound),
            "diverged": row.diverged,
            "still succeeds": row.still,
            "moved": ", ".join(f"{kind} by {far:.2f} m" for kind, far in row.moved.items()),
        }
        for row in rows
        if not row.refused
    ]
    print("\n" + text_table(tried))
    for row in rows:
        if row.refused:
            print(f"{row.environment}: refused: {row.refused}")
    if pictures is not None:
        import numpy as np
        from matplotlib.image import imsave

        shown = [first_picture(row.environment, robot) for row in rows if not row.refused]
        if shown:
            imsave(pictures, np.concatenate(shown, axis=1))
            print(f"wrote {pictures}")
    if not all(row.passed for row in rows):
        raise SystemExit(1)


def table(facts: Facts, gains: Gains) -> list[dict[str, object]]:
    """A row for each joint, as plain numbers."""
    drive, known = facts.drive, facts.nominal.friction
    return [
        {
            "joint": name,
            "home [rad]": float(facts.home[i]),
            "torque [N m]": float(drive.torque_limit[i]),
            "speed [rad/s]": float(facts.max_speed[i]),
            "gain [N m/A]": float(drive.gain[i]),
            "rotor [kg m2]": float(facts.armature[i]),
            "Coulomb [N m]": float(known.coulomb[i]) if known else 0.0,
            "viscous [N m s]": float(known.viscous[i]) if known else 0.0,
            "kp [N m/rad]": float(gains.kp[i]),
            "kd [N m s]": float(gains.kd[i]),
        }
        for i, name in enumerate(facts.joints)
    ]


def text(facts: Facts, rows: list[dict[str, object]], bound: float) -> str:
    """The table and the sources of its columns, as text."""
    from tauguard.report import table as text_table

    shown = [{key: _cell(value) for key, value in row.items()} for row in rows]
    lines = [text_table(shown), ""]
    lines.append(f"largest force on a skull of 150 N/mm stiffness: {bound:.0f} N")
    lines.append(f"tool: {facts.tool or 'origin of the last link'}")
    lines += [f"{part}: {source}" for part, source in sorted(facts.sources.items())]
    return "\n".join(lines)


def _cell(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
