"""Immutable values that build a native form on demand."""

from __future__ import annotations

from dataclasses import fields
from typing import Any


class Frozen:
    """Base of frozen dataclasses with cached native parts: copies and pickles hold fields only."""

    def __getstate__(self) -> dict[str, Any]:
        """The fields alone: cached properties are computed again."""
        return {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
