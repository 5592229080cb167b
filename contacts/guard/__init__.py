"""The guarded stepper: covered partners do not pass through each other, at any timestep."""

from tauguard.contacts.guard.energy_budget import EnergyBalance
from tauguard.contacts.guard.report import Cut, StepReport
from tauguard.contacts.guard.stepper import GuardedStepper

__all__ = ["Cut", "EnergyBalance", "GuardedStepper", "StepReport"]
