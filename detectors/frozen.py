"""Immutable dataclasses with native parts that are built on first use."""

from __future__ import annotations

from dataclasses import fields
from typing import Any


class Frozen:
    """Base of frozen dataclasses whose cached native parts are neither copied nor pickled."""

    def __getstate__(self) -> dict[str, Any]:
        """The fields without cached properties."""
        return {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
