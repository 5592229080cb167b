"""MCAP files whose topics are tables: whole chunks of messages packed and unpacked at once.

The container format is the public one (mcap.dev/spec), and the records are the ``mcap`` package's
own; only the inside of a chunk and its message index, which that package handles a message at a
time, are laid out here as arrays. Topics of one group share their times and are interleaved row by
row, in the order of time.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import IO, Any

import numpy as np
import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.stream_reader import get_chunk_data_stream
from numpy.typing import NDArray

from tauguard.traces.mcap_cdr import Anything, Bytes, Layout

MAGIC = b"\x89MCAP0\r\n"
CHUNK_BYTES = 4 << 20  # uncompressed: large enough for zstd, small enough to seek
ZSTD_LEVEL = 1  # the numbers are noise to a compressor: level 3 is no smaller and twice as slow
PREFIX = np.dtype(
    "<u1,<u8,<u2,<u4,<u8,<u8"  # opcode, length, channel, sequence, log time, publish time
)


@dataclass(frozen=True)
class Topic:
    """A table of messages: one row a message."""

    name: str
    schema: str  #: ROS 2 type name, "sensor_msgs/msg/JointState"
    layout: Layout
    values: Mapping[str, Anything] = field(default_factory=dict)


@dataclass(frozen=True)
class Group:
    """Topics logged together, one message of each at every time."""

    nanoseconds: NDArray[np.uint64]  #: log times, shape (rows,)
    topics: Sequence[Topic]


class Writer:
    """Writes one MCAP file of tables to a binary stream."""

    def __init__(self, stream: IO[bytes], library: str, schemas: Mapping[str, str]) -> None:
        """Write the header; ``schemas`` are the message definitions by type name."""
        self._stream, self._schema_texts = stream, schemas
        self._offset = self._crc = 0
        self._schemas: dict[str, records.Schema] = {}
        self._channels: list[records.Channel] = []
        self._counts: dict[int, int] = {}
        self._chunks: list[records.ChunkIndex] = []
        self._metadata: list[records.MetadataIndex] = []
        self._attachments: list[records.AttachmentIndex] = []
        self._put(MAGIC)
        self._record(records.Header(profile="ros2", library=library))

    def _put(self, data: bytes) -> int:
        """Write, keep the checksum of the data section, return the offset written at."""
        start = self._offset
        self._stream.write(data)
        self._offset += len(data)
        self._crc = zlib.crc32(data, self._crc)
        return start

    def _record(self, record: records.McapRecord) -> tuple[int, int]:
        data = encode(record)
        return self._put(data), len(data)

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a metadata record, its keys sorted."""
        record = records.Metadata(name=name, metadata=dict(sorted(values.items())))
        offset, length = self._record(record)
        self._metadata.append(records.MetadataIndex(offset=offset, length=length, name=name))

    def attachment(self, name: str, media_type: str, data: bytes) -> None:
        """Add an attachment; its times are 0, so that equal traces are equal bytes."""
        record = records.Attachment(
            create_time=0, log_time=0, name=name, media_type=media_type, data=data
        )
        offset, length = self._record(record)
        self._attachments.append(
            records.AttachmentIndex(
                offset=offset,
                length=length,
                create_time=0,
                log_time=0,
                data_size=len(data),
                name=name,
                media_type=media_type,
            )
        )

    def _channel(self, topic: Topic) -> int:
        if topic.schema not in self._schemas:
            schema = records.Schema(
                id=len(self._schemas) + 1,
                name=topic.schema,
                encoding="ros2msg",
                data=self._schema_texts[topic.schema].encode(),
            )
            self._schemas[topic.schema] = schema
            self._record(schema)
        channel = records.Channel(
            id=len(self._channels) + 1,
            topic=topic.name,
            message_encoding="cdr",
            metadata={},
            schema_id=self._schemas[topic.schema].id,
        )
        self._channels.append(channel)
        self._record(channel)
        return channel.id

    def group(self, group: Group) -> None:
        """Write all messages of a group, in chunks."""
        rows = len(group.nanoseconds)
        channels = [self._channel(topic) for topic in group.topics]
        template, starts = row_template(channels, group.topics)
        step = max(1, CHUNK_BYTES // len(template))
        for first in range(0, rows, step):
            part = slice(first, min(first + step, rows))
            block = np.tile(template, (part.stop - part.start, 1))
            times = group.nanoseconds[part].astype("<u8")
            number = np.arange(part.start, part.stop, dtype="<u4")
            stamp = times.view(np.uint8).reshape(-1, 8)
            for topic, start in zip(group.topics, starts, strict=True):
                block[:, start + 11 : start + 15] = number.view(np.uint8).reshape(-1, 4)
                block[:, start + 15 : start + 23] = stamp
                block[:, start + 23 : start + 31] = stamp
                body = block[:, start + PREFIX.itemsize :][:, : topic.layout.size]
                topic.layout.pack(body, {k: v[part] for k, v in topic.values.items()})
            self._chunk(block, times, dict(zip(channels, starts, strict=True)))

    def _chunk(self, block: Bytes, times: NDArray[np.uint64], starts: Mapping[int, int]) -> None:
        """Compress one block of rows, write it with the message index of every channel."""
        data = block.tobytes()
        chunk = records.Chunk(
            compression="zstd",
            data=zstandard.ZstdCompressor(level=ZSTD_LEVEL).compress(data),
            message_start_time=int(times.min()),
            message_end_time=int(times.max()),
            uncompressed_crc=zlib.crc32(data),
            uncompressed_size=len(data),
        )
        offset, length = self._record(chunk)
        entries = np.empty((len(block), 2), "<u8")
        entries[:, 0] = times
        where = {}
        for channel, start in starts.items():
            entries[:, 1] = np.arange(len(block), dtype=np.uint64) * block.shape[1] + start
            head = struct.pack(
                "<BQHI", Opcode.MESSAGE_INDEX, 6 + entries.nbytes, channel, entries.nbytes
            )
            where[channel] = self._put(head + entries.tobytes())
            self._counts[channel] = self._counts.get(channel, 0) + len(block)
        self._chunks.append(
            records.ChunkIndex(
                chunk_start_offset=offset,
                chunk_length=length,
                compression=chunk.compression,
                compressed_size=len(chunk.data),
                message_start_time=chunk.message_start_time,
                message_end_time=chunk.message_end_time,
                message_index_length=self._offset - offset - length,
                message_index_offsets=where,
                uncompressed_size=len(data),
            )
        )

    def finish(self) -> None:
        """Write the summary and the footer."""
        self._record(records.DataEnd(data_section_crc=self._crc))
        start = self._offset
        groups: list[tuple[Opcode, Sequence[records.McapRecord]]] = [
            (Opcode.SCHEMA, list(self._schemas.values())),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.ATTACHMENT_INDEX, self._attachments),
            (Opcode.METADATA_INDEX, self._metadata),
        ]
        summary, offsets = b"", b""
        for opcode, group in groups:
            if group:
                data = b"".join(encode(record) for record in group)
                place = records.SummaryOffset(
                    group_opcode=opcode, group_start=start + len(summary), group_length=len(data)
                )
                summary, offsets = summary + data, offsets + encode(place)
        footer = (start, start + len(summary))
        checked = struct.pack("<BQQQ", Opcode.FOOTER, 20, *footer)
        crc = zlib.crc32(summary + offsets + checked)
        self._put(summary + offsets)
        self._record(records.Footer(*footer, summary_crc=crc))
        self._put(MAGIC)

    def _statistics(self) -> records.Statistics:
        starts = [chunk.message_start_time for chunk in self._chunks]
        ends = [chunk.message_end_time for chunk in self._chunks]
        return records.Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            metadata_count=len(self._metadata),
            message_start_time=min(starts, default=0),
            message_end_time=max(ends, default=0),
            schema_count=len(self._schemas),
        )


def encode(record: records.McapRecord) -> bytes:
    """A record's bytes, opcode and length included."""
    builder: Any = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()
    return data


def row_template(channels: Sequence[int], topics: Sequence[Topic]) -> tuple[Bytes, list[int]]:
    """One row of a group: message records with empty times, and where each of them starts."""
    row, starts = b"", []
    for channel, topic in zip(channels, topics, strict=True):
        length = PREFIX.itemsize - 9 + topic.layout.size
        starts.append(len(row))
        row += struct.pack("<BQHIQQ", Opcode.MESSAGE, length, channel, 0, 0, 0)
        row += bytes(topic.layout.size)
    return np.frombuffer(row, np.uint8), starts


class Contents:
    """The records of an MCAP file in memory; chunks are decompressed one at a time.

    Raises:
        ValueError: not an MCAP file, or cut off, or damaged.
    """

    def __init__(self, data: bytes) -> None:
        """Index the file ``data``."""
        if data[: len(MAGIC)] != MAGIC:
            raise ValueError("not an MCAP file (its first bytes are not \\x89MCAP0)")
        self.metadata: dict[str, dict[str, str]] = {}
        self.attachments: dict[str, bytes] = {}
        self.channels: dict[int, records.Channel] = {}
        self.schemas: dict[int, records.Schema] = {}
        self.profile = ""
        self._chunks: list[tuple[int, memoryview]] = []
        self._size = len(data)
        for offset, opcode, body in walk(data):
            if opcode == Opcode.CHUNK:
                self._chunks.append((offset, body))
            elif opcode in READERS:
                self._keep(READERS[opcode].read(ReadDataStream(io.BytesIO(body))))

    def _keep(self, record: object) -> None:
        if isinstance(record, records.Metadata):
            self.metadata[record.name] = record.metadata
        elif isinstance(record, records.Attachment):
            self.attachments[record.name] = bytes(record.data)
        elif isinstance(record, records.Channel):
            self.channels[record.id] = record
        elif isinstance(record, records.Schema):
            self.schemas[record.id] = record
        elif isinstance(record, records.Header):
            self.profile = record.profile

    def messages(self) -> Iterator[tuple[int, NDArray[np.uint32], Bytes]]:
        """Runs of equally long messages: channel, sequence numbers, payloads (rows, size)."""
        check_chunks(self._chunks, self._size)
        for offset, body in self._chunks:
            try:
                chunk = records.Chunk.read(ReadDataStream(io.BytesIO(body)))
                stream, size = get_chunk_data_stream(chunk, validate_crc=True)
                inside = stream.read(size)
                yield from rows_of(inside) or singles(inside)
            except Exception as error:
                raise ValueError(f"damaged chunk at byte {offset}: {error}") from error


CHUNK = int(Opcode.CHUNK)

#: A chunk that claims more bytes than this is no recording's [bytes], and neither is a file that
#: unpacks to more than `MOST_UNPACKED` and to more than `MOST_RATIO` times its size.
MOST_CHUNK, MOST_UNPACKED, MOST_RATIO = 1 << 27, 1 << 29, 64


def check_chunks(chunks: Sequence[tuple[int, memoryview]], size: int) -> None:
    """Refuse chunks that unpack to more than a recording of ``size`` bytes can hold.

    Raises:
        ValueError: says which chunk, and what it claims.
    """
    total = 0
    for offset, body in chunks:
        chunk = records.Chunk.read(ReadDataStream(io.BytesIO(body)))
        claimed = max(chunk.uncompressed_size, unpacked_size(chunk))
        total += claimed
        if claimed > MOST_CHUNK or total > max(MOST_UNPACKED, MOST_RATIO * size):
            raise ValueError(
                f"the chunk at byte {offset} unpacks to {claimed} bytes, {total} with those before "
                f"it, out of a file of {size}: more than a recording holds"
            )


def unpacked_size(chunk: records.Chunk) -> int:
    """Bytes that decompression would give, counted no further than a chunk may go."""
    if chunk.compression == "zstd":
        import zstandard

        try:
            return int(zstandard.frame_content_size(chunk.data))
        except zstandard.ZstdError as error:
            raise ValueError(f"damaged chunk: {error}") from error
    if chunk.compression == "lz4":
        import lz4.frame

        try:
            unpacked = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, MOST_CHUNK + 1)
        except RuntimeError as error:
            raise ValueError(f"damaged chunk: {error}") from error
        return len(unpacked)
    return len(chunk.data)


READERS: dict[int, Any] = {
    Opcode.HEADER: records.Header,
    Opcode.METADATA: records.Metadata,
    Opcode.ATTACHMENT: records.Attachment,
    Opcode.CHANNEL: records.Channel,
    Opcode.SCHEMA: records.Schema,
}


def walk(data: bytes) -> Iterator[tuple[int, int, memoryview]]:
    """Top-level records up to the footer: offset, opcode, body.

    Raises:
        ValueError: the data end before the footer and the closing magic.
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
                raise ValueError(f"no closing magic at byte {at}: cut off or overwritten")
            return
    raise ValueError(f"cut off: {len(data)} bytes end inside the record at byte {at}")


def rows_of(data: bytes) -> list[tuple[int, NDArray[np.uint32], Bytes]]:
    """The messages of a chunk that repeats one row of records; empty if it does not."""
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
        (
            channel,
            np.ascontiguousarray(table[:, start + 11 : start + 15]).view("<u4")[:, 0],
            table[:, start + PREFIX.itemsize : start + length],
        )
        for start, channel, length in row
    ]


def singles(data: bytes) -> Iterator[tuple[int, NDArray[np.uint32], Bytes]]:
    """The messages of any chunk, one at a time."""
    at = 0
    while at < len(data):
        opcode, length = struct.unpack_from("<BQ", data, at)
        if opcode == Opcode.MESSAGE:
            channel, sequence = struct.unpack_from("<HI", data, at + 9)
            payload = np.frombuffer(data[at + PREFIX.itemsize : at + 9 + length], np.uint8)
            yield channel, np.array([sequence], np.uint32), payload[None]
        at += 9 + length
