"""Reported contacts as MCAP messages; each checker has a topic ``/contacts/NAME``."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tauguard.traces.contacts import CheckedContacts
from tauguard.traces.mcap_cdr import Anything, Layout
from tauguard.traces.mcap_container import Group, Topic
from tauguard.traces.mcap_time import nanoseconds, stamp

COLUMNS = ("point", "normal", "distance")


def topic_name(checker: str) -> str:
    """The topic of a checker's contacts."""
    return f"/contacts/{checker}"


def describe(contacts: Sequence[CheckedContacts]) -> list[dict[str, Any]]:
    """Metadata from which the reader derives the layouts of the messages.

    Raises:
        ValueError: a checker has two entries.
    """
    names = [one.checker for one in contacts]
    if len(set(names)) < len(names):
        raise ValueError(f"contacts: a checker twice: {', '.join(names)}")
    return [
        {"name": one.checker, "partners": list(one.partners), "rows": len(one)} for one in contacts
    ]


def layout(partners: Sequence[str]) -> Layout:
    """The layout of ``tauguard_msgs/msg/CheckedContact``."""
    contact = Layout().header().strings(list(partners)).number("time", "f8")
    contact.number("pair", "i8", 2).number("point", "f8", 3).number("normal", "f8", 3)
    return contact.number("distance", "f8")


def layouts(form: Mapping[str, Any]) -> dict[str, Layout]:
    """The layout of each checker's topic."""
    return {topic_name(one["name"]): layout(one["partners"]) for one in form.get("checkers", [])}


def group(contacts: CheckedContacts) -> Group:
    """The contacts of one checker, logged at their times."""
    values: dict[str, Anything] = stamp(contacts.t) | {"time": contacts.t, "pair": contacts.pair}
    values |= {name: getattr(contacts, name) for name in COLUMNS}
    topic = Topic(
        topic_name(contacts.checker),
        "tauguard_msgs/msg/CheckedContact",
        layout(contacts.partners),
        values,
    )
    return Group(nanoseconds(contacts.t), [topic])


def decode(form: Mapping[str, Any], tables: Mapping[str, Any]) -> tuple[CheckedContacts, ...]:
    """The contacts in the messages of a file.

    Raises:
        ValueError: messages are missing.
    """
    found = []
    for one in form.get("checkers", []):
        topic = topic_name(one["name"])
        table = tables[topic]
        if len(table["time"]) != one["rows"]:
            raise ValueError(
                f"{topic}: {len(table['time'])} messages, expected {one['rows']}: "
                "some were filtered out"
            )
        columns = {name: np.asarray(table[name]) for name in COLUMNS}
        found.append(
            CheckedContacts(
                checker=one["name"],
                partners=tuple(one["partners"]),
                t=table["time"],
                pair=table["pair"],
                **columns,
            )
        )
    return tuple(found)
