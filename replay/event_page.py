"""The page of wrong detections: a row and a picture of each, and definitions."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

if TYPE_CHECKING:
    from tauguard.arrays import Array
    from tauguard.detectors import CollisionAlarm
    from tauguard.replay.events import Event
    from tauguard.traces import Trace

#: A script that turns the links into plain text when `tauguard replay --web` does not serve the
#: page.
OFFLINE = (
    "<script>if (location.protocol === 'file:') "
    "document.querySelectorAll('a[href^=\"open/\"]')"
    ".forEach(a => a.replaceWith(a.textContent))</script>"
)


def row_of(event: Event, trace: Trace, threshold: float, held: Array) -> dict[str, Any]:
    """The columns of the page for one event; unknown values are empty.

    Args:
        event: of this trace.
        trace: with truth.
        threshold: threshold of the score.
        held: lowest score of the last confirmation time at each sample, shape (T,).
    """
    import numpy as np

    first, last = np.searchsorted(trace.t, [event.span[0] - 1e-9, event.span[1] + 1e-9])
    scores = held[first : max(last, first + 1)]
    hit = event.collision
    load = None if trace.truth is None else float(trace.truth.payload[min(first, len(trace.t) - 1)])
    return {
        "kind": event.kind,
        "at [s]": f"{event.at:.2f}",
        "collision": hit.kind if hit else "",
        "link": hit.link if hit else "",
        "peak torque [N m]": round(hit.peak_tau, 1) if hit else "",
        "delay [ms]": "" if event.delay is None else round(1e3 * event.delay),
        "largest score": float(f"{scores.max():.3g}") if np.isfinite(scores).any() else "",
        "threshold": float(f"{threshold:.3g}"),
        "speed [%]": _planned_speed(trace),
        "payload [g]": "" if load is None else round(1e3 * load),
        "note": event.note,
    }


def _planned_speed(trace: Trace) -> float | str:
    """Planned speed in percent of the joints' largest speeds, if the recording states it."""
    try:
        given = trace.meta.get("speed") or json.loads(trace.attachments["episode.json"])["speed"]
        return round(float(given), 1)
    except (KeyError, TypeError, ValueError):
        return ""


def facts(row: Mapping[str, Any]) -> str:
    """The recording of a row, the planned speed of the arm, and its load."""
    known = (("speed", "%"), ("payload", "g"))
    pairs = [(what, row[f"{what} [{unit}]"], unit) for what, unit in known]
    found = [f"{what} {value:g} {unit}" for what, value, unit in pairs if value != ""]
    return ", ".join([f"recording {row['recording']}", *found])


def events_html(rows: Sequence[Mapping[str, Any]]) -> str:
    """A table of the rows of one kind, with a picture of each below."""
    from tauguard.report.page import Link, tables

    if not rows:
        return "<p>None.</p>"
    used = [key for key in rows[0] if key != "kind" and any(row[key] != "" for row in rows)]
    shown = [
        {key: Link(_open(row), str(row[key])) if key == "file" else row[key] for key in used}
        for row in rows
    ]
    return tables(shown, {}) + "".join(map(_figure, rows))


def _open(row: Mapping[str, Any]) -> str:
    return f"open/{quote(str(row['file']))}"


def _figure(row: Mapping[str, Any]) -> str:
    stem = str(row["file"]).removesuffix(".rrd")
    text = f"{stem}: position, current, torque, score and threshold"
    return (
        f'<figure><img loading="lazy" alt="{escape(text)}" src="{quote(stem)}.png">'
        f'<figcaption><a href="{escape(_open(row))}">{escape(str(row["file"]))}</a></figcaption>'
        "</figure>"
    )


def definitions(late: float, alarm: CollisionAlarm | None = None) -> str:
    """Definitions of the page's terms, as an HTML table.

    Args:
        late: a collision found later than this is late [s].
        alarm: the detector; its times are then part of the definitions.
    """
    from tauguard.detectors.events import ALARM_GAP, MERGE_GAP, WINDOW

    begin, time = "beginning", "confirmation time"
    if alarm is not None:
        begin, time = f"first {alarm.settle:.3g} s", f"last {1e3 * alarm.confirmation:.3g} ms"
    text = files("tauguard.replay").joinpath("event_terms.html").read_text("utf-8")
    ms = f"{1e3 * late:.0f} ms"
    return text.format(
        gap=MERGE_GAP, apart=ALARM_GAP, window=WINDOW, late=ms, begin=begin, time=time
    )
