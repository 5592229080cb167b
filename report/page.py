"""Write rows, text and pictures as one self-contained HTML file."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from tauguard.report.table import blocks_of, cell

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 72rem; margin: 0 auto; padding: 1rem;
       color: #1b1b1b; background: #fff; }
h1, h2, h3 { line-height: 1.2; } h2 { margin-top: 2.5rem; border-bottom: 1px solid #ccc; }
nav a { margin-right: 1rem; display: inline-block; }
.wide { overflow-x: auto; margin: 0.5rem 0 1.5rem; }
table { border-collapse: collapse; font-size: 0.8rem; font-variant-numeric: tabular-nums; }
th, td { border-bottom: 1px solid #ddd; padding: 0.2rem 0.6rem; text-align: left;
         vertical-align: top; }
th { background: #f4f4f4; } td a { white-space: nowrap; }
.figures { display: flex; flex-wrap: wrap; gap: 1rem; }
.figures img { flex: 1 1 24rem; max-width: 35rem; }
img { max-width: 100%; height: auto; min-width: 0; } figure { margin: 1rem 0; }
figure img { width: 56rem; } .first { flex: 1 1 22rem; max-width: 35rem; }
.first img { width: 100%; max-width: none; }
.no { background: #fde3d3; } .yes { background: #e1f0fa; } .note { color: #444; }
summary { cursor: pointer; padding: 0.3rem 0; } code { background: #f4f4f4; }
td:last-child { min-width: 6em; }
@media (max-width: 40rem) { th, td { padding: 0.2rem 0.3rem; } }
@media (prefers-color-scheme: dark) {
  body { color: #e4e4e4; background: #15181b; } th, code { background: #2a2f34; }
  th, td { border-color: #3a4046; } a { color: #8ab8ff; } .note { color: #b0b0b0; }
  img { background: #fff; } .no { background: #5a3420; } .yes { background: #1f3f55; }
}
@media print {
  body { font-size: 10pt; max-width: none; padding: 0; } table { font-size: 7.5pt; }
  nav, details { display: none; } .wide { overflow: visible; }
  h2, h4, h2 + p { break-after: avoid; } tr, img { break-inside: avoid; }
  figure img { width: auto; max-height: 9cm; } .figures img { flex: 1 1 8cm; max-width: 9cm; }
}
"""


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
    names = {name: f"s{i}" for i, name in enumerate(sections)}
    links = " ".join(f'<a href="#{at}">{escape(name)}</a>' for name, at in names.items())
    bodies = "\n".join(
        f'<section><h2 id="{names[name]}">{escape(name)}</h2>\n{body}\n</section>'
        for name, body in sections.items()
    )
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{STYLE}</style></head>\n"
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
