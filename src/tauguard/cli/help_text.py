"""The text of arguments in ``--help``."""

import inspect
import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, get_args, get_type_hints

import tyro

#: An argument of a docstring: its name, and its text with continuation lines.
ARGUMENT = re.compile(r"^    (\w+): (.*(?:\n {8,}.*)*)", re.MULTILINE)

#: Placeholder of a flag's value in the help if the default is None; tyro would show None.
METAVARS: dict[Any, str] = {str: "STR", Path: "PATH", int: "INT", float: "FLOAT"}


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
        kinds = [kind for kind in get_args(hints[name]) if kind is not type(None)]
        shown = tyro.conf.arg(
            help=text,
            help_behavior_hint="" if said else None,
            metavar=METAVARS.get(kinds[0]) if parameter.default is None else None,
        )
        hints[name] = Annotated[hints[name], shown]
    command.__annotations__ = hints
