"""Checkers on a run that is already recorded: what they would have reported, step by step."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import mujoco
import numpy as np

from tauguard.contacts.checker import Checker, Contacts, State, checker
from tauguard.traces import CheckedContacts


def watch(
    model: Any, states: Iterable[State | None], checkers: Sequence[str | Checker]
) -> tuple[CheckedContacts, ...]:
    """What each checker sees in a sequence of states.

    Args:
        model: MjModel.
        states: in the order of time; ``None`` where something was put elsewhere, so that what lies
            between its neighbours is no motion.
        checkers: names of registered checkers, or checkers.

    Raises:
        ValueError: an unknown checker.
    """
    made = [checker(c, model) if isinstance(c, str) else c for c in checkers]
    found: list[list[Contacts]] = [[] for _ in made]
    before: State | None = None
    for state in states:
        if before is not None and state is not None:
            for own, list_ in zip(made, found, strict=True):
                contacts = own.check(before, state)
                if len(contacts):
                    times = before.time + contacts.time * (state.time - before.time)
                    list_.append(_at(contacts, times))
        before = state
    return tuple(
        _checked(model, own.name, Contacts.concatenate(list_))
        for own, list_ in zip(made, found, strict=True)
    )


def _at(contacts: Contacts, times: Any) -> Contacts:
    """The same rows with ``times`` [s], by time."""
    order = np.argsort(times, kind="stable")
    rest = (getattr(contacts, name)[order] for name in Contacts.__dataclass_fields__)
    return Contacts(times[order], *list(rest)[1:])


def _checked(model: Any, name: str, contacts: Contacts) -> CheckedContacts:
    """The rows by the names of their bodies and flexes."""
    body = np.where(contacts.geom >= 0, model.geom_bodyid[contacts.geom], -1)
    keys = np.where(body >= 0, body, model.nbody + contacts.flex)
    used, pair = np.unique(keys, return_inverse=True)
    return CheckedContacts(
        checker=name,
        partners=tuple(_name(model, int(key)) for key in used),
        t=np.maximum.accumulate(contacts.time),
        pair=pair.reshape(-1, 2).astype(np.int64),
        point=contacts.point,
        normal=contacts.normal,
        distance=contacts.distance,
    )


def _name(model: Any, key: int) -> str:
    if key < model.nbody:
        return model.body(key).name or f"body {key}"
    flex = key - model.nbody
    return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX, flex) or f"flex {flex}"
