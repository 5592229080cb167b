"""What one guarded step did."""

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
    """``geom 'cup'``, ``flex 'sheet'``; by its number where it has no name."""
    kind, number = partner
    if kind == "geom":
        return f"geom {geom_name(model, number)}"
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX, number)
    return f"flex {name!r}" if name else f"flex {number}"


@dataclass(frozen=True)
class Cut:
    """One sub-step that was rolled back."""

    time: float  #: at which the next attempt ends [s]
    pair: Pair  #: that would have passed through, become too deep, or separated unseen
    stiffened: bool  #: its contact parameters were changed, until the pair parts


@dataclass(frozen=True)
class StepReport:
    """The report of one guarded step; ``guard.partners(pair)`` gives the names of a pair."""

    steps: int  #: calls of ``mj_step``, including those that were rolled back
    contacts: int  #: contacts that MuJoCo listed, the most in any accepted sub-step
    cuts: tuple[Cut, ...] = ()
    restored: tuple[Pair, ...] = ()  #: pairs whose contact parameters are as before again
    passed: tuple[Pair, ...] = ()  #: pairs that may have passed through: the work ran out
    impact_zones: tuple[Pair, ...] = ()  #: pairs that moved rigidly together
    energy_added: float = 0.0  #: by constraint forces in sub-steps, losses left out [J]
    _balance: Callable[[], EnergyBalance] | None = field(default=None, repr=False, compare=False)

    @property
    def exhausted(self) -> bool:
        """Whether the work ran out: a pair may have passed through (:attr:`passed` names it)."""
        return bool(self.passed)

    @cached_property
    def balance(self) -> EnergyBalance | None:
        """Energy and momentum before and after; ``None`` if the plain step was accepted."""
        return None if self._balance is None else self._balance()
