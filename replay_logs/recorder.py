"""Writes a take while it happens; a crash loses at most the last quarter of a second."""

import contextlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from types import TracebackType

from mcap.writer import CompressionType, Writer

from devices.driver import Reading
from devices.errors import FileError, SettingError
from devices.room import RoomTransform
from replay_logs.foxglove import (
    FRAMES_TOPIC,
    LOG_SCHEMA,
    POSE_SCHEMA,
    ROOM_FRAME,
    TRANSFORM_SCHEMA,
    UPRIGHT,
    frame_message,
    mark_message,
    pose_message,
)
from replay_logs.packed_index import PackedIndex
from replay_logs.take import MARKS_TOPIC, METADATA_NAME, RAW_ENCODING, SETTINGS_TOPIC, RecordedDevice

_FLUSH_EVERY_NS = 150_000_000
_CHUNK_INDICES = "_Writer__chunk_indices"


class TakeRecorder:
    """A take being written. Use as a context manager, or `close` it.

    metadata: text by name, such as session (the configuration's text) and calibration; version and time are added.
    Raises FileError where the file exists already or cannot be written.
    """

    def __init__(self, path: Path | str, metadata: Mapping[str, str] | None = None) -> None:
        self.path = Path(path)
        try:
            self._file = self.path.open("xb")
        except FileExistsError:
            raise FileError(f"{path}: there is a file already; takes are not overwritten") from None
        except OSError as error:
            raise FileError(f"{path}: cannot be written: {error.strerror}") from None
        self._writer = Writer(self._file, compression=CompressionType.ZSTD, enable_data_crcs=True)
        # The writer has no option for it; `test_the_index_of_a_take_is_packed` tells if its name changes.
        setattr(self._writer, _CHUNK_INDICES, PackedIndex())
        self._writer.start(profile="sixpoint")
        self._writer.add_metadata(METADATA_NAME, _about() | dict(metadata or {}))
        self._schemas: dict[str, int] = {}
        self._raw: dict[str, int] = {}
        self._unplaced: dict[str, RoomTransform] = {}
        self._frames: int | None = None
        self._poses: dict[tuple[str, str], int] = {}
        self._marks: int | None = None
        self._settings: int | None = None
        self._flushed_ns: int | None = None
        self._unwritten = False
        self._failed = False

    def add_device(self, device: RecordedDevice) -> None:
        """Makes a device known, once, before its first reading."""
        if device.name in self._raw:
            raise SettingError(f"two devices are called {device.name!r}: give each its own name")
        self._raw[device.name] = self._writer.register_channel(
            f"/devices/{device.name}/raw", RAW_ENCODING, 0, device.to_metadata()
        )
        self._unplaced[device.name] = device.room

    def write(self, device: str, reading: Reading) -> None:
        """Keeps what one `read` of a device brought. Raises FileError where the disk will not take it."""
        with self._told():
            if device in self._unplaced and reading.chunks:
                self._place(device, reading.chunks[0].host_time_ns)
            for chunk in reading.chunks:
                self._writer.add_message(self._raw[device], chunk.host_time_ns, chunk.data, chunk.host_time_ns)
            for sample in reading.samples:
                if sample.position is not None:
                    channel = self._pose_channel(device, sample.tracker)
                    data = pose_message(device, sample)
                    self._writer.add_message(channel, sample.host_time_ns, data, sample.host_time_ns)
        self._unwritten = self._unwritten or bool(reading.chunks)
        if reading.chunks:
            self.keep_up(reading.chunks[-1].host_time_ns)

    def mark(self, time_ns: int, text: str) -> None:
        """Notes that something was at that host time, on the thread that writes. Raises FileError as `write` does."""
        with self._told():
            if self._marks is None:
                self._marks = self._writer.register_channel(MARKS_TOPIC, "json", self._schema(LOG_SCHEMA))
            self._writer.add_message(self._marks, time_ns, mark_message(time_ns, text), time_ns)

    def settings(self, time_ns: int, values: Mapping[str, float | bool]) -> None:
        """Keeps that settings have these values from here on, by their names in `session.toml`.

        time_ns: host time. What holds is the place in the take: between the readings written before and after.
        Raises FileError as `write` does.
        """
        with self._told():
            if self._settings is None:
                self._settings = self._writer.register_channel(SETTINGS_TOPIC, "json", 0)
            self._writer.add_message(self._settings, time_ns, json.dumps(dict(values)).encode(), time_ns)

    def flush(self) -> None:
        """Hands everything so far to the operating system. Raises FileError as `write` does."""
        with self._told():
            self._writer.flush()
        self._unwritten = False

    def keep_up(self, now_ns: int) -> None:
        """Flushes what is older than 150 ms; for whoever writes, at moments when nothing may have come.

        now_ns: host time. Raises FileError as `write` does.
        """
        if self._flushed_ns is None:
            self._flushed_ns = now_ns
        elif self._unwritten and now_ns - self._flushed_ns >= _FLUSH_EVERY_NS:
            self.flush()
            self._flushed_ns = now_ns

    def close(self) -> None:
        """Finishes the file: index and summary. After a failed write it only closes it."""
        if self._failed or self._file.closed:
            with contextlib.suppress(OSError):
                self._file.close()
            return
        with self._told():
            self._writer.finish()
            self._file.close()

    @contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self._failed = True
            raise FileError(
                f"{self.path}: recording stopped: {error.strerror}; what was kept before opens as a cut-off take"
            ) from None

    def __enter__(self) -> "TakeRecorder":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _place(self, device: str, time_ns: int) -> None:
        """Tells other programs where a device stands, and the first time also which way is up."""
        if self._frames is None:
            self._frames = self._writer.register_channel(FRAMES_TOPIC, "json", self._schema(TRANSFORM_SCHEMA))
            self._writer.add_message(self._frames, time_ns, frame_message(time_ns, *UPRIGHT), time_ns)
        placed = frame_message(time_ns, ROOM_FRAME, device, self._unplaced.pop(device))
        self._writer.add_message(self._frames, time_ns, placed, time_ns)

    def _schema(self, schema: Mapping[str, object]) -> int:
        name = str(schema["title"])
        if name not in self._schemas:
            self._schemas[name] = self._writer.register_schema(name, "jsonschema", json.dumps(schema).encode())
        return self._schemas[name]

    def _pose_channel(self, device: str, tracker: str) -> int:
        key = (device, tracker)
        if key not in self._poses:
            self._poses[key] = self._writer.register_channel(
                f"/trackers/{device}/{tracker}", "json", self._schema(POSE_SCHEMA)
            )
        return self._poses[key]


def _about() -> dict[str, str]:
    return {"format": "1", "software": f"sixpoint {version('sixpoint')}", "created": datetime.now(UTC).isoformat()}
