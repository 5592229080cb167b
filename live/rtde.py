"""Universal Robots' Real-Time Data Exchange (RTDE): packets to bytes and back.

The protocol is published by Universal Robots ("Real-Time Data Exchange (RTDE) Guide"): over TCP
port 30004, every packet is its size (uint16, the header's 3 bytes included), its type (uint8) and
a payload; all numbers are big-endian. This module implements protocol version 2.
"""

import struct
from collections.abc import Sequence
from typing import NamedTuple

from tauguard.findings import ArgumentError

PORT = 30004
VERSION = 2
HEADER = struct.Struct(">HB")

REQUEST_PROTOCOL_VERSION = ord("V")
GET_URCONTROL_VERSION = ord("v")
TEXT_MESSAGE = ord("M")
DATA_PACKAGE = ord("U")
SETUP_OUTPUTS = ord("O")
SETUP_INPUTS = ord("I")
START = ord("S")
PAUSE = ord("P")

#: RTDE's type names and the struct format of one value.
FORMATS = {
    "BOOL": "?",
    "UINT8": "B",
    "UINT32": "I",
    "UINT64": "Q",
    "INT32": "i",
    "DOUBLE": "d",
    "VECTOR3D": "3d",
    "VECTOR6D": "6d",
    "VECTOR6INT32": "6i",
    "VECTOR6UINT32": "6I",
}


class Packet(NamedTuple):
    """One packet: its type and its payload."""

    kind: int
    payload: bytes


def packet(kind: int, payload: bytes = b"") -> bytes:
    """Encode a packet.

    Raises:
        ArgumentError: the payload does not fit the 16 bits of the size.
    """
    size = HEADER.size + len(payload)
    if size > 0xFFFF:
        raise ArgumentError(f"an RTDE packet of {size} bytes: at most 65535")
    return HEADER.pack(size, kind) + payload


class PacketReader:
    """Splits a stream of bytes, which arrives in pieces of any size, into packets."""

    def __init__(self) -> None:
        """Create a reader that has received no bytes yet."""
        self._bytes = bytearray()

    def feed(self, data: bytes) -> None:
        """Append the bytes that the socket received."""
        self._bytes += data

    def next(self) -> Packet | None:
        """The next complete packet, or None if it has not arrived completely.

        Raises:
            ArgumentError: the packet states a size below that of its header, so the other side does
                not speak RTDE.
        """
        if len(self._bytes) < HEADER.size:
            return None
        size, kind = HEADER.unpack_from(self._bytes)
        if size < HEADER.size:
            raise ArgumentError(f"a packet of {size} bytes: this is not RTDE")
        if len(self._bytes) < size:
            return None
        payload = bytes(self._bytes[HEADER.size : size])
        del self._bytes[:size]
        return Packet(kind, payload)


class Recipe(NamedTuple):
    """Number of a data packet's layout, and types of its variables in the requested order."""

    number: int
    types: tuple[str, ...]

    @property
    def layout(self) -> struct.Struct:
        """Layout of the packet's payload: the recipe's number, then all values."""
        return struct.Struct(">B" + "".join(FORMATS[kind] for kind in self.types))

    def pack(self, values: Sequence[float]) -> bytes:
        """Encode a data packet; ``values`` has one number for each element, in order."""
        return packet(DATA_PACKAGE, self.layout.pack(self.number, *values))


def text_message(source: str, message: str, level: int) -> bytes:
    """A text message; level 0 is an exception, 1 an error, 2 a warning, 3 an information."""
    parts = (message.encode()[:255], source.encode()[:255])
    return packet(
        TEXT_MESSAGE, b"".join(bytes([len(part)]) + part for part in parts) + bytes([level])
    )


def read_text(payload: bytes) -> str:
    """The message of a text packet; empty if it is cut off."""
    length = payload[0] if payload else 0
    return payload[1 : 1 + length].decode("utf-8", "replace")
