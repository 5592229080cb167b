"""TwoArms-v1: two arms over one table, whose workspaces overlap."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from tauguard.arrays import Array
from tauguard.envs.gym.base import ArmEnv
from tauguard.envs.gym.placing import Layout
from tauguard.envs.gym.reach import CarefulReach
from tauguard.envs.gym.second_arm import APART
from tauguard.envs.gym.vector import VectorArmEnv
from tauguard.models import Person, Scene, Table

#: Distance of a person from the line between the arms [reach].
BESIDE = 0.75
#: Largest distance of the first target from the middle between the arms [m].
MIDDLE = 0.15
#: Range of the distance between the two targets [m].
GAP = (0.15, 0.35)
#: The table between the arms, below their workspace.
BOARD = Table(position=(0.55, 0.0, 0.05), half_extents=(0.3, 0.6, 0.02))


class TwoArms(CarefulReach):
    """Both targets are close to each other in the middle between the arms."""

    arms: ClassVar[int] = 2
    defaults: ClassVar[dict[str, Any]] = {"obstacles": (), "table": BOARD}

    @classmethod
    def person(cls, bare: Scene, layout: Layout) -> Person:
        """A person beside the table who looks at it."""
        middle, beside = layout.apart(APART) / 2, max(BESIDE * layout.reach, 0.6)
        return layout.someone(middle, -beside, np.pi / 2)

    def suits(self, i: int, arm: int, place: Array) -> bool:
        """Whether the place is midway between the arms (arm 0) or near arm 0's target (arm 1)."""
        layout = self.batch.compiled.layout
        if arm == 0:
            middle = layout.apart(APART) / 2
            return abs(layout.ahead(place)[0] - middle) < MIDDLE * layout.scale
        gap = float(np.linalg.norm(place - self.batch.target[i, 0]))
        return GAP[0] * layout.scale < gap < GAP[1] * layout.scale


class TwoArmsEnv(ArmEnv):
    """Bring two tools to two places 15 to 35 cm apart, without the arms touching.

    Arms that go straight to their targets collide.

    A second, nominal arm of the same kind stands opposite, 1.1 m away. Joints and actions of the
    first arm come first. ``info["force"]`` and ``tau_ext`` include contacts with the other arm, the
    table and everything that ``obstacles`` adds. The numbers of the second arm's links follow
    those of the first.

    ## Actions (joint velocity, the default; 2 n joints)

    | index | name | range | meaning of 1 |
    |---|---|---|---|
    | 0 .. n-1 | velocity of joint i of the first arm | -1 to 1 | its largest speed [rad/s] |
    | n .. 2n-1 | velocity of joint i of the second arm | -1 to 1 | its largest speed [rad/s] |

    The other control modes are the same as in Reach-v0, first for one arm, then for the other
    ("cartesian": 6 numbers per arm).

    ## Observations (6 n + 12 numbers)

    | index | name | range | unit |
    |---|---|---|---|
    | 0 .. 2n-1 | positions of the joints | their ranges and 0.5 beyond | rad |
    | 2n .. 4n-1 | velocities of the joints | -100 to 100 | rad/s |
    | 4n .. 6n-1 | motor torques, nominal gain times current | 1.5 times limit | N m |
    | 6n .. 6n+5 | positions of both tools | -100 to 100 | m |
    | 6n+6 .. 6n+11 | targets less tools | -100 to 100 | m |

    ## Reward

    | term | value |
    |---|---|
    | progress | decrease of the larger of both distances [m] |
    | target | 1 when both tools are within 3 cm; then the next targets appear |
    | contact | -1 per second at 100 N or more on a link; proportional below 100 N |
    """

    task_type = TwoArms


class TwoArmsVectorEnv(VectorArmEnv):
    """Several copies of TwoArms-v1; see :class:`TwoArmsEnv`."""

    task_type = TwoArms
