"""Alarms in a log compared with contacts that a column of the log labels."""

from collections.abc import Sequence
from math import isfinite
from statistics import median
from typing import Any

from tauguard.detectors.evaluation.matching import Contact, count
from tauguard.traces import Alarm


def compare_with_labels(
    alarms: Sequence[Alarm], touched: Sequence[tuple[float, float]], begin: float, end: float
) -> dict[str, Any]:
    """Count alarms beside labelled contacts by :func:`~.matching.count`.

    Args:
        alarms: in order of time.
        touched: first and last labelled time of each contact [s], in order.
        begin: start of the detection [s]; contacts that begin before do not count.
        end: end of the log [s].

    Returns:
        JSON values: numbers of ``contacts``, ``found``, ``still_up``, ``repeats`` and
        ``false_alarms``; onsets of ``missed`` contacts [s]; ``delays`` of found ones [s]; the
        number found ``by_chance``; and ``free_seconds``, the time in which every alarm that begins
        is false [s].
    """
    contacts = [Contact(first, last, "switch") for first, last in touched]
    counted = count(alarms, contacts, (begin, end))
    delays = [delay for delay in counted.delays if isfinite(delay)]
    missed = [
        contact.onset
        for contact, delay, up in zip(
            counted.contacts, counted.delays, counted.still_up, strict=True
        )
        if not (isfinite(delay) or up)
    ]
    return {
        "contacts": len(counted.contacts),
        "found": len(delays),
        "still_up": sum(counted.still_up),
        "missed": missed,
        "delays": delays,
        "by_chance": sum(counted.by_chance),
        "repeats": len(counted.repeats),
        "false_alarms": len(counted.false_alarms),
        "free_seconds": counted.free_seconds,
    }


def labels_text(found: dict[str, Any], since: float = 0.0) -> str:
    """The results of :func:`compare_with_labels` as text; times are counted from ``since`` [s]."""
    delays = found["delays"]
    when = (
        f" ({1e3 * median(delays):.0f} ms after the onset in the median, at most "
        f"{1e3 * max(delays):.0f} ms)"
        if delays
        else ""
    )
    total = found["contacts"]
    text = f"labels: {total} contact{'' if total == 1 else 's'}, {found['found']} found{when}"
    if found["still_up"]:
        text += f", {found['still_up']} began during an earlier alarm (not found)"
    missed = [f"{onset - since:.2f}" for onset in found["missed"]]
    text += f", {len(missed)} missed"
    if missed:
        text += f" (at {', '.join(missed[:8])}{', ...' if len(missed) > 8 else ''} s)"
    count = found["false_alarms"]
    alarms = f"{count} false alarm{'' if count == 1 else 's'}"
    return f"{text}; {alarms} in the {found['free_seconds']:.1f} s without contact"
