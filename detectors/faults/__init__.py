"""Faults of the samples themselves, as apart from collisions: see :mod:`.inputs`."""

from tauguard.detectors.faults.inputs import FAULTS, FaultCheck, UsualInput

__all__ = ["FAULTS", "FaultCheck", "UsualInput"]
