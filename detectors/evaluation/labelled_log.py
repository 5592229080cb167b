"""Alarms in a log compared with contacts that a column of the log labels."""

from collections.abc import Sequence
from statistics import median
from typing import Any

from tauguard.traces import Alarm

#: An alarm that starts within this time after the onset of a contact detects it [s].
LATE = 0.5


def compare_with_labels(
    alarms: Sequence[Alarm], touched: Sequence[tuple[float, float]], begin: float, end: float
) -> dict[str, Any]:
    """Compare alarms with labelled contacts.

    A contact is found if an alarm begins during it, or within 0.5 s of its onset, and before the
    next contact. If an earlier alarm is still on at the onset instead, the contact counts as
    ``still_up``. Any other alarm is false.

    Args:
        alarms: in order of time.
        touched: first and last labelled time of each contact [s], in order.
        begin: start of the detection [s]; contacts that begin before do not count.
        end: end of the log [s].

    Returns:
        JSON values: numbers of ``contacts``, ``found``, ``still_up`` and ``false_alarms``; onsets
        of ``missed`` contacts [s]; ``delays`` of found ones [s]; and ``free_seconds``, the time in
        which every alarm that begins is false [s].
    """
    onsets = [a for a, _ in touched]
    windows = [
        (a, min(max(b, a + LATE), after))
        for (a, b), after in zip(touched, [*onsets, end][1:], strict=True)
    ]
    delays, missed, still_up, contacts = [], [], 0, 0
    for a, last in windows:
        if a < begin:
            continue
        contacts += 1
        own = [alarm.start - a for alarm in alarms if a <= alarm.start <= last]
        if own:
            delays.append(own[0])
        elif any(alarm.start < a <= alarm.end for alarm in alarms):
            still_up += 1
        else:
            missed.append(a)
    outside = [x for x in alarms if not any(a <= x.start <= last for a, last in windows)]
    covered = sum(last - max(a, begin) for a, last in windows if last > begin)
    return {
        "contacts": contacts,
        "found": len(delays),
        "still_up": still_up,
        "missed": missed,
        "delays": delays,
        "false_alarms": len(outside),
        "free_seconds": max(end - begin - covered, 0.0),
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
        text += f", {found['still_up']} began during an earlier alarm (not judged)"
    missed = [f"{onset - since:.2f}" for onset in found["missed"]]
    text += f", {len(missed)} missed"
    if missed:
        text += f" (at {', '.join(missed[:8])}{', ...' if len(missed) > 8 else ''} s)"
    count = found["false_alarms"]
    alarms = f"{count} false alarm{'' if count == 1 else 's'}"
    return f"{text}; {alarms} in the {found['free_seconds']:.1f} s without contact"
