"""Plug-in contact checkers, their comparison and the guarded stepper."""

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

__all__ = [
    "KINDS",
    "Checker",
    "Contacts",
    "State",
    "checker",
    "geom_kinds",
    "pair_kind",
    "register",
    "registered",
]
