"""ClothReach-v1: reach targets on both sides of a hanging cloth."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from tauguard.arrays import Array
from tauguard.envs.gym.base import ArmEnv
from tauguard.envs.gym.compiled import tool_position
from tauguard.envs.gym.reach import CarefulReach
from tauguard.envs.gym.vector import VectorArmEnv
from tauguard.models import Cloth

#: A sheet of 8 x 8 vertices that hangs across the workspace, held along its upper edge.
SHEET = Cloth(count=8, size=0.5, mass=0.1, position=(0.55, 0.0, 0.55))

#: Least distance of a target of ClothReach-v1 from the sheet [m].
ASIDE = 0.12


class ClothReach(CarefulReach):
    """Targets alternate between the two sides of the sheet.

    The straight path from the tool to each target goes through the sheet.
    """

    defaults: ClassVar[dict[str, Any]] = {"obstacles": (), "cloth": SHEET}

    def suits(self, i: int, arm: int, place: Array) -> bool:
        """Whether the place is beyond the sheet as seen from the tool, and within its width."""
        compiled = self.batch.compiled
        sheet = compiled.scene.spec.cloth
        if sheet is None:
            return True
        layout = compiled.layout
        x, y = layout.ahead(np.array(sheet.position))
        there, left = layout.ahead(place)
        here, _ = layout.ahead(tool_position(compiled, self.batch.datas[i], arm))
        beyond = (there - x) * (here - x) < 0 and abs(there - x) > min(1.0, layout.scale) * ASIDE
        return beyond and abs(left - y) < sheet.size / 2


class ClothReachEnv(ArmEnv):
    """Go round a hanging cloth to targets on its other side.

    Each target lies beyond the sheet as seen from the tool, so that the straight path to it goes
    through the cloth. Actions are the same as in Reach-v0. There is no person unless ``obstacles``
    adds one. MuJoCo simulates the cloth; ``cloth=`` replaces it by another
    :class:`tauguard.models.Cloth`. ``checkers=("rigid",)``, or other names of
    :func:`tauguard.contacts.registered`, checks every physics step for contacts:
    ``info["contacts"]`` is the number of pairs that each checker reported. A fast tool can pass
    through the sheet, because contacts of thin bodies are soft. To find out, compare a checker's
    count with ``info["force"]``.

    ## Observations (n joints; 3 n + 6 numbers, then the body regions as in Reach-v0)

    | index | name | range | unit |
    |---|---|---|---|
    | 0 .. n-1 | position of joint i | its range and 0.5 beyond | rad |
    | n .. 2n-1 | velocity of joint i | -100 to 100 | rad/s |
    | 2n .. 3n-1 | motor torque of joint i, nominal gain times current | 1.5 times limit | N m |
    | 3n .. 3n+2 | position of the tool | -100 to 100 | m |
    | 3n+3 .. 3n+5 | target less tool | -100 to 100 | m |

    ## Reward

    | term | value |
    |---|---|
    | progress | how much nearer the tool came [m] |
    | target | 1 within 3 cm of the target, which is then replaced by the next |
    | contact | -1 per second at 100 N or more on a link; proportional below 100 N |
    """

    task_type = ClothReach


class ClothReachVectorEnv(VectorArmEnv):
    """Several copies of ClothReach-v1; see :class:`ClothReachEnv`."""

    task_type = ClothReach
