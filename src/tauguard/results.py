"""Base of the results of the library: a few lines of text, a table in a notebook, a DataFrame."""

from __future__ import annotations

import dataclasses
import html
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tauguard.atomic_write import atomic_file
from tauguard.findings import Findings

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

Row = dict[str, Any]


class Result:
    """A result with rows and findings.

    A class that inherits it defines :meth:`rows`, and ``__repr__`` with one line.
    """

    findings: Findings

    def rows(self) -> list[Row]:
        """The main table: names with units, and values."""
        raise NotImplementedError

    def to_frame(self) -> pandas.DataFrame:
        """The main table as a DataFrame (needs pandas)."""
        import pandas

        return pandas.DataFrame(self.rows())

    def text(self) -> str:
        """The result as text, without its findings."""
        return "\n".join(line for line in (repr(self), text_table(self.rows())) if line)

    def __str__(self) -> str:
        """The text, and then each finding in a line."""
        return "\n".join([self.text(), *finding_lines(self.findings)])

    def _repr_html_(self) -> str:
        notes = "".join(f"<li>{html.escape(line)}</li>" for line in finding_lines(self.findings))
        return f"<p>{html.escape(repr(self))}</p>{html_table(self.rows())}" + (
            f"<ul>{notes}</ul>" if notes else ""
        )


def save_figure(figure: Figure, path: str | Path, dpi: int) -> None:
    """Write a figure in the format of the file's extension, PNG without one."""
    path = Path(path)
    with atomic_file(path) as stream:
        figure.savefig(stream, dpi=dpi, format=path.suffix[1:] or "png")


def finding_lines(findings: Findings) -> list[str]:
    """Findings as text, one line each."""
    return str(findings).splitlines() if findings else []


def finding_rows(findings: Iterable[Any]) -> list[Row]:
    """Findings as JSON values: code, severity, text, where, accept."""
    return [dataclasses.asdict(finding) | {"where": list(finding.where)} for finding in findings]


def text_table(rows: Sequence[Row]) -> str:
    """Rows as aligned columns; numbers to the right."""
    if not rows:
        return ""
    names = list(dict.fromkeys(name for row in rows for name in row))
    columns = [[name, *(_cell(row.get(name)) for row in rows)] for name in names]
    widths = [max(map(len, column)) for column in columns]
    right = [any(isinstance(row.get(name), int | float) for row in rows) for name in names]
    lines = [
        "  ".join(
            cell.rjust(width) if number else cell.ljust(width)
            for cell, width, number in zip(cells, widths, right, strict=True)
        ).rstrip()
        for cells in zip(*columns, strict=True)
    ]
    return "\n".join(lines)


def html_table(rows: Sequence[Row]) -> str:
    """Rows as an HTML table."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    head = "".join(f"<th>{html.escape(name)}</th>" for name in names)
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(_cell(row.get(n)))}</td>" for n in names) + "</tr>"
        for row in rows
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>" if rows else ""


def _cell(value: Any) -> str:
    """A value of a table as text; None is empty."""
    if isinstance(value, float):
        return f"{value:.6g}"
    return "" if value is None else str(value)
