"""Format rows as text tables for a terminal."""

import itertools
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

#: Largest length of a line, by default [characters].
WIDTH = 140
#: A column's heading is broken at its underscores into lines of about this length.
HEADING = 9
#: Text in a cell is broken into lines of this length.
TEXT = 56

#: One row: a flat dictionary.
Row = dict[str, Any]
#: A column: the heading and then each row's cell, all as lines of text.
Column = list[list[str]]


def table(
    rows: Sequence[Mapping[str, Any]],
    width: int = WIDTH,
    notes: Mapping[str, str] = MappingProxyType({}),
) -> str:
    """Rows as aligned columns; successive rows of one study with the same keys share a heading.

    The name of the study and its line of ``notes`` stand above. If a line would be longer than
    ``width``, headings and long texts are broken. If that is not enough, intervals are omitted.
    Columns that still do not fit follow below, and each part repeats the first columns.
    """
    blocks: list[str] = []
    for study, keys, own in blocks_of(rows):
        if study is not None:
            title = f"{study}: {notes[study]}" if study in notes else str(study)
            blocks.append("\n".join(textwrap.wrap(title, width)))
        blocks += _block(keys, own, width)
    return "\n\n".join(blocks)


def blocks_of(
    rows: Sequence[Mapping[str, Any]],
) -> Iterator[tuple[Any, list[str], list[Mapping[str, Any]]]]:
    """Successive rows of one study with the same keys: the study, the other keys, the rows."""
    for (study, keys), own in itertools.groupby(rows, _kind):
        yield study, keys, list(own)


def _kind(row: Mapping[str, Any]) -> tuple[Any, list[str]]:
    return row.get("study"), [key for key in row if key != "study"]


def two_digits(value: float) -> str:
    """Two significant digits, four decimals at most: ``120``, ``4.9``, ``0.03``."""
    return np.format_float_positional(
        round(value, 4), precision=2, unique=False, fractional=False, trim="-"
    )


def cell(value: object, brief: bool = False) -> str:
    """A value with three digits; a rate or a time as ``value [low, high]``, unless ``brief``.

    Delays (:func:`~tauguard.detectors.evaluation.matching.delay_metrics`) are ``median, p95``.
    """
    if value is None:
        return "-"
    if isinstance(value, Mapping):
        middle = value["value"] if "value" in value else value["median"]
        if middle is None:
            return "-"
        form = ".3g" if "median" in value else ".3f" if middle < 10 else ".0f"
        if brief:
            return f"{middle:.1e}" if 0 < middle < 5e-4 else f"{middle:{form}}"
        if "p95" in value:
            return f"{middle:{form}}, {value['p95']:{form}}"
        if "median" in value and value["low"] == value["high"]:
            return f"{middle:{form}}"  # measured once
        return f"{middle:{form}} [{value['low']:{form}}, {value['high']:{form}}]"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, np.floating):
        value = float(value)
    if isinstance(value, float):
        return f"{value:.3g}" if abs(value) < 1e5 else f"{value:.2e}"
    return str(value)


def _block(keys: list[str], rows: Sequence[Mapping[str, Any]], width: int) -> list[str]:
    """One table, or several if there are too many columns."""
    columns: list[Column] = []
    for narrow, brief in ((False, False), (True, False), (True, True)):
        columns = [_column(key, [row[key] for row in rows], narrow, brief) for key in keys]
        if _length(columns) <= width:
            return [_aligned(columns)]
    labels: list[Column] = []
    for key, column in zip(keys, columns, strict=True):
        if not isinstance(rows[0][key], str) or _length([*labels, column]) > width / 2:
            break
        labels.append(column)
    parts = [list(labels)]
    for column in columns[len(labels) :]:
        if _length([*parts[-1], column]) > width and len(parts[-1]) > len(labels):
            parts.append(list(labels))
        parts[-1].append(column)
    return [_aligned(part) for part in parts]


def _column(key: str, values: list[Any], narrow: bool, brief: bool) -> Column:
    texts = [cell(value, brief) for value in values]
    if not narrow:
        return [[key], *([text] for text in texts)]
    wrapped = [textwrap.wrap(text, TEXT) or [""] for text in texts]
    room = max(HEADING, *(len(line) for lines in wrapped for line in lines))
    return [_broken(key, room), *wrapped]


def _broken(key: str, room: int) -> list[str]:
    """A heading in lines that end at a space or an underscore, but not within a unit's brackets."""
    lines = [""]
    for word in re.split(r"(?<=[_ ])(?![^\[]*\])", key):
        if lines[-1] and len(lines[-1]) + len(word.rstrip("_ ")) > room:
            lines.append("")
        lines[-1] += word
    return [line.rstrip() for line in lines]


def _wide(column: Column) -> int:
    return max(len(line) for lines in column for line in lines)


def _length(columns: list[Column]) -> int:
    return sum(_wide(column) + 2 for column in columns) - 2


def _aligned(columns: list[Column]) -> str:
    widths = [_wide(column) for column in columns]
    lines: list[str] = []
    for cells in zip(*columns, strict=True):
        for i in range(max(len(own) for own in cells)):
            texts = [own[i] if i < len(own) else "" for own in cells]
            padded = (text.ljust(room) for text, room in zip(texts, widths, strict=True))
            lines.append("  ".join(padded).rstrip())
        if cells[0] is columns[0][0]:
            lines.append("  ".join("-" * room for room in widths))
    return "\n".join(lines)
