"""For users of dm_control: the arm as a composer entity, and environments for ``dm_env``.

dm_control has no wheels for Python 3.13 and later; there, this package raises ``ImportError``.
"""

from tauguard.envs.adapters.dm.compatibility import repair

repair()

from tauguard.envs.adapters.dm.arm import ArmEntity  # noqa: E402  (dm_control is usable only when repaired)
from tauguard.envs.adapters.dm.environment import DmEnvironment  # noqa: E402

__all__ = ["ArmEntity", "DmEnvironment"]
