"""Model files in skops' format, with a kind, a version and the versions of libraries.

The content consists of dictionaries, arrays, numbers and text, never of code. A class is built only
if it is one of tauguard or of a module that the user has named. A checksum detects damage, and the
classes check the ranges of their numbers.
"""

from __future__ import annotations

import hashlib
import hmac
import importlib.metadata
import io
import json
import os
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tauguard.atomic_write import write_atomic
from tauguard.detectors.alarms.alarm import CollisionAlarm
from tauguard.detectors.codec import checksum, decode, encode
from tauguard.detectors.registry import file_type
from tauguard.detectors.self_check import check_alarms, check_ranges
from tauguard.findings import ModelFileError
from tauguard.untrusted_input import check_no_device, reading

#: Environment variable with the path of the key file, whose bytes are the key. A signature detects
#: manipulation; a checksum does not.
KEY_FILE = "TAUGUARD_MODEL_KEY"
#: Least length of a key [bytes].
SHORTEST = 16


def key_of_user() -> bytes | None:
    """The key in the file that the environment variable ``TAUGUARD_MODEL_KEY`` names.

    Raises:
        ModelFileError: the file cannot be read, or is shorter than 16 bytes.
    """
    path = os.environ.get(KEY_FILE)
    if not path:
        return None
    try:
        key = Path(path).read_bytes()
    except OSError as error:
        raise ModelFileError(f"{path}: the key cannot be read ({error.strerror})") from None
    if len(key) < SHORTEST:
        raise ModelFileError(f"{path}: a key of {len(key)} bytes, expected {SHORTEST} or more")
    return key


def signed(checksum: str, key: bytes) -> str:
    """HMAC-SHA256 of a content's checksum."""
    return hmac.new(key, checksum.encode(), hashlib.sha256).hexdigest()


def check_signature(checksum: str, signature: object, key: bytes) -> None:
    """Refuse a content that was not signed with this key.

    Raises:
        ModelFileError: no signature, or one with another key.
    """
    if not isinstance(signature, str):
        raise ModelFileError("not signed, and a key is set: sign it by writing it with the key")
    if not hmac.compare_digest(signed(checksum, key), signature):
        raise ModelFileError("signed with another key, or changed since")


#: The version also changes if a detector computes other scores from the same content, because a
#: threshold then has another meaning. Changes by version:
#: 2: the filter of `Unknowns.for_detection`. 3: scores of regressors are severities. 4: the filter
#: learns less of a held contact. 5: the noise grows with inertia, payload and changes of friction.
#: 6: and with changes of torque in slow logs; a change of friction counts once. 7: the bound in
#: free motion grows beyond the speeds and accelerations of the logs; srq-svr has the thresholds of
#: moving-thresholds. 8: the shape of a window has no note.
FORMAT, VERSION = "tauguard model", 8
#: The kind of a file with a trained detector and its threshold.
ALARM = "collision-alarm"
#: Packages whose versions are written into a file.
MADE_WITH = ("tauguard", "mujoco", "numpy", "scikit-learn")
#: Protocol and version of skops that are written into a file.
PROTOCOL, SKOPS = 2, "0.13"
#: Largest size of an unpacked file [bytes].
LARGEST = 256 * 2**20
#: Advice for a file of another format or version.
ANEW = "train the detector anew by `tauguard train`"
#: Formats of earlier versions, for the error message.
EARLIER = ("tauguard detector", "tauguard ranking detector", "tauguard free-motion detector")

#: Functions that build the value of a file from its content, by kind.
READERS: dict[str, Callable[[Any], Any]] = {ALARM: lambda content: decode(content, file_type)}


def save_model(alarm: CollisionAlarm, path: str | os.PathLike[str]) -> None:
    """Write a fitted detector with its threshold; after an error, ``path`` is unchanged.

    Raises:
        ModelFileError: a threshold that is not finite, a detector with other fields than numbers,
            text, arrays and dataclasses of these, or a folder that cannot be written.
    """
    if not np.isfinite(alarm.threshold):
        raise ModelFileError(f"threshold {alarm.threshold}: expected a finite one in a model file")
    write_model(path, ALARM, alarm)


def load_model(path: str | os.PathLike[str]) -> CollisionAlarm:
    """Read a file of :func:`save_model`.

    Raises:
        ModelFileError: the file is missing, damaged, or of another kind or version (the message
            says what to do), has numbers that no arm can have, or contains a detector that raises
            no alarm at any impact or alarms all the time.
    """
    alarm = read_model(path, ALARM)
    if not isinstance(alarm, CollisionAlarm):
        raise ModelFileError(f"{path}: contains a {type(alarm).__name__}, not a detector; {ANEW}")
    with reading(Path(path), ANEW), np.errstate(all="ignore"):
        check_ranges(alarm)
        check_alarms(alarm)
    return alarm


def write_model(path: str | os.PathLike[str], kind: str, value: object) -> None:
    """Write ``value``, encoded by :func:`tauguard.detectors.codec.encode`.

    After an error, ``path`` is unchanged. The file is signed if the user has a key, see
    :func:`key_of_user`.

    Raises:
        ModelFileError: the value cannot be encoded, or the folder cannot be written.
    """
    content, key = encode(value), key_of_user()
    own = checksum(content)
    container = {
        "format": FORMAT,
        "version": VERSION,
        "kind": kind,
        "made_with": {name: importlib.metadata.version(name) for name in MADE_WITH},
        "checksum": own,
        "signature": None if key is None else signed(own, key),
        "content": content,
    }
    try:
        write_atomic(Path(path), _archive(container))
    except OSError as error:
        raise ModelFileError(f"{path}: cannot be written ({error.strerror})") from None


def read_model(path: str | os.PathLike[str], kind: str) -> Any:
    """The value in a file of this kind.

    Raises:
        ModelFileError: the file is missing, damaged, of another kind, format or version, or has
            values out of range; one line that names the file.
    """
    container = _container(Path(path))
    version, own = container.get("version"), container.get("kind")
    if version != VERSION:
        raise ModelFileError(f"{path}: version {version} of the format, expected {VERSION}; {ANEW}")
    if own != kind or own not in READERS:
        raise ModelFileError(f"{path}: a file of the kind {own!r}, expected {kind!r}")
    content, key = container.get("content"), key_of_user()
    try:
        own = checksum(content)
        if own != container.get("checksum"):
            raise ModelFileError("its content does not fit its checksum: it was damaged or changed")
        if key is not None:
            check_signature(own, container.get("signature"), key)
        return READERS[kind](content)
    except (ValueError, TypeError, KeyError, AttributeError, IndexError, RecursionError) as error:
        raise ModelFileError(f"{path}: {_line(error)}") from None


def _archive(container: Mapping[str, Any]) -> bytes:
    """The result of ``skops.io.dumps``, without the imports of skops, which take seconds."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        schema = _node(container, archive) | {"protocol": PROTOCOL, "_skops_version": SKOPS}
        archive.writestr("schema.json", json.dumps(schema))
    return data.getvalue()


def _node(value: Any, archive: zipfile.ZipFile) -> dict[str, Any]:
    """The node of a skops schema that :func:`_value` reads; arrays are added to the archive."""
    of = {"__class__": type(value).__name__, "__module__": "builtins"}
    if isinstance(value, Mapping):
        parts = {name: _node(part, archive) for name, part in value.items()}
        text = {"__class__": "str", "__module__": "builtins", "__loader__": "TypeNode"}
        types = {"__class__": "list", "__module__": "builtins", "__loader__": "ListNode"}
        keys = types | {"content": [text] * len(parts)}
        return of | {"__loader__": "DictNode", "content": parts, "key_types": keys}
    if isinstance(value, list):
        return of | {"__loader__": "ListNode", "content": [_node(part, archive) for part in value]}
    if isinstance(value, np.ndarray):
        name, own = f"{len(archive.namelist())}.npy", io.BytesIO()
        np.save(own, value, allow_pickle=False)
        archive.writestr(name, own.getvalue())
        numpy = {"__module__": "numpy", "__loader__": "NdArrayNode", "type": "numpy"}
        return of | numpy | {"file": name}
    return of | {"__loader__": "JsonNode", "content": json.dumps(value), "is_json": True}


def _container(path: Path) -> Mapping[str, Any]:
    """The outer dictionary of a model file."""
    check_no_device(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ModelFileError(f"{path}: cannot be read ({error.strerror})") from None
    unknown: set[str] = set()
    try:
        with zipfile.ZipFile(path) as archive:
            _bounded(archive)
            arrays = {
                name: np.load(io.BytesIO(archive.read(name)), allow_pickle=False)
                for name in archive.namelist()
                if name.endswith(".npy")
            }
            found = _value(json.loads(archive.read("schema.json")), arrays, unknown)
    except Exception as error:  # a damaged archive can raise any exception
        earlier = _json_format(data)
        if earlier:
            raise ModelFileError(f"{path}: of the earlier format {earlier!r}; {ANEW}") from None
        raise ModelFileError(
            f"{path}: not a model file, or a damaged one ({_line(error)})"
        ) from None
    if unknown:
        raise ModelFileError(f"{path}: holds types that no detector needs: {', '.join(unknown)}")
    name = found.get("format") if isinstance(found, dict) else None
    if isinstance(name, str) and name.startswith(EARLIER):
        raise ModelFileError(f"{path}: of the earlier format {name!r}; {ANEW}")
    if not isinstance(found, dict) or name != FORMAT:
        raise ModelFileError(f"{path}: not a model file of tauguard; {ANEW}")
    return found


def _value(node: Any, arrays: Mapping[str, Any], unknown: set[str]) -> Any:
    """The value of a node of a skops schema: dictionaries, lists, arrays, numbers and text.

    skops itself is not used, because it imports scikit-learn and pytest, which takes seconds.

    Args:
        node: as written by ``skops.io``.
        arrays: arrays by the names of their files.
        unknown: output: the names of other types are added.
    """
    loader, kind = node["__loader__"], f"{node['__module__']}.{node['__class__']}"
    if (loader, kind) == ("DictNode", "builtins.dict"):
        parts = node["content"].items()
        return {name: _value(part, arrays, unknown) for name, part in parts}
    if (loader, kind) == ("ListNode", "builtins.list"):
        return [_value(part, arrays, unknown) for part in node["content"]]
    if loader == "JsonNode":
        return json.loads(node["content"])
    if (loader, kind) == ("NdArrayNode", "numpy.ndarray"):
        return arrays[node["file"]]
    unknown.add(kind)
    return None


def _bounded(archive: zipfile.ZipFile) -> None:
    """Refuse an archive larger than :data:`LARGEST`, or an array that declares a wrong size.

    Raises:
        ModelFileError: says which.
    """
    total = sum(member.file_size for member in archive.infolist())
    if total > LARGEST:
        raise ModelFileError(f"unpacks to {total / 2**20:.0f} MB, expected {LARGEST >> 20} at most")
    for member in archive.infolist():
        if member.filename.endswith(".npy"):
            with archive.open(member) as file:
                _check_array(file, member.file_size)


def _check_array(file: Any, size: int) -> None:
    version = np.lib.format.read_magic(file)
    read = np.lib.format.read_array_header_1_0
    if version != (1, 0):
        read = np.lib.format.read_array_header_2_0
    shape, _, dtype = read(file)
    count = 1
    for length in shape:
        count *= int(length)
    if dtype.hasobject or count * dtype.itemsize > size:
        raise ModelFileError(f"an array that declares a shape of {shape} in {size} bytes")


def _json_format(data: bytes) -> str:
    """The format named in a JSON file of an earlier version, else ""."""
    try:
        found = json.loads(data)
    except (ValueError, RecursionError):
        return ""
    name = found.get("format") if isinstance(found, dict) else None
    return name if isinstance(name, str) and name.startswith(EARLIER) else ""


def _line(error: Exception) -> str:
    text = str(error).splitlines()
    return f"{type(error).__name__}: {text[0][:200]}" if text else type(error).__name__
