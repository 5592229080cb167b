"""For users of dm_control: the arm as a composer entity, the environments as ``dm_env`` ones.

dm_control has no wheels for Python 3.13 and later; there this package raises ``ImportError``.
"""

from tauguard.envs.dm.compatibility import repair

repair()

from tauguard.envs.dm.arm import ArmEntity  # noqa: E402  (dm_control is usable only when repaired)
from tauguard.envs.dm.environment import DmEnvironment  # noqa: E402

__all__ = ["ArmEntity", "DmEnvironment"]
