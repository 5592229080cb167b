"""CDR layouts of fixed-size ROS 2 messages as NumPy structured types, to pack all messages at once.

ROS 2 serialises a message as CDR (OMG DDS-XTypes, "plain CDR version 1"): a 4-byte encapsulation
header, then the fields in order. A primitive is aligned to its own size, counted from the end of
this header. A string is a ``uint32`` length (with the NUL) and its bytes. A sequence is a
``uint32`` count and its elements; an empty sequence has no padding for elements. In a trace all
messages of a topic have the same strings and lengths and differ only in numbers, so one template
serves them all.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.findings import FileError

Bytes = NDArray[np.uint8]
Anything = NDArray[np.generic]

ENCAPSULATION = b"\x00\x01\x00\x00"  # CDR, little-endian


class Layout:
    """Layout of one message: fields that vary by row, constant bytes between them."""

    def __init__(self) -> None:
        """Start with an empty message."""
        self.size = len(ENCAPSULATION)  #: bytes so far, including the encapsulation header
        self.fields: dict[str, tuple[np.dtype[np.generic], int]] = {}  #: type, offset [bytes]
        self._constants: list[tuple[int, bytes]] = [(0, ENCAPSULATION)]

    def _align(self, size: int) -> None:
        self.size += -(self.size - len(ENCAPSULATION)) % size

    def _constant(self, data: bytes, align: int = 1) -> None:
        self._align(align)
        self._constants.append((self.size, data))
        self.size += len(data)

    def number(self, name: str, kind: str, count: int | None = None) -> Layout:
        """A field ``name``: a number of NumPy type ``kind``, or an array of ``count`` numbers."""
        scalar = np.dtype(kind).newbyteorder("<")
        self._align(scalar.itemsize)
        dtype = scalar if count is None else np.dtype((scalar, (count,)))
        self.fields[name] = (dtype, self.size)
        self.size += dtype.itemsize
        return self

    def sequence(self, name: str, count: int) -> Layout:
        """A ``float64[]`` with ``count`` elements in every message."""
        self._constant(count.to_bytes(4, "little"), align=4)
        return self.number(name, "f8", count) if count else self

    def string(self, text: str) -> Layout:
        """A ``string`` that is ``text`` in every message."""
        data = text.encode() + b"\0"
        self._constant(len(data).to_bytes(4, "little"), align=4)
        self._constant(data)
        return self

    def strings(self, texts: Sequence[str]) -> Layout:
        """A ``string[]`` that is ``texts`` in every message."""
        self._constant(len(texts).to_bytes(4, "little"), align=4)
        for text in texts:
            self.string(text)
        return self

    def header(self) -> Layout:
        """``std_msgs/Header``: fields ``sec`` and ``nanosec``, an empty ``frame_id``."""
        return self.number("sec", "i4").number("nanosec", "u4").string("")

    def check(self, values: Mapping[str, Anything], rows: int) -> None:
        """Raise ``FileError`` for a field array whose shape is not (rows, *field shape)."""
        for name, (dtype, _) in self.fields.items():
            if values[name].shape != (rows, *dtype.shape):
                raise FileError(
                    f"{name}: shape {values[name].shape}, expected {(rows, *dtype.shape)}"
                )

    def template(self) -> Bytes:
        """A message with its constant bytes, and zeros in fields and padding. Shape (size,)."""
        out = np.zeros(self.size, np.uint8)
        for offset, data in self._constants:
            out[offset : offset + len(data)] = np.frombuffer(data, np.uint8)
        return out

    def pack(self, out: Bytes, values: Mapping[str, Anything]) -> None:
        """Write messages into ``out``, shape (rows, size), one field array at a time."""
        out[:] = self.template()
        for name, (dtype, offset) in self.fields.items():
            wide = np.ascontiguousarray(values[name], dtype.base).view(np.uint8)
            out[:, offset : offset + dtype.itemsize] = wide.reshape(len(out), dtype.itemsize)

    def unpack(self, data: Bytes) -> dict[str, Anything]:
        """Field arrays of messages ``data``, shape (rows, size): copies, in native byte order.

        Raises:
            FileError: the constant bytes (strings and lengths) differ from those of this layout.
        """
        for offset, expected in self._constants:
            found = data[:, offset : offset + len(expected)]
            if (found != np.frombuffer(expected, np.uint8)).any():
                raise FileError(f"strings or lengths differ from the layout at byte {offset}")
        fields = {}
        for name, (dtype, offset) in self.fields.items():
            raw = np.ascontiguousarray(data[:, offset : offset + dtype.itemsize])
            native = dtype.base.newbyteorder("=")
            fields[name] = raw.view(dtype.base).astype(native).reshape(len(data), *dtype.shape)
        return fields


def nanoseconds(t: Array) -> NDArray[np.uint64]:
    """Times ``t`` [s] as log times [ns].

    Raises:
        FileError: a time below 0 or after the year 2262.
    """
    bad = np.flatnonzero(~((t >= 0) & (t < 2**63 / 1e9)))
    if bad.size:
        raise FileError(f"t: {t[bad[0]]} s in row {bad[0]}, expected 0 to 9.2e9 s; shift the time")
    whole = np.floor(t)
    return whole.astype(np.uint64) * np.uint64(10**9) + np.rint((t - whole) * 1e9).astype(np.uint64)


def stamp(t: Array) -> dict[str, Anything]:
    """The fields ``sec`` and ``nanosec`` of message headers at times ``t`` [s]."""
    ns = nanoseconds(t)
    return {"sec": (ns // 10**9).astype(np.int32), "nanosec": (ns % 10**9).astype(np.uint32)}
