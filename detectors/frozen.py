"""Immutable dataclasses with native parts that are built on first use."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from tauguard.findings import ArgumentError


class Frozen:
    """Base of frozen dataclasses whose cached native parts are neither copied nor pickled."""

    def __getstate__(self) -> dict[str, Any]:
        """The fields without cached properties."""
        return {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)


class Unshared:
    """An object with native state, which a shallow copy would share with the original."""

    def __copy__(self) -> Any:
        """Refuse.

        Raises:
            ArgumentError: always.
        """
        raise ArgumentError(
            f"copy.copy of {type(self).__name__}: both copies would continue the same native "
            "state; make a new stream with `stream()`"
        )
