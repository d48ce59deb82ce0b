"""A take's index of its chunks, kept as bytes until the end: as objects it grows by megabytes in a long session."""

from collections.abc import Iterator
from io import BytesIO

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.records import ChunkIndex

_RECORD_HEAD = 9
"""Opcode and length stand before a record's content."""


class PackedIndex:
    """What `mcap.writer.Writer` does with its list of chunk indices: append to it, and go through it at the end."""

    def __init__(self) -> None:
        self._records: list[bytes] = []

    def append(self, index: ChunkIndex) -> None:
        """Adds one."""
        builder = RecordBuilder()
        index.write(builder)
        self._records.append(builder.end())

    def __len__(self) -> int:
        return len(self._records)

    def __iter__(self) -> Iterator[ChunkIndex]:
        for record in self._records:
            yield ChunkIndex.read(ReadDataStream(BytesIO(record[_RECORD_HEAD:])))
