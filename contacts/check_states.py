"""Run checkers on a sequence of states."""

from collections.abc import Iterable, Sequence
from typing import Any

import mujoco
import numpy as np

from tauguard.arrays import Array
from tauguard.contacts.checker import Checker, Contacts, State, checker, reported
from tauguard.traces import CheckedContacts


def check_states(
    model: Any, states: Iterable[State | None], checkers: Sequence[str | Checker]
) -> tuple[CheckedContacts, ...]:
    """The contacts that each checker reports in a sequence of states.

    Args:
        model: MjModel.
        states: In order of time. ``None`` marks a jump: the states before and after it are not the
            ends of a step.
        checkers: Names of registered checkers, or checkers.

    Raises:
        ValueError: an unknown checker.
    """
    made = [checker(c, model) if isinstance(c, str) else c for c in checkers]
    found: list[list[Contacts]] = [[] for _ in made]
    times: list[list[Array]] = [[np.empty(0)] for _ in made]
    before: State | None = None
    for state in states:
        if before is not None and state is not None:
            for k, own in enumerate(made):
                contacts = reported(own, before, state)
                times[k].append(before.time + contacts.time * (state.time - before.time))
                found[k].append(contacts)
        before = state
    return tuple(
        _checked(model, own.name, Contacts.concatenate(found[k]), np.concatenate(times[k]))
        for k, own in enumerate(made)
    )


def _checked(model: Any, name: str, contacts: Contacts, times: Array) -> CheckedContacts:
    """The contacts of one checker sorted by time, with named partners: bodies and flexes."""
    order = np.argsort(times, kind="stable")
    contacts, times = contacts.where(order), times[order]
    body = np.where(contacts.geom >= 0, model.geom_bodyid[contacts.geom], -1)
    keys = np.where(body >= 0, body, model.nbody + contacts.flex)
    used, pair = np.unique(keys, return_inverse=True)
    return CheckedContacts(
        checker=name,
        partners=tuple(_name(model, int(key)) for key in used),
        t=times,
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
