"""For Stable-Baselines3, the extra ``learn``; see :mod:`tauguard.envs.adapters`."""

from tauguard.envs.adapters.stable_baselines import NativeVecEnv

__all__ = ["NativeVecEnv"]
