"""Datasets for offline learning (extra ``export``), from :mod:`tauguard.envs.adapters`."""

from tauguard.envs.adapters.offline import record_policy

__all__ = ["record_policy"]
