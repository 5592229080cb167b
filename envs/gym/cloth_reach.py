"""ClothReach-v0: work past a hanging cloth."""

from __future__ import annotations

from typing import Any, ClassVar

from tauguard.envs.gym.base import ArmEnv
from tauguard.envs.gym.reach import Reach
from tauguard.envs.gym.vector import VectorArmEnv
from tauguard.models import Cloth

#: A sheet of 8 x 8 vertices that hangs across the workspace, held along its upper edge.
SHEET = Cloth(count=8, size=0.5, mass=0.1, position=(0.55, 0.0, 0.55))


class ClothReach(Reach):
    """Reach across a hanging cloth and, where asked for, contact checkers that watch it."""

    defaults: ClassVar[dict[str, Any]] = {"obstacles": (), "cloth": SHEET}


class ClothReachEnv(ArmEnv):
    """Bring the tool to places on both sides of a hanging cloth.

    Actions, reward and end are those of Reach-v0; there is no person unless ``obstacles`` says so.
    The cloth is MuJoCo's; ``cloth=`` takes another :class:`tauguard.models.Cloth` and
    ``checkers=("rigid",)`` and others from :func:`tauguard.contacts.registered` watch every physics
    step: ``info["contacts"]`` counts the pairs that each reported.

    ## Observations (n joints; 3 n + 6 numbers, then the body regions as in Reach-v0)

    | index | name | range | unit |
    |---|---|---|---|
    | 0 .. n-1 | position of joint i | its range and 0.5 beyond | rad |
    | n .. 2n-1 | velocity of joint i | -100 to 100 | rad/s |
    | 2n .. 3n-1 | motor torque of joint i, nominal gain times current | 1.5 times limit | N m |
    | 3n .. 3n+2 | position of the tool | -100 to 100 | m |
    | 3n+3 .. 3n+5 | target less tool | -100 to 100 | m |

    A fast tool can pass through the sheet (contacts of thin things are soft): compare a checker's
    count with ``info["force"]``.
    """

    task_type = ClothReach


class ClothReachVectorEnv(VectorArmEnv):
    """Many ClothReach-v0 at once; see :class:`ClothReachEnv`."""

    task_type = ClothReach
