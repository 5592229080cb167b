"""Write rows, text and pictures as one self-contained HTML file."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from typing import Any

from tauguard.report.table import blocks_of, cell


@dataclass(frozen=True)
class Link:
    """A cell of a table that is a link."""

    address: str  #: relative to the page, or absolute
    text: str


def page(title: str, sections: Mapping[str, str], lead: str = "") -> str:
    """A whole page, with a heading and a link for each section; section bodies are HTML.

    Args:
        title: title of the page.
        sections: heading and body of each; a section without a body is omitted.
        lead: HTML between the title and the links.
    """
    sections = {name: body for name, body in sections.items() if body}
    style = files("tauguard.report").joinpath("page.css").read_text("utf-8")
    names = {name: f"s{i}" for i, name in enumerate(sections)}
    links = " ".join(f'<a href="#{at}">{escape(name)}</a>' for name, at in names.items())
    bodies = "\n".join(
        f'<section><h2 id="{names[name]}">{escape(name)}</h2>\n{body}\n</section>'
        for name, body in sections.items()
    )
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>\n{style}</style></head>\n"
        f"<body><h1>{escape(title)}</h1>\n{lead}\n<nav>{links}</nav>\n{bodies}\n</body></html>\n"
    )


def tables(rows: Sequence[Mapping[str, Any]], notes: Mapping[str, str]) -> str:
    """Rows as tables; successive rows of one study with the same columns share a table."""
    parts: list[str] = []
    for study, keys, own in blocks_of(rows):
        if study is not None:
            note = f'<p class="note">{escape(notes[study])}</p>' if study in notes else ""
            parts.append(f"<h4>{escape(str(study))}</h4>{note}")
        head = "".join(f"<th>{escape(key.replace('_', ' '))}</th>" for key in keys)
        lines = "".join(f"<tr>{''.join(_cell(row[key]) for key in keys)}</tr>" for row in own)
        parts.append(f'<div class="wide"><table><tr>{head}</tr>{lines}</table></div>')
    return "\n".join(parts)


def _cell(value: object) -> str:
    if isinstance(value, Link):
        return f'<td><a href="{escape(value.address)}">{escape(value.text)}</a></td>'
    text = cell(value)
    mark = f' class="{text}"' if text in ("yes", "no") else ""
    return f"<td{mark}>{escape(text)}</td>"


def picture(data: bytes, kind: str, text: str) -> str:
    """A picture as HTML with its data embedded.

    ``kind`` is ``png`` or ``svg+xml``, ``text`` says what it shows.
    """
    code = base64.b64encode(data).decode()
    return f'<img alt="{escape(text)}" src="data:image/{kind};base64,{code}">'


def folded(title: str, body: str) -> str:
    """A section that opens at a click."""
    return f"<details><summary>{escape(title)}</summary>\n{body}\n</details>"
