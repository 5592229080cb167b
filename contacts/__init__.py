"""Plug-in contact checkers, their comparison and the guarded stepper."""

from tauguard.contacts.check_states import check_states
from tauguard.contacts.checker import (
    KINDS,
    Checker,
    Contacts,
    State,
    checker,
    geom_kinds,
    pair_kind,
    register,
    registered,
)
from tauguard.contacts.cloth_checker import ClothChecker
from tauguard.contacts.compare import compare
from tauguard.contacts.guard import Cut, EnergyBalance, GuardedStepper, StepReport
from tauguard.contacts.mujoco_checker import MujocoChecker, contacts_of
from tauguard.contacts.pairs import Pairs, flex_pairs, geom_flex_pairs, geom_pairs
from tauguard.contacts.report import Disagreement, Outcome, Report, Score
from tauguard.contacts.rigid_checker import RigidChecker
from tauguard.contacts.scenes import ContactScene

register("mujoco", MujocoChecker)
register("cloth", ClothChecker)
register("rigid", RigidChecker)

__all__ = [
    "KINDS", "Checker", "ClothChecker", "ContactScene", "Contacts", "Cut", "Disagreement",
    "EnergyBalance", "GuardedStepper", "MujocoChecker", "Outcome", "Pairs", "Report",
    "RigidChecker", "Score", "State", "StepReport", "check_states", "checker", "compare",
    "contacts_of", "flex_pairs", "geom_flex_pairs", "geom_kinds", "geom_pairs", "pair_kind",
    "register", "registered",
]  # fmt: skip
