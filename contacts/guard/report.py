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
    """One sub-step that was rolled back.

    Attributes:
        time: Time at which the next attempt ends [s].
        pair: Pair that passed through, got too deep, or touched without a listed contact.
    """

    time: float
    pair: Pair


@dataclass(frozen=True)
class StepReport:
    """The report of one guarded step; ``guard.partners(pair)`` returns the names of a pair.

    Attributes:
        steps: Calls of ``mj_step``, including those that were rolled back.
        contacts: Largest number of contacts that MuJoCo listed in an accepted sub-step.
        cuts: Sub-steps that were rolled back, in their order.
        passed: Pairs that may have passed through each other.
        impact_zones: Pairs that moved rigidly together in a sub-step.
        unaided: Whether the solver could not help in some sub-step, because MuJoCo has too little
            memory (``<size memory="..."/>``) for the contacts that this needs. Pairs were then
            stopped by impact zones.
        standstill: Duration for which all bodies except mocap bodies stood still, whatever forces
            act, because nothing else kept pairs from passing through or energy from rising [s].
        energy_added: Sum of the energy gains of accepted sub-steps [J]. The gain of a sub-step is
            the change of kinetic, potential and elastic energy minus the work of drives, mocap
            bodies, moving surfaces and applied forces. Sub-steps that lose energy count as 0,
            so the sum can be positive while the total energy falls: see ``balance``. It is 0 in
            a plain step, in which the guard does not act.
    """

    steps: int
    contacts: int
    cuts: tuple[Cut, ...] = ()
    passed: tuple[Pair, ...] = ()
    impact_zones: tuple[Pair, ...] = ()
    unaided: bool = False
    standstill: float = 0.0
    energy_added: float = 0.0
    _balance: Callable[[], EnergyBalance] | None = field(default=None, repr=False, compare=False)

    @property
    def exhausted(self) -> bool:
        """Whether a pair may have passed through; see :attr:`passed`."""
        return bool(self.passed)

    @cached_property
    def balance(self) -> EnergyBalance | None:
        """Energy and momentum before and after; ``None`` if the plain step was accepted."""
        return None if self._balance is None else self._balance()
