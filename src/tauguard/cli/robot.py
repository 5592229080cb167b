"""``tauguard robot``: what is known about an arm, what is derived, and the source of each."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

if TYPE_CHECKING:
    from tauguard.models import Facts


def command(
    robot: Annotated[str | None, tyro.conf.Positional] = None,
    /,
    download: bool = False,
    json: Path | None = None,
) -> None:
    """Print the description of an arm as tauguard simulates it; without a name, the names.

    Args:
        robot: a name, an MJCF or URDF file, or a TOML file that describes a robot.
        download: fetch the model by mujoco-menagerie where it has not been fetched before.
        json: write the description as JSON.
    """
    from tauguard.envs.plant import Gains
    from tauguard.models import ROBOTS, SceneSpec, compose
    from tauguard.models.arm import NAMED
    from tauguard.models.known_robots import menagerie_file
    from tauguard.report import write_json

    if robot is None:
        print(names())
        return
    if download:
        row = ROBOTS.get(robot)
        model = row.menagerie if row is not None else robot
        if robot in NAMED or model is None:
            raise ValueError(f"--download: {robot} is not in mujoco-menagerie")
        try:
            menagerie_file(model, download=True)
        except ModuleNotFoundError:
            raise ValueError(
                "--download needs mujoco-menagerie: install the extra `arms`"
            ) from None
    scene = compose(SceneSpec(arm=robot), visuals=False)
    gains = Gains.for_scene(scene)
    rows = table(scene.facts, gains)
    print(text(scene.facts, rows))
    if json is not None:
        sources = dict(scene.facts.sources)
        write_json(json, {"name": "robot", "robot": robot, "sources": sources, "rows": rows})


def names() -> str:
    """The arms that have a name, and where their models come from."""
    from tauguard.models import ROBOTS
    from tauguard.models.arm import NAMED

    lines = [f"{name:<14} part of tauguard" for name in NAMED]
    for name, row in ROBOTS.items():
        packages = [
            package
            for package, has in (
                ("example-robot-data", row.urdf),
                (f"mujoco-menagerie ({row.menagerie})", row.menagerie),
            )
            if has
        ]
        lines.append(f"{name:<14} from {' or '.join(packages)}")
    lines.append("or an MJCF or URDF file, a TOML file, any arm of mujoco-menagerie by its name")
    return "\n".join(lines)


def table(facts: Facts, gains: object) -> list[dict[str, object]]:
    """A row a joint, in plain numbers."""
    from tauguard.envs.plant import Gains

    assert isinstance(gains, Gains)
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


def text(facts: Facts, rows: list[dict[str, object]]) -> str:
    """The table and where its columns come from."""
    heads = list(rows[0])
    cells = [[_cell(row[head]) for head in heads] for row in rows]
    widths = [max(len(h), *(len(row[k]) for row in cells)) for k, h in enumerate(heads)]
    lines = ["  ".join(h.rjust(w) for h, w in zip(heads, widths, strict=True))]
    lines += ["  ".join(c.rjust(w) for c, w in zip(row, widths, strict=True)) for row in cells]
    lines.append("")
    lines.append(f"tool: {facts.tool or 'origin of the last link'}")
    lines += [f"{part}: {source}" for part, source in sorted(facts.sources.items())]
    return "\n".join(lines)


def _cell(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
