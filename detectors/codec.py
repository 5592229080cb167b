"""Values of model files: frozen dataclasses as JSON and arrays, and back with the same bits."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.findings import ArgumentError, ModelFileError

#: Largest depth of nesting of a file's content.
DEEPEST = 20
#: Largest absolute value of a number in a file: products of ten such numbers do not overflow.
LARGEST = 1e30
#: What a field may hold, for error messages.
STORABLE = (
    f"expected finite numbers up to {LARGEST:g}, text, arrays, tuples, lists, dictionaries with "
    "text as keys, and dataclasses of these"
)
#: Keys of the JSON objects that stand for values which JSON does not have.
_CLASS, _FIELDS, _TUPLE, _DICT, _ARRAY, _SCALAR, _VALUE = (
    "class", "fields", "tuple", "dict", "array", "scalar", "value",
)  # fmt: skip

Arrays = dict[str, NDArray[Any]]


def encode(value: object, arrays: Arrays, where: str = "") -> Any:
    """``value`` as JSON, in which arrays are replaced by their names.

    Args:
        value: of the kinds in :data:`STORABLE`; NumPy's scalars are numbers too.
        arrays: its arrays are added, by names such as ``detector.arm.drive_gain``.
        where: name of the value, for the arrays' names and for errors.

    Raises:
        ModelFileError: names the field that cannot be stored.
    """
    if where.count(".") > DEEPEST:
        raise ModelFileError(f"{where:.100} ...: nested more than {DEEPEST} levels deep")
    if value is None or type(value) in (bool, str):
        return value
    if isinstance(value, np.ndarray | np.generic):
        return _encoded_array(value, arrays, where)
    if type(value) in (int, float):
        return _number(value, where)
    if type(value) is tuple:
        return {_TUPLE: encode(list(value), arrays, where)}
    if type(value) is list:
        return [encode(item, arrays, f"{where}.{k}") for k, item in enumerate(value)]
    if type(value) is dict and all(type(key) is str for key in value):
        pairs = enumerate(value.items())
        return {_DICT: {key: encode(item, arrays, f"{where}.{k}") for k, (key, item) in pairs}}
    if is_dataclass(value) and not isinstance(value, type):
        lead = f"{where}." if where else ""
        parts = {
            field.name: encode(getattr(value, field.name), arrays, lead + field.name)
            for field in fields(value)
        }
        return {_CLASS: type_name(type(value)), _FIELDS: parts}
    raise ModelFileError(f"{where}: a {type(value).__name__} cannot be stored: {STORABLE}")


def check_storable(value: object) -> None:
    """Refuse a dataclass with fields that a model file cannot hold.

    Raises:
        ArgumentError: names the field.
    """
    try:
        encode(value, {}, type(value).__name__) if is_dataclass(value) else None
    except ModelFileError as error:
        raise ArgumentError(f"{error}; no model file could keep this detector") from None


def _encoded_array(value: NDArray[Any] | np.generic, arrays: Arrays, where: str) -> Any:
    dtype = value.dtype
    if dtype.kind not in "fiub" or dtype.itemsize > 8:
        raise ModelFileError(f"{where}: numbers of type {dtype} cannot be stored: {STORABLE}")
    if isinstance(value, np.generic):
        return {_SCALAR: dtype.name, _VALUE: _number(value.item(), where)}
    if type(value) is not np.ndarray:
        raise ModelFileError(f"{where}: a {type(value).__name__} cannot be stored: {STORABLE}")
    _check_array(value, where)
    arrays[where] = value
    return {_ARRAY: where}


def decode(content: Any, arrays: Mapping[str, Any], known: Callable[[str], type]) -> Any:
    """The value that :func:`encode` has encoded.

    Args:
        content: JSON of a file.
        arrays: arrays by their names.
        known: returns the class of a name of :func:`type_name`, or raises for an unknown name.

    Raises:
        ModelFileError: unknown classes, missing or additional fields, numbers that are not finite
            or out of range, or too deep nesting.
    """
    return _decoded(content, arrays, known, "", 0)


def _decoded(
    content: Any, arrays: Mapping[str, Any], known: Callable[[str], type], where: str, depth: int
) -> Any:
    if depth > DEEPEST:
        raise ModelFileError("nested too deeply")

    def part(item: Any, name: object) -> Any:
        return _decoded(item, arrays, known, f"{where}.{name}" if where else str(name), depth + 1)

    if content is None or isinstance(content, bool | str):
        return content
    if isinstance(content, int | float):
        return _number(content, where)
    if isinstance(content, list):
        return [part(item, k) for k, item in enumerate(content)]
    keys = set(content)
    if keys == {_TUPLE}:
        return tuple(part(item, k) for k, item in enumerate(content[_TUPLE]))
    if keys == {_DICT}:
        pairs = enumerate(content[_DICT].items())
        return {key: part(item, k) for k, (key, item) in pairs}
    if keys == {_ARRAY}:
        return _check_array(arrays[content[_ARRAY]], where)
    if keys == {_SCALAR, _VALUE}:
        return _scalar(content[_SCALAR], _number(content[_VALUE], where), where)
    if keys != {_CLASS, _FIELDS}:
        raise ModelFileError(f"{where}: an object with the keys {', '.join(sorted(keys)):.100}")
    kind, values = known(str(content[_CLASS])), content[_FIELDS]
    expected = {field.name for field in fields(kind)}
    if set(values) != expected:
        different = ", ".join(sorted(set(values) ^ expected))
        raise ModelFileError(f"{kind.__name__} with missing or additional fields: {different}")
    return kind(**{name: part(item, name) for name, item in values.items()})


def _number(value: Any, where: str) -> Any:
    if not abs(value) <= LARGEST:  # nor NaN
        raise ModelFileError(f"{where}: {value!r:.40} cannot be stored: {STORABLE}")
    return value


def _scalar(name: object, value: Any, where: str) -> np.generic:
    if not re.fullmatch(r"bool|u?int(8|16|32|64)|float(16|32|64)", str(name)):
        raise ModelFileError(f"{where}: a number of type {name!r:.40}")
    found: np.generic = np.dtype(str(name)).type(value)
    if found.item() != value:
        raise ModelFileError(f"{where}: {value!r:.40} is no {name}")
    return found


def _check_array(value: Any, where: str) -> NDArray[Any]:
    """Refuse numbers that are not finite or beyond :data:`LARGEST`; returns the array."""
    if value.dtype.kind not in "fiub" or not (np.abs(value) <= LARGEST).all():
        raise ModelFileError(
            f"{where}: an array with numbers that are not finite, or beyond {LARGEST:g}"
        )
    checked: NDArray[Any] = value
    return checked


def type_name(kind: type) -> str:
    """A class's name in files: the name alone for tauguard's, module and name for others."""
    ours = kind.__module__.startswith("tauguard.")
    return kind.__qualname__ if ours else f"{kind.__module__}:{kind.__qualname__}"
