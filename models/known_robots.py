"""Arms by name: their model files, and numbers that no model file states, with their sources.

Numbers that a row leaves out are derived, see :mod:`tauguard.models.derive`.
"""

import importlib.util
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from tauguard.extras import extra
from tauguard.models.robot import Robot, RobotDrive

_READY = (0.0, -0.7854, 0.0, -2.3562, 0.0, 1.5708, 0.7854)
_UR_HOME = (-1.5708, -1.5708, 1.5708, -1.5708, -1.5708, 0.0)
_DEG = 0.017453292519943295
#: Arms of this package, with published numbers and simple shapes.
PUBLISHED = Path(__file__).parent / "published"


@dataclass(frozen=True)
class KnownRobot:
    """A row: a file of this package or ``example-robot-data``, or a ``mujoco-menagerie`` name."""

    robot: Robot  #: description, whose ``file`` is the arm's name
    own: str | None  #: file in :data:`PUBLISHED`
    urdf: str | None  #: path below ``robots`` of example-robot-data
    menagerie: str | None  #: name in mujoco-menagerie
    sources: Mapping[str, str]  #: source of each field that the row states


def _row(
    name: str,
    urdf: str | None,
    menagerie: str | None,
    sources: dict[str, str],
    drive: RobotDrive | None = None,
    own: str | None = None,
    **numbers: object,
) -> tuple[str, KnownRobot]:
    robot = Robot(file=name, drive=drive or RobotDrive(), **numbers)  # type: ignore[arg-type]
    return name, KnownRobot(robot, own, urdf, menagerie, MappingProxyType(sources))


_UR_SOURCE = {"home": "elbow up, tool down; the keyframe of mujoco-menagerie's UR arms"}
_UR_SIZES = {
    "torque_limit": "Universal Robots' own ROS 2 description, joint_limits.yaml",
    "max_speed": "Universal Robots' own ROS 2 description, joint_limits.yaml",
}

#: The table; ``cura6`` is described in :mod:`tauguard.models.cura6` instead.
ROBOTS: Mapping[str, KnownRobot] = MappingProxyType(
    dict(
        [
            _row(
                "ur3",
                "ur_description/urdf/ur3_robot.urdf",
                None,
                _UR_SOURCE | _UR_SIZES,
                home=_UR_HOME,
                torque_limit=(56.0, 56.0, 28.0, 12.0, 12.0, 12.0),
                max_speed=(3.1416, 3.1416, 3.1416, 6.2832, 6.2832, 6.2832),
            ),
            _row("ur5", "ur_description/urdf/ur5_robot.urdf", None, _UR_SOURCE, home=_UR_HOME),
            _row("ur10", "ur_description/urdf/ur10_robot.urdf", None, _UR_SOURCE, home=_UR_HOME),
            _row(
                "ur5e",
                None,
                None,
                _UR_SOURCE | _UR_SIZES,
                own="ur5e.xml",
                home=_UR_HOME,
                torque_limit=(150.0, 150.0, 150.0, 28.0, 28.0, 28.0),
                max_speed=3.1416,
            ),
            _row(
                "ur10e",
                None,
                "universal_robots_ur10e",
                _UR_SOURCE
                | _UR_SIZES
                | {"drive": "estimate: a UR10e's, after Mamedov et al. 2020; gear 101"},
                home=_UR_HOME,
                torque_limit=(330.0, 330.0, 150.0, 56.0, 56.0, 56.0),
                max_speed=(2.0944, 2.0944, 3.1416, 3.1416, 3.1416, 3.1416),
                drive=RobotDrive(
                    gear=101.0,
                    torque_constant=tuple(g / 101 for g in (10.0, 10.7, 8.5, 9.0, 9.5, 10.1)),
                    coulomb=(12.5, 13.3, 5.0, 2.0, 2.7, 2.3),
                    viscous=(21.3, 20.2, 10.4, 3.6, 2.5, 3.0),
                ),
            ),
            _row(
                "panda",
                None,
                None,
                {
                    "home": "Franka's ready pose",
                    "torque_limit": "libfranka's limits",
                    "max_speed": "libfranka's limits",
                    "drive": "Coulomb level: half the sigmoid's height in Gaz et al. 2019",
                },
                own="panda.xml",
                home=_READY,
                torque_limit=(87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0),
                max_speed=(2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61),
                drive=RobotDrive(coulomb=(0.273, 0.436, 0.32, 0.64, 0.42, 0.152, 0.282)),
            ),
            _row(
                "iiwa14",
                None,
                None,
                {
                    "home": "the keyframe of mujoco-menagerie",
                    "torque_limit": "estimate: KUKA's data sheet from memory, not checked",
                    "max_speed": "estimate: KUKA's data sheet from memory, not checked",
                },
                own="iiwa14.xml",
                home=(0.0, 0.7854, 0.0, -1.5708, 0.0, 0.0, 0.0),
                torque_limit=(320.0, 320.0, 176.0, 176.0, 110.0, 40.0, 40.0),
                max_speed=tuple(_DEG * s for s in (85, 85, 100, 75, 130, 135, 135)),
            ),
            _row(
                "xarm7",
                "xarm_description/urdf/xarm7.urdf",
                "ufactory_xarm7",
                {"home": "the keyframe of mujoco-menagerie"},
                home=(0.0, -0.247, 0.0, 0.909, 0.0, 1.15644, 0.0),
            ),
            _row(
                "gen3",
                None,
                "kinova_gen3",
                {
                    "home": "the keyframe of mujoco-menagerie",
                    "torque_limit": "Kinova's own gen3_macro.xacro (ros2_kortex)",
                    "max_speed": "Kinova's own gen3_macro.xacro (ros2_kortex)",
                },
                home=(0.0, 0.2618, 3.1416, -2.2689, 0.0, 0.9599, 1.5708),
                torque_limit=(39.0, 39.0, 39.0, 39.0, 9.0, 9.0, 9.0),
                max_speed=(1.3963, 1.3963, 1.3963, 1.3963, 1.2218, 1.2218, 1.2218),
            ),
            _row("z1", "z1_description/urdf/z1.urdf", "unitree_z1", {}),
            _row("j2s6s200", "kinova_description/robots/kinova.urdf", None, {}),
            _row(
                "so100",
                "so_arm_description/urdf/so100.urdf",
                None,
                {"torque_limit": "stall torque of a Feetech STS3215 at 12 V, 30 kg cm"},
                torque_limit=2.94,
            ),
        ]
    )
)


def known_names() -> tuple[str, ...]:
    """Names in the table, then those of mujoco-menagerie's arms if it is installed."""
    names = list(ROBOTS)
    if importlib.util.find_spec("mujoco_menagerie") is not None:
        import mujoco_menagerie

        names += [robot.name for robot in mujoco_menagerie.robots("arm")]
    return tuple(names)


def find_file(name: str) -> Path:
    """The model file of a named arm, from this package, example-robot-data or menagerie.

    Nothing is downloaded here: ``tauguard robot NAME --download`` does it.

    Raises:
        FileNotFoundError: no installed package has the file; the message says what to install.
    """
    row = ROBOTS.get(name)
    if row is not None and row.own is not None:
        return PUBLISHED / row.own
    urdf, menagerie = (row.urdf, row.menagerie) if row else (None, name)
    if urdf is not None:
        for root in robot_data_folders():
            if (root / "robots" / urdf).is_file():
                return root / "robots" / urdf
    if menagerie is not None:
        path = menagerie_file(menagerie)
        if path is not None:
            return path
    installs = []
    if urdf is not None:
        installs.append(f"install example-robot-data: {extra('arms')}")
    if menagerie is not None:
        installs.append(
            f"install mujoco-menagerie: {extra('arms')} and run "
            f"`tauguard robot {name} --download` once"
        )
    raise FileNotFoundError(
        f"arm {name!r}: its model is in no installed package; "
        f"{', or '.join(installs)}, or give a file"
    )


def robot_data_folders() -> list[Path]:
    """The folder of example-robot-data's models, which ``package://example-robot-data`` means."""
    inside = Path("cmeel.prefix", "share", "example-robot-data")
    found = [Path(folder) / inside for folder in sys.path if folder]
    return [folder for folder in found if folder.is_dir()]


def menagerie_file(name: str, download: bool = False) -> Path | None:
    """The MJCF file of a menagerie model, None if it was not downloaded.

    Args:
        name: name of the model in mujoco-menagerie.
        download: download the model if it is not there yet.

    Raises:
        ModuleNotFoundError: ``download`` without mujoco-menagerie.
        ValueError: no such model, or it cannot be fetched.
    """
    if not download and importlib.util.find_spec("mujoco_menagerie") is None:
        return None
    import mujoco_menagerie

    try:
        cache, robot = mujoco_menagerie.Cache(), mujoco_menagerie.get(name)
        if not (download or cache.root is not None or cache.is_cached(robot)):
            return None
        return Path(robot.xml(robot.default_model, cache))
    except mujoco_menagerie.MenagerieError as error:
        raise ValueError(f"mujoco-menagerie: {error}") from None
