"""The archive of a model file: JSON and arrays in one zip file, read without running any code.

The same content gives the same bytes. Sizes, names and types are checked before anything is read.
"""

from __future__ import annotations

import hashlib
import hmac
import io
import json
import re
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.findings import ModelFileError

#: The member with everything but the arrays.
HEAD = "model.json"
#: An array's member: its name is that of a field, with those of the fields around it.
MEMBER = re.compile(r"arrays/([\w.]{1,400})\.npy")
#: Largest size of an unpacked file [bytes], and largest number of arrays.
LARGEST, MOST = 256 * 2**20, 10_000
#: The time of all members, so that equal contents give equal bytes.
TIME = (1980, 1, 1, 0, 0, 0)


def packed(
    head: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]], key: bytes | None = None
) -> bytes:
    """A model file's bytes.

    Args:
        head: JSON values; a checksum and, with a key, a signature of everything are added.
        arrays: by name.
        key: of the user.
    """
    members = {f"arrays/{name}.npy": _npy(array) for name, array in arrays.items()}
    own = checksum(head, members)
    marks = {"checksum": own, "signature": None if key is None else signature(own, key)}
    text = json.dumps({**head, **marks}, indent=1, allow_nan=False)
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        for name, content in {HEAD: text.encode(), **members}.items():
            entry = zipfile.ZipInfo(name, TIME)
            entry.create_system, entry.external_attr = 3, 0o644 << 16  # the same on all systems
            archive.writestr(entry, content)
    return data.getvalue()


def checksum(head: Mapping[str, Any], members: Mapping[str, bytes]) -> str:
    """SHA-256 over the JSON values, apart from checksum and signature, and over all arrays."""
    said = {key: head[key] for key in head if key not in ("checksum", "signature")}
    text = json.dumps(said, sort_keys=True, separators=(",", ":"))
    digest = hashlib.sha256(text.encode())
    for name in sorted(members):
        digest.update(f"{name}:{len(members[name])}:".encode() + members[name])
    return digest.hexdigest()


def signature(own: str, key: bytes) -> str:
    """HMAC-SHA256 of a content's checksum."""
    return hmac.new(key, own.encode(), hashlib.sha256).hexdigest()


def unpacked(data: bytes) -> tuple[dict[str, Any], dict[str, NDArray[Any]], str]:
    """The JSON values, the arrays by name, and the checksum that belongs to them.

    Raises:
        ModelFileError: too large, or members that do not belong into a model file.
        Exception: of any kind, for a damaged archive.
    """
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        entries = archive.infolist()
        total = sum(entry.file_size for entry in entries)
        if total > LARGEST or len(entries) > MOST:
            raise ModelFileError(
                f"unpacks to {total / 2**20:.0f} MB in {len(entries)} parts, expected "
                f"{LARGEST >> 20} MB and {MOST} parts at most"
            )
        members = {entry.filename: archive.read(entry) for entry in entries}
    head = json.loads(members.pop(HEAD))
    if len(members) + 1 != len(entries) or not isinstance(head, dict):
        raise ModelFileError("two parts of one name, or no object in model.json")
    arrays = {}
    for name, content in members.items():
        if (found := MEMBER.fullmatch(name)) is None:
            raise ModelFileError(f"a part that no model file has: {name!r:.100}")
        arrays[found[1]] = _array(name, content)
    return head, arrays, checksum(head, members)


def _npy(array: NDArray[Any]) -> bytes:
    data = io.BytesIO()
    np.save(data, array, allow_pickle=False)
    return data.getvalue()


def _array(name: str, content: bytes) -> NDArray[Any]:
    """The array in an ``.npy`` file of numbers that declares no more than it has."""
    data = io.BytesIO(content)
    version = np.lib.format.read_magic(data)
    if version != (1, 0):
        raise ModelFileError(f"{name}: version {version} of the .npy format, expected (1, 0)")
    shape, _, dtype = np.lib.format.read_array_header_1_0(data)
    size = dtype.itemsize
    for length in shape:
        size *= int(length)
    if dtype.kind not in "fiub" or data.tell() + size != len(content):
        raise ModelFileError(f"{name}: declares {dtype} of shape {shape} in {len(content)} bytes")
    return np.asarray(np.load(io.BytesIO(content), allow_pickle=False))
