"""The report of one guarded step."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import mujoco

from tauguard.contacts.geoms import geom_name
from tauguard.contacts.guard.energy_budget import EnergyBalance

#: A partner of a contact: ("geom", id) or ("flex", id).
Partner = tuple[str, int]
#: Both partners of a contact, sorted.
Pair = tuple[Partner, Partner]


def partner_name(model: Any, partner: Partner) -> str:
    """The partner as text, such as ``geom 'cup'`` or ``flex 3`` (without a name)."""
    kind, number = partner
    if kind == "geom":
        return f"geom {geom_name(model, number)}"
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX, number)
    return f"flex {name!r}" if name else f"flex {number}"


@dataclass(frozen=True)
class Cut:
    """One sub-step that was rolled back."""

    time: float  #: time at which the next attempt ends [s]
    pair: Pair  #: pair that passed through, got too deep, or touched without a listed contact
    stiffened: bool  #: whether the pair's contact parameters are changed until it separates


@dataclass(frozen=True)
class StepReport:
    """The report of one guarded step; ``guard.partners(pair)`` returns the names of a pair."""

    steps: int  #: calls of ``mj_step``, including those that were rolled back
    contacts: int  #: largest number of contacts that MuJoCo listed in an accepted sub-step
    cuts: tuple[Cut, ...] = ()
    restored: tuple[Pair, ...] = ()  #: pairs whose original contact parameters were restored
    passed: tuple[Pair, ...] = ()  #: pairs that may have passed through
    impact_zones: tuple[Pair, ...] = ()  #: pairs that moved rigidly together
    energy_added: float = 0.0  #: by constraint forces, summed over sub-steps that gained energy [J]
    _balance: Callable[[], EnergyBalance] | None = field(default=None, repr=False, compare=False)

    @property
    def exhausted(self) -> bool:
        """Whether a pair may have passed through; see :attr:`passed`."""
        return bool(self.passed)

    @cached_property
    def balance(self) -> EnergyBalance | None:
        """Energy and momentum before and after; ``None`` if the plain step was accepted."""
        return None if self._balance is None else self._balance()
