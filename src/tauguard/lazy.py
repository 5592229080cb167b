"""Import names of a package at their first use."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping
from typing import Any


def on_demand(
    package: str, modules: Mapping[str, str]
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """``__getattr__``, ``__dir__`` and ``__all__`` of a package.

    A name loads only the module that defines it, so that a light part of a package does not load
    the libraries of the heavy parts. ``dir`` and completion list all names without importing any.
    Type checkers read ``__init__.pyi`` beside the package.

    Args:
        package: its name.
        modules: by the path of a module below the package, its public names, separated by spaces;
            a path that begins with "tauguard." is of another package.
    """
    where = {name: module for module, names in modules.items() for name in names.split()}

    def __getattr__(name: str) -> Any:
        if name not in where:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module = where[name]
        path = module if module.startswith("tauguard.") else f"{package}.{module}"
        value = getattr(importlib.import_module(path), name)
        setattr(sys.modules[package], name, value)
        return value

    def __dir__() -> list[str]:
        return sorted((vars(sys.modules[package]).keys() | where.keys()) - {"on_demand"})

    return __getattr__, __dir__, sorted(where)
