"""Import names of a package at their first use."""

from __future__ import annotations

import ast
import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any


def on_demand(package: str) -> Callable[[str], Any]:
    """A ``__getattr__`` for ``package`` that imports names listed under ``if TYPE_CHECKING:``.

    Type checkers read these imports. At run time a name loads only the module that defines it, so
    that a light part of a package does not load the libraries of the heavy parts. ``dir`` and
    completion list all names without importing any.
    """
    where = _typed_imports(Path(str(sys.modules[package].__file__)).read_text(encoding="utf-8"))

    def __getattr__(name: str) -> Any:
        if name not in where:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module, original = where[name]
        value = getattr(importlib.import_module(module), original)
        setattr(sys.modules[package], name, value)
        return value

    module = sys.modules[package]
    tools = {"TYPE_CHECKING", "on_demand"}
    vars(module)["__dir__"] = lambda: sorted((vars(module).keys() | where.keys()) - tools)
    return __getattr__


def _typed_imports(source: str) -> dict[str, tuple[str, str]]:
    """Module and name of everything imported under ``if TYPE_CHECKING:``."""
    found = {}
    for node in ast.parse(source).body:
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            for line in node.body:
                assert isinstance(line, ast.ImportFrom)
                assert line.module is not None
                for alias in line.names:
                    found[alias.asname or alias.name] = (line.module, alias.name)
    return found
