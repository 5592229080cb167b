"""Conversion of frozen dataclasses to plain dictionaries and arrays and back, for model files."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from tauguard.findings import ModelFileError

#: Largest depth of nesting of a file's content.
DEEPEST = 20
#: Largest absolute value of a number in a file, because products of larger ones could overflow.
LARGEST = 1e15
_TYPE, _FIELDS, _TUPLE = "type", "fields", "tuple"


def encode(value: object) -> Any:
    """``value`` as dictionaries, lists, arrays, numbers and text.

    Raises:
        ModelFileError: it contains an object of another type, which the message names.
    """
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, np.generic):
        return encode(value.item())
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
        return np.ascontiguousarray(value)
    if isinstance(value, tuple):
        return {_TUPLE: [encode(item) for item in value]}
    if is_dataclass(value) and not isinstance(value, type):
        own = {field.name: encode(getattr(value, field.name)) for field in fields(value)}
        return {_TYPE: type_name(type(value)), _FIELDS: own}
    raise ModelFileError(
        f"a {type(value).__name__} cannot be in a model file: expected numbers, text, arrays, "
        "tuples and frozen dataclasses of these"
    )


def decode(
    content: Any,
    known: Callable[[str], type],
    depth: int = 0,
) -> Any:
    """The value that :func:`encode` has encoded.

    Args:
        content: content of a file.
        known: returns the class of a name of :func:`type_name`, or raises for an unknown name.
        depth: depth of nesting of this content.

    Raises:
        ModelFileError: unknown classes, missing or additional fields, numbers that are not finite
            or out of range, or too deep nesting.
    """
    if depth > DEEPEST:
        raise ModelFileError("nested too deeply")
    if isinstance(content, dict) and set(content) == {_TUPLE}:
        return tuple(decode(item, known, depth + 1) for item in content[_TUPLE])
    if isinstance(content, dict):
        kind = known(str(content.get(_TYPE)))
        expected = {field.name for field in fields(kind)}
        given = content.get(_FIELDS, {})
        if set(given) != expected:
            different = ", ".join(sorted(set(given) ^ expected))
            raise ModelFileError(f"{kind.__name__} with missing or additional fields: {different}")
        return kind(**{name: decode(own, known, depth + 1) for name, own in given.items()})
    if isinstance(content, np.ndarray):
        if content.dtype.kind not in "fiub" or not (np.abs(content) <= LARGEST).all():
            raise ModelFileError(
                f"an array with numbers that are not finite, or beyond {LARGEST:g}"
            )
        return content
    if content is None or isinstance(content, bool | int | str):
        return content
    if isinstance(content, float) and abs(content) <= LARGEST:
        return content
    raise ModelFileError(f"unexpected {content!r:.40}")


def type_name(kind: type) -> str:
    """A class's name in files: the name alone for tauguard's, module and name for others."""
    ours = kind.__module__.startswith("tauguard.")
    return kind.__qualname__ if ours else f"{kind.__module__}:{kind.__qualname__}"


def checksum(content: Any) -> str:
    """SHA-256 over all of an encoded content."""
    digest = hashlib.sha256()
    _feed(digest.update, content)
    return digest.hexdigest()


def _feed(update: Callable[[bytes], None], content: Any) -> None:
    if isinstance(content, dict):
        for key in sorted(content):
            update(f"{{{key}:".encode())
            _feed(update, content[key])
    elif isinstance(content, list):
        update(f"[{len(content)}".encode())
        for item in content:
            _feed(update, item)
    elif isinstance(content, np.ndarray):
        update(f"{content.dtype.str}{content.shape}".encode())
        update(np.ascontiguousarray(content).tobytes())
    else:
        update(f"{type(content).__name__} {content!r};".encode())
