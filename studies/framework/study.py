"""Studies with named parts, and their look-up for the command line."""

import difflib
import importlib
from collections.abc import Mapping
from dataclasses import dataclass
from types import ModuleType

from studies import STUDIES


@dataclass(frozen=True)
class Part:
    """One question of a study, answered by the functions of a module.

    The module has ``measure(quick, seed, **options)``, which returns rows (flat dictionaries, each
    with its table's name under ``study``), and ``NOTES``, the meaning of each table's columns.
    It may also have ``judge(rows)``, which returns the rows of the summary,
    ``table(rows)``, which returns the rows to print instead of all, and ``draw(rows, figure)``
    with a figure of matplotlib. Without ``draw`` the figure shows the study's ``points``.
    """

    module: str  #: name of the module within ``studies``
    line: str  #: the question, for ``tauguard bench list``
    options: tuple[str, ...] = ()  #: command-line options that are passed to ``measure``
    alias: str = ""  #: another name of the part for ``tauguard bench``

    def load(self) -> ModuleType:
        """Import the module."""
        return importlib.import_module(f"studies.{self.module}")


@dataclass(frozen=True)
class Study:
    """The parts of a study.

    The package may also have ``points(rows)``, which returns the :class:`~.rows.Point` s of the
    report's first page from the rows of all its parts, and ``detections(rows)``, which returns
    lines of the report's table of collisions found.
    """

    line: str
    parts: Mapping[str, Part]


def package(study: str) -> ModuleType:
    """The package of a study; it imports quickly."""
    return importlib.import_module(f"studies.{study}")


def all_parts() -> dict[str, Part]:
    """Every part under its full name, ``STUDY-PART``."""
    return {
        f"{study}-{name}": part
        for study in STUDIES
        for name, part in package(study).STUDY.parts.items()
    }


def find(name: str) -> dict[str, Part]:
    """Find one part by its full name or alias, or all parts of a study by the name of the study.

    Raises:
        ValueError: no study or part has that name. The message suggests the nearest name or lists
            all names.
    """
    parts = all_parts()
    found = {
        full: one
        for full, one in parts.items()
        if name in (full, one.alias) or (name in STUDIES and full.startswith(f"{name}-"))
    }
    if found:
        return found
    known = [*STUDIES, *(one.alias for one in parts.values() if one.alias), *parts]
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.75)
    if near:
        hint = f"did you mean {near[0]}? (`tauguard bench list` has all)"
    else:
        hint = f"there are {', '.join(STUDIES)}"
    raise ValueError(f"no study {name!r}: {hint}")
