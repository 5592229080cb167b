"""The arm and the environments for users of dm_control; see :mod:`tauguard.envs.adapters.dm`."""

from tauguard.envs.adapters.dm import ArmEntity, DmEnvironment

__all__ = ["ArmEntity", "DmEnvironment"]
