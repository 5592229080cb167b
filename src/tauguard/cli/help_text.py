"""Text helpers of all commands: arguments in ``--help``, and notes."""

import inspect
import re
from collections.abc import Callable, Iterable
from typing import Annotated, Any, get_type_hints

import tyro

#: An argument of a docstring: its name, and its text with continuation lines.
ARGUMENT = re.compile(r"^    (\w+): (.*(?:\n {8,}.*)*)", re.MULTILINE)


def tidy(command: Callable[..., Any]) -> None:
    """Take the help of each flag from the docstring, with lines joined.

    tyro's note on the default is omitted if the default is empty or the text states it.
    """
    hints = get_type_hints(command, include_extras=True)
    texts = dict(ARGUMENT.findall(inspect.getdoc(command) or ""))
    for name, parameter in inspect.signature(command).parameters.items():
        text = " ".join(texts.get(name, "").split())
        if not text:
            continue
        said = parameter.default in (None, ()) or "(default:" in text
        shown = tyro.conf.arg(help=text, help_behavior_hint="" if said else None)
        hints[name] = Annotated[hints[name], shown]
    command.__annotations__ = hints


def print_notes(notes: Iterable[str]) -> None:
    """Print one line per note."""
    for note in notes:
        print(f"note: {note}")
