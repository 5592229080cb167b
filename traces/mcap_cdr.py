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

Bytes = NDArray[np.uint8]
Anything = NDArray[np.generic]

ENCAPSULATION = b"\x00\x01\x00\x00"  # CDR, little-endian


class Layout:
    """Layout of one message: fields that vary by row, constant bytes between them."""

    def __init__(self) -> None:
        """Start with an empty message."""
        self.size = len(ENCAPSULATION)  #: bytes so far, including the encapsulation header
        self._fields: dict[str, tuple[np.dtype[np.generic], int]] = {}
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
        self._fields[name] = (dtype, self.size)
        self.size += dtype.itemsize
        return self

    def sequence(self, name: str, count: int, kind: str = "f8") -> Layout:
        """A ``float64[]`` (or other ``kind``) with ``count`` elements in every message."""
        self._constant(count.to_bytes(4, "little"), align=4)
        return self.number(name, kind, count) if count else self

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

    @property
    def dtype(self) -> np.dtype[np.void]:
        """Structured type of one message, ``size`` bytes."""
        return np.dtype(
            {
                "names": list(self._fields),
                "formats": [dtype for dtype, _ in self._fields.values()],
                "offsets": [offset for _, offset in self._fields.values()],
                "itemsize": self.size,
            }
        )

    def template(self) -> Bytes:
        """A message with its constant bytes, and zeros in fields and padding. Shape (size,)."""
        out = np.zeros(self.size, np.uint8)
        for offset, data in self._constants:
            out[offset : offset + len(data)] = np.frombuffer(data, np.uint8)
        return out

    def pack(self, out: Bytes, values: Mapping[str, Anything]) -> None:
        """Write messages into ``out``, shape (rows, size), one field array at a time.

        Raises:
            ValueError: an array whose shape is not (rows, *field shape).
        """
        out[:] = self.template()
        for name, (dtype, offset) in self._fields.items():
            value = values[name]
            if value.shape != (len(out), *dtype.shape):
                raise ValueError(
                    f"{name}: shape {value.shape}, expected {(len(out), *dtype.shape)}"
                )
            wide = np.ascontiguousarray(value, dtype.base).view(np.uint8)
            out[:, offset : offset + dtype.itemsize] = wide.reshape(len(out), dtype.itemsize)

    def unpack(self, data: Bytes) -> dict[str, Anything]:
        """Field arrays of messages ``data``, shape (rows, size): copies, in native byte order.

        Raises:
            ValueError: the constant bytes (strings and lengths) differ from those of this layout.
        """
        for offset, expected in self._constants:
            found = data[:, offset : offset + len(expected)]
            if (found != np.frombuffer(expected, np.uint8)).any():
                raise ValueError(f"strings or lengths differ from the layout at byte {offset}")
        fields = {}
        for name, (dtype, offset) in self._fields.items():
            raw = np.ascontiguousarray(data[:, offset : offset + dtype.itemsize])
            native = dtype.base.newbyteorder("=")
            fields[name] = raw.view(dtype.base).astype(native).reshape(len(data), *dtype.shape)
        return fields
