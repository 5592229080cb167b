"""MCAP files whose topics are tables: all messages of a chunk are packed or unpacked at once.

The format is the public one (mcap.dev/spec). Records are those of the ``mcap`` package, which
handles one message at a time; here the content of a chunk and its message index are arrays. The
topics of a group share their times and are interleaved row by row, in the order of time.
"""

import io
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.stream_reader import get_chunk_data_stream
from numpy.typing import NDArray

from tauguard.findings import FileError
from tauguard.traces.mcap_cdr import Anything, Bytes, Layout

MAGIC = b"\x89MCAP0\r\n"
PREFIX = np.dtype(
    "<u1,<u8,<u2,<u4,<u8,<u8"  # opcode, length, channel, sequence, log time, publish time
)


@dataclass(frozen=True)
class Topic:
    """A table of messages, one per row."""

    name: str
    schema: str  #: ROS 2 type name, such as "sensor_msgs/msg/JointState"
    layout: Layout
    values: Mapping[str, Anything] = field(default_factory=dict)


@dataclass(frozen=True)
class Group:
    """Topics that are logged together: each has one message at every time."""

    nanoseconds: NDArray[np.uint64]  #: log times, shape (rows,)
    topics: Sequence[Topic]


class Block(NamedTuple):
    """Equally long messages of a channel."""

    channel: int
    sequence: NDArray[np.integer[Any]]  #: sequence numbers, shape (rows,)
    nanoseconds: NDArray[np.uint64]  #: log times, shape (rows,)
    payload: Bytes  #: shape (rows, size)


class Contents:
    """The records of an MCAP file in memory; chunks are decompressed one at a time.

    Raises:
        FileError: not an MCAP file, or truncated or damaged.
    """

    def __init__(self, data: bytes) -> None:
        """Index the file ``data``."""
        if data[: len(MAGIC)] != MAGIC:
            raise FileError("not an MCAP file (its first bytes are not \\x89MCAP0)")
        self.metadata: dict[str, dict[str, str]] = {}
        self.attachments: dict[str, bytes] = {}
        self.channels: dict[int, records.Channel] = {}
        self.schemas: dict[int, records.Schema] = {}
        self.counts: dict[int, int] = {}  #: messages of each channel, as the summary says
        self._chunks: list[tuple[int, memoryview]] = []
        self._single = bytearray()  # messages outside of chunks
        self._data = data
        self._end = len(data), 0  # of the data section, and its checksum
        for offset, opcode, body in walk(data):
            if opcode == Opcode.CHUNK:
                self._chunks.append((offset, body))
            elif opcode == Opcode.MESSAGE:
                self._single += data[offset : offset + 9 + len(body)]
            elif opcode in READERS:
                self._keep(READERS[opcode].read(ReadDataStream(io.BytesIO(body))), offset)

    def _keep(self, record: object, offset: int) -> None:
        if isinstance(record, records.Metadata):
            self.metadata[record.name] = record.metadata
        elif isinstance(record, records.Attachment):
            self.attachments[record.name] = bytes(record.data)
        elif isinstance(record, records.Channel):
            self.channels[record.id] = record
        elif isinstance(record, records.Schema):
            self.schemas[record.id] = record
        elif isinstance(record, records.Statistics):
            self.counts = record.channel_message_counts
        elif isinstance(record, records.DataEnd):
            self._end = offset, record.data_section_crc

    def check_sum(self) -> None:
        """Compare the data section with its checksum, if there is one.

        Raises:
            FileError: metadata, names or messages were damaged or changed.
        """
        end, wanted = self._end
        if wanted not in (0, zlib.crc32(memoryview(self._data)[:end])):
            raise FileError(f"damaged: the first {end} bytes do not match their checksum")

    def messages(self) -> Iterator[Block]:
        """Blocks of equally long messages, in the order of the file."""
        check_chunks(self._chunks, len(self._data))
        yield from singles(self._single)
        for offset, body in self._chunks:
            try:
                chunk = records.Chunk.read(ReadDataStream(io.BytesIO(body)))
                stream, size = get_chunk_data_stream(chunk, validate_crc=True)
                inside = stream.read(size)
                yield from rows_of(inside) or singles(inside)
            except Exception as error:
                raise FileError(f"damaged chunk at byte {offset}: {error}") from error


MOST_CHUNK = 1 << 27  #: largest unpacked size of a chunk [bytes]
#: A file is refused if its unpacked size exceeds both MOST_UNPACKED [bytes] and MOST_RATIO times
#: its packed size. A message takes some 2 kB of memory and 20 us, so 64 MiB of messages take 5 s.
MOST_UNPACKED, MOST_RATIO = 1 << 26, 64


def check_chunks(chunks: Sequence[tuple[int, memoryview]], size: int) -> None:
    """Check the unpacked size of chunks in a file of ``size`` bytes.

    Raises:
        FileError: a limit is exceeded; the message gives position and size of the chunk.
    """
    total = 0
    for offset, body in chunks:
        chunk = records.Chunk.read(ReadDataStream(io.BytesIO(body)))
        claimed = max(chunk.uncompressed_size, unpacked_size(chunk))
        total += claimed
        if claimed > MOST_CHUNK or total > max(MOST_UNPACKED, MOST_RATIO * size):
            raise FileError(
                f"the chunk at byte {offset} unpacks to {claimed} bytes, {total} with those before "
                f"it, out of a file of {size}: more than a recording holds"
            )


def unpacked_size(chunk: records.Chunk) -> int:
    """The number of bytes that decompression would give, counted up to the limit of a chunk."""
    if chunk.compression == "zstd":
        import zstandard

        try:
            return int(zstandard.frame_content_size(chunk.data))
        except zstandard.ZstdError as error:
            raise FileError(f"damaged chunk: {error}") from error
    if chunk.compression == "lz4":
        import lz4.frame

        try:
            unpacked = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, MOST_CHUNK + 1)
        except RuntimeError as error:
            raise FileError(f"damaged chunk: {error}") from error
        return len(unpacked)
    return len(chunk.data)


READERS: dict[int, Any] = {
    Opcode.METADATA: records.Metadata,
    Opcode.ATTACHMENT: records.Attachment,
    Opcode.CHANNEL: records.Channel,
    Opcode.SCHEMA: records.Schema,
    Opcode.STATISTICS: records.Statistics,
    Opcode.DATA_END: records.DataEnd,
}


def walk(data: bytes) -> Iterator[tuple[int, int, memoryview]]:
    """Top-level records up to the footer: offset, opcode, body.

    Raises:
        FileError: the data end before the footer and the closing magic.
    """
    view, at = memoryview(data), len(MAGIC)
    while at + 9 <= len(data):
        opcode, length = struct.unpack_from("<BQ", data, at)
        if at + 9 + length > len(data):
            break
        yield at, opcode, view[at + 9 : at + 9 + length]
        at += 9 + length
        if opcode == Opcode.FOOTER:
            if data[at:] != MAGIC:
                raise FileError(f"no closing magic at byte {at}: cut off or overwritten")
            return
    raise FileError(f"cut off: {len(data)} bytes end inside the record at byte {at}")


def rows_of(data: bytes) -> list[Block]:
    """The messages of a chunk in which one sequence of records repeats; empty for other chunks."""
    row: list[tuple[int, int, int]] = []  # start, channel, record length
    at = 0
    while at + PREFIX.itemsize <= len(data):
        opcode, length, channel = struct.unpack_from("<BQH", data, at)
        if opcode != Opcode.MESSAGE or channel in (known for _, known, _ in row):
            break
        row.append((at, channel, 9 + length))
        at += 9 + length
    if not row or len(data) % at:
        return []
    table = np.frombuffer(data, np.uint8).reshape(-1, at)
    for start, _, _ in row:
        if (table[:, start : start + 11] != table[0, start : start + 11]).any():
            return []
    return [
        Block(
            channel,
            np.ascontiguousarray(table[:, start + 11 : start + 15]).view("<u4")[:, 0],
            np.ascontiguousarray(table[:, start + 15 : start + 23]).view("<u8")[:, 0],
            table[:, start + PREFIX.itemsize : start + length],
        )
        for start, channel, length in row
    ]


def singles(data: bytes | bytearray) -> Iterator[Block]:
    """The messages of any chunk, one at a time."""
    at = 0
    while at < len(data):
        opcode, length = struct.unpack_from("<BQ", data, at)
        if opcode == Opcode.MESSAGE:
            channel, sequence, time = struct.unpack_from("<HIQ", data, at + 9)
            payload = np.frombuffer(data[at + PREFIX.itemsize : at + 9 + length], np.uint8)
            yield Block(channel, np.array([sequence]), np.array([time], np.uint64), payload[None])
        at += 9 + length
