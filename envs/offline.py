"""Datasets for offline learning, the extra ``export``; see :mod:`tauguard.envs.adapters`."""

from tauguard.envs.adapters.offline import record_policy

__all__ = ["record_policy"]
