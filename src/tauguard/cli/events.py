"""What a detector got wrong, as recordings of ten seconds and a page that opens them."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tauguard.detectors import Matching
    from tauguard.traces import Alarm, Collision, Detection, Trace

#: A recording begins this long before its event and lasts this long [s].
BEFORE, LENGTH = 0.5, 10.0
#: Recordings written of one kind of event, at most.
MOST = 100
KINDS = ("missed", "late", "false alarm")
#: The names of the recordings.
OWN = re.compile(r"(missed|late|false-alarm)-\d+\.rrd")


def command_to_open(folder: Path) -> str:
    """What to type to see the page of a folder of recordings."""
    return f"tauguard replay --web {shlex.quote(str(folder))}"


@dataclass(frozen=True)
class Event:
    """One thing that a detector got wrong."""

    kind: str  #: one of :data:`KINDS`
    at: float  #: onset of the collision, or start of the alarm [s]
    collision: str = ""  #: its kind
    link: int | None = None
    peak_torque: float | None = None  #: [N m]
    delay: float | None = None  #: [s]
    note: str = ""  #: what else is worth knowing

    @property
    def text(self) -> str:
        """All of it in one line."""
        if self.link is None:
            what = f"False alarm at {self.at:.2f} s"
        else:
            found = "missed" if self.delay is None else f"found after {1e3 * self.delay:.0f} ms"
            where = f"{self.collision} on link {self.link} at {self.at:.2f} s"
            what = f"{where}, {self.peak_torque:.1f} N m: {found}"
        return what[0].upper() + what[1:] + (f" ({self.note})" if self.note else "")


def events_of(matching: Matching, late: float) -> Iterator[Event]:
    """Missed collisions, those found later than ``late`` [s], and false alarms, in this order."""
    pairs = list(zip(matching.collisions, matching.delays, strict=True))
    for wanted in ("missed", "late"):
        for c, delay in pairs:
            kind = "missed" if delay is None else "late" if delay > late else ""
            if kind == wanted:
                up = [alarm for alarm in matching.false_alarms if _covers(alarm, c)]
                note = f"an alarm was up from {up[0].start:.2f} s on" if up else ""
                yield Event(kind, c.onset, c.kind, c.link, c.peak_tau, delay, note)
    for alarm in matching.false_alarms:
        hit = [c for c in matching.collisions if _covers(alarm, c)]
        note = f"still up at the {hit[0].kind} of {hit[0].onset:.2f} s" if hit else ""
        yield Event("false alarm", alarm.start, note=note)


def _covers(alarm: Alarm, collision: Collision) -> bool:
    """Whether the alarm began before the touch and was still up: such an alarm finds nothing."""
    return alarm.start < collision.onset <= alarm.end


class EventFolder:
    """Writes a recording of each event, and in the end the page."""

    def __init__(self, folder: Path, late: float) -> None:
        """Make the folder.

        Args:
            folder: new, or one that this has written before.
            late: collisions found later than this are events [s].

        Raises:
            ValueError: the folder holds something else.
        """
        if folder.exists() and (not folder.is_dir() or not all(map(_own, folder.iterdir()))):
            raise ValueError(f"{folder}: holds other files; --events takes a folder of its own")
        folder.mkdir(parents=True, exist_ok=True)
        for old in filter(_own, folder.iterdir()):
            old.unlink()
        self._folder, self._late = folder, late
        self._rows: list[dict[str, Any]] = []
        self._found = dict.fromkeys(KINDS, 0)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row for every recording: what happened, and ``file``, its name."""
        return self._rows

    @property
    def counts(self) -> str:
        """How many of each kind there were, as text."""
        many = {"false alarm": "false alarms"}
        return ", ".join(
            f"{count} {kind if count == 1 else many.get(kind, kind)}"
            for kind, count in self._found.items()
        )

    def add(self, split: str, number: int, matching: Matching, of: tuple[Trace, Detection]) -> None:
        """The events of one recording: the ``number``-th of ``split``."""
        for event in events_of(matching, self._late):
            self._found[event.kind] += 1
            if self._found[event.kind] <= MOST:
                name = f"{event.kind.replace(' ', '-')}-{self._found[event.kind]:03d}.rrd"
                self._write(name, event, *of)
                self._rows.append({"split": split, "recording": number, "file": name, **_of(event)})

    def _write(self, name: str, event: Event, trace: Trace, detection: Detection) -> None:
        from tauguard.replay import write_rrd
        from tauguard.replay.story import cut

        start = max(float(trace.t[0]), event.at - BEFORE)
        part, said = cut(trace, detection, start, start + LENGTH)
        write_rrd(self._folder / name, part, said, whole=True, about=event.text)

    def finish(self) -> Path:
        """Write the page; its path."""
        from tauguard.report.page import Link, page, tables
        from tauguard.whole_file import write_whole

        opens = escape(command_to_open(self._folder))
        how = (
            f"<p>{self.counts}. Late is later than {1e3 * self._late:.0f} ms. A recording begins "
            f"{BEFORE} s before its event and lasts {LENGTH:.0f} s; at most {MOST} of a kind are "
            f"kept. The links work while <code>{opens}</code> runs; "
            "<code>rerun FILE</code> opens a file without it.</p>"
        )
        rows = [{**row, "file": Link(f"open/{row['file']}", row["file"])} for row in self._rows]
        sections = {
            kind.capitalize(): tables([_shown(row) for row in rows if row["kind"] == kind], {})
            or "<p>None.</p>"
            for kind in KINDS
        }
        path = self._folder / "index.html"
        text = page("What the detector got wrong", {"How to read": how, **sections})
        write_whole(path, text)
        return path


def _own(path: Path) -> bool:
    """Whether this command writes files of that name."""
    return path.name == "index.html" or bool(OWN.fullmatch(path.name))


def _of(event: Event) -> dict[str, Any]:
    return {
        "kind": event.kind,
        "at [s]": f"{event.at:.2f}",
        "collision": event.collision or None,
        "link": event.link,
        "peak torque [N m]": None if event.peak_torque is None else round(event.peak_torque, 1),
        "delay [ms]": None if event.delay is None else round(1e3 * event.delay),
        "note": event.note,
    }


def _shown(row: dict[str, Any]) -> dict[str, Any]:
    """A row of the page: its kind is the section's name."""
    return {name: value for name, value in row.items() if name != "kind" and value is not None}
