"""The writer of MCAP files whose topics are tables: the messages of a chunk are packed at once."""

import struct
import zlib
from collections.abc import Mapping, Sequence
from typing import IO, Any

import numpy as np
import zstandard
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from numpy.typing import NDArray

from tauguard.traces.mcap_cdr import Bytes
from tauguard.traces.mcap_container import MAGIC, PREFIX, Group, Topic
from tauguard.traces.mcap_schemas import schema as schema_text

CHUNK_BYTES = 4 << 20  # uncompressed: large enough for zstd, small enough to seek
ZSTD_LEVEL = 1  # measured signals hardly compress: level 3 is slower and files are no smaller


class Writer:
    """Writes one MCAP file of tables to a binary stream."""

    def __init__(self, stream: IO[bytes], library: str) -> None:
        """Write the file header."""
        self._stream = stream
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
        """Write ``data``, update the checksum of the data section, and return the offset."""
        start = self._offset
        self._stream.write(data)
        self._offset += len(data)
        self._crc = zlib.crc32(data, self._crc)
        return start

    def _record(self, record: records.McapRecord) -> tuple[int, int]:
        data = encode(record)
        return self._put(data), len(data)

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a metadata record with sorted keys."""
        record = records.Metadata(name=name, metadata=dict(sorted(values.items())))
        offset, length = self._record(record)
        self._metadata.append(records.MetadataIndex(offset=offset, length=length, name=name))

    def attachment(self, name: str, media_type: str, data: bytes) -> None:
        """Add an attachment; its times are 0, so that equal traces give equal bytes."""
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
                data=schema_text(topic.schema).encode(),
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
        """Write all messages of a group, in chunks.

        Raises:
            ValueError: a field array whose shape is not (rows, *field shape).
        """
        rows = len(group.nanoseconds)
        for topic in group.topics:
            topic.layout.check(topic.values, rows)
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
        """Compress and write a block of rows, then the message index of every channel."""
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
    """The bytes of a record, with opcode and length."""
    builder: Any = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()
    return data


def row_template(channels: Sequence[int], topics: Sequence[Topic]) -> tuple[Bytes, list[int]]:
    """The message records of a group for one row, with times of 0, and each record's offset."""
    row, starts = b"", []
    for channel, topic in zip(channels, topics, strict=True):
        length = PREFIX.itemsize - 9 + topic.layout.size
        starts.append(len(row))
        row += struct.pack("<BQHIQQ", Opcode.MESSAGE, length, channel, 0, 0, 0)
        row += bytes(topic.layout.size)
    return np.frombuffer(row, np.uint8), starts
