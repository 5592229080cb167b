"""Adapters for Stable-Baselines3 (extra ``learn``), from :mod:`tauguard.envs.adapters`."""

from tauguard.envs.adapters.stable_baselines import NativeVecEnv

__all__ = ["NativeVecEnv"]
