"""The errors of a detector: recordings of ten seconds, and a page that opens them."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tauguard.findings import ArgumentError

if TYPE_CHECKING:
    from tauguard.arrays import Array
    from tauguard.detectors import CollisionAlarm, Matching
    from tauguard.traces import Alarm, Collision, Detection, Trace

#: Time of a recording before its event, and its length [s].
BEFORE, LENGTH = 0.5, 10.0
#: At most this many recordings are written for each kind of event.
MOST = 100
KINDS = ("missed", "late", "false alarm")
#: The names of the recordings.
OWN = re.compile(r"(missed|late|false-alarm)-\d+\.(rrd|png)")


def command_to_open(folder: Path) -> str:
    """The command that shows the page of a folder of recordings."""
    return f"tauguard replay --web {shlex.quote(str(folder))}"


@dataclass(frozen=True)
class Event:
    """One error of a detector: a missed or late collision, or a false alarm."""

    kind: str  #: one of :data:`KINDS`
    at: float  #: onset of the collision, or start of the alarm [s]
    span: tuple[float, float]  #: window of its detection, or span of the false alarm [s]
    collision: Collision | None = None  #: None: a false alarm
    delay: float | None = None  #: [s]
    note: str = ""  #: further information

    @property
    def text(self) -> str:
        """The event in one line."""
        one = self.collision
        if one is None:
            what = f"False alarm at {self.at:.2f} s"
        else:
            found = "missed" if self.delay is None else f"found after {1e3 * self.delay:.0f} ms"
            where = f"{one.kind} on link {one.link} at {self.at:.2f} s"
            what = f"{where}, {one.peak_tau:.1f} N m: {found}"
        return what[0].upper() + what[1:] + (f" ({self.note})" if self.note else "")


def events_of(matching: Matching, late: float) -> Iterator[Event]:
    """Missed collisions, those found later than ``late`` [s], and false alarms, in this order."""
    from tauguard.detectors.events import detection_window

    pairs = list(zip(matching.collisions, matching.delays, strict=True))
    for wanted in ("missed", "late"):
        for c, delay in pairs:
            kind = "missed" if delay is None else "late" if delay > late else ""
            if kind == wanted:
                up = [alarm for alarm in matching.false_alarms if _covers(alarm, c)]
                note = f"an alarm was up from {_before(up[0], c)} s on" if up else ""
                yield Event(kind, c.onset, detection_window(c), c, delay, note)
    for alarm in matching.false_alarms:
        hit = [c for c in matching.collisions if _covers(alarm, c)]
        note = f"still up at the {hit[0].kind} of {hit[0].onset:.2f} s" if hit else ""
        yield Event("false alarm", alarm.start, (alarm.start, alarm.end), note=note)


def _before(alarm: Alarm, collision: Collision) -> str:
    """The alarm's start [s] as text, with enough digits that it reads earlier than the contact."""
    text = f"{alarm.start:.2f}"
    return text if text != f"{collision.onset:.2f}" else f"{alarm.start:.3f}"


def _covers(alarm: Alarm, collision: Collision) -> bool:
    """Whether the alarm was already on when the contact began; it then detects nothing."""
    return alarm.start < collision.onset <= alarm.end


class EventFolder:
    """Writes a recording and a picture of each event, and at the end the page."""

    def __init__(self, folder: Path, late: float, alarm: CollisionAlarm | None = None) -> None:
        """Make the folder.

        Args:
            folder: new, or a folder that this class has written before.
            late: a detection with a longer delay is an event [s].
            alarm: the detector, for its confirmation time (default: a confirmation time of 0).

        Raises:
            ArgumentError: the folder contains other files.
        """
        if folder.exists() and (not folder.is_dir() or not all(map(_own, folder.iterdir()))):
            raise ArgumentError(f"{folder}: holds other files; give `events=` a new folder")
        folder.mkdir(parents=True, exist_ok=True)
        for old in filter(_own, folder.iterdir()):
            old.unlink()
        self._folder, self._late, self._alarm = folder, late, alarm
        self._rows: list[dict[str, Any]] = []
        self._found = dict.fromkeys(KINDS, 0)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row for every recording: its event, and its name as ``file``."""
        return self._rows

    @property
    def counts(self) -> str:
        """The number of events of each kind, as text."""
        many = {"false alarm": "false alarms"}
        return ", ".join(
            f"{count} {kind if count == 1 else many.get(kind, kind)}"
            for kind, count in self._found.items()
        )

    def add(self, name: str, matching: Matching, of: tuple[Trace, Detection]) -> None:
        """Add the events of one recording, which ``name`` identifies for a reader."""
        from tauguard.replay.event_page import row_of

        trace, detection = of
        held = self._held(trace, detection)
        for event in events_of(matching, self._late):
            self._found[event.kind] += 1
            if self._found[event.kind] <= MOST:
                stem = f"{event.kind.replace(' ', '-')}-{self._found[event.kind]:03d}"
                row = {"file": f"{stem}.rrd", "recording": name}
                row |= row_of(event, trace, detection.threshold, held)
                self._write(event, row, of)
                self._rows.append(row)

    def _held(self, trace: Trace, detection: Detection) -> Array:
        """The lowest score of the last confirmation time at each sample, shape (T,)."""
        from tauguard.detectors.events import confirmation_samples, sustained

        if self._alarm is None:
            return detection.score
        return sustained(detection.score, confirmation_samples(self._alarm.confirmation, trace.dt))

    def _write(self, event: Event, row: dict[str, Any], of: tuple[Trace, Detection]) -> None:
        """The recording and the picture of one event."""
        from tauguard.atomic_write import atomic_file
        from tauguard.replay import plot, write_rrd
        from tauguard.replay.event_page import facts
        from tauguard.replay.story import cut

        trace, detection = of
        start = max(float(trace.t[0]), event.at - BEFORE)
        part, found = cut(trace, detection, start, start + LENGTH)
        assert found is not None
        known, file = facts(row), self._folder / row["file"]
        write_rrd(file, part, found, whole=True, about=f"{event.text}; {known}")
        figure = plot(part, found)
        figure.set_layout_engine(None)  # the constrained layout takes longer than the drawing
        height = figure.get_figheight()
        inside = {"bottom": 0.5 / height, "top": 1 - 0.65 / height}
        figure.subplots_adjust(left=0.09, right=0.985, hspace=0.1, **inside)
        title = f"{event.text}\n{known}"
        figure.suptitle(title, y=1 - 0.1 / height, parse_math=False)  # names may have dollar signs
        with atomic_file(file.with_suffix(".png")) as stream:
            figure.savefig(stream, dpi=80, format="png")

    def finish(self) -> Path:
        """Write the page; returns its path."""
        from tauguard.atomic_write import write_atomic
        from tauguard.replay.event_page import OFFLINE, definitions, events_html
        from tauguard.report.page import page

        opens = escape(command_to_open(self._folder))
        how = (
            f"<p>{self.counts}. Each file shows up to {LENGTH:.0f} s of a recording, from "
            f"{BEFORE} s before the event on; at most {MOST} of a kind are kept. The links open "
            f"the files in the browser while <code>{opens}</code> runs; "
            "<code>rerun FILE</code> opens one without.</p>"
            + definitions(self._late, self._alarm)
            + OFFLINE
        )
        sections = {
            kind.capitalize(): events_html([r for r in self._rows if r["kind"] == kind])
            for kind in KINDS
        }
        path = self._folder / "index.html"
        text = page("What the detector got wrong", {"How to read": how, **sections})
        write_atomic(path, text)
        return path


def _own(path: Path) -> bool:
    """Whether this class writes files of that name."""
    return path.name == "index.html" or bool(OWN.fullmatch(path.name))
