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
from devices.sample import TrackerSample
from replay_logs.take import MARKS_TOPIC, METADATA_NAME, RAW_ENCODING, SETTINGS_TOPIC, RecordedDevice

_FLUSH_EVERY_NS = 150_000_000
_NUMBER = {"type": "number"}
_TIME = {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}


def _object(**properties: object) -> dict[str, object]:
    return {"type": "object", "properties": properties}


POSE_SCHEMA = {
    "$comment": "The JSON form of Foxglove's PoseInFrame, docs.foxglove.dev/docs/sdk/schemas/pose-in-frame.",
    "title": "foxglove.PoseInFrame",
    **_object(
        timestamp=_TIME,
        frame_id={"type": "string"},
        pose=_object(
            position=_object(x=_NUMBER, y=_NUMBER, z=_NUMBER),
            orientation=_object(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER),
        ),
    ),
}

LOG_SCHEMA = {
    "$comment": "The JSON form of Foxglove's Log, docs.foxglove.dev/docs/sdk/schemas/log.",
    "title": "foxglove.Log",
    **_object(
        timestamp=_TIME,
        level={"type": "integer"},
        message={"type": "string"},
        name={"type": "string"},
        file={"type": "string"},
        line={"type": "integer"},
    ),
}
_INFO = 2
"""`foxglove.LogLevel` of what is told, no warning."""


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
        self._writer.start(profile="sixpoint")
        self._writer.add_metadata(METADATA_NAME, _about() | dict(metadata or {}))
        self._schema = self._writer.register_schema(
            "foxglove.PoseInFrame", "jsonschema", json.dumps(POSE_SCHEMA).encode()
        )
        self._raw: dict[str, int] = {}
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

    def write(self, device: str, reading: Reading) -> None:
        """Keeps what one `read` of a device brought. Raises FileError where the disk will not take it."""
        with self._told():
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
                schema = self._writer.register_schema("foxglove.Log", "jsonschema", json.dumps(LOG_SCHEMA).encode())
                self._marks = self._writer.register_channel(MARKS_TOPIC, "json", schema)
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

    def _pose_channel(self, device: str, tracker: str) -> int:
        key = (device, tracker)
        if key not in self._poses:
            self._poses[key] = self._writer.register_channel(f"/trackers/{device}/{tracker}", "json", self._schema)
        return self._poses[key]


def pose_message(frame: str, sample: TrackerSample) -> bytes:
    """A sample as a `foxglove.PoseInFrame` JSON message; without an orientation it is the identity."""
    x, y, z = sample.position or (0.0, 0.0, 0.0)
    qx, qy, qz, qw = sample.orientation or (0.0, 0.0, 0.0, 1.0)
    sec, nsec = divmod(sample.host_time_ns, 1_000_000_000)
    return (
        f'{{"timestamp":{{"sec":{sec},"nsec":{nsec}}},"frame_id":{json.dumps(frame)},'
        f'"pose":{{"position":{{"x":{x:.6f},"y":{y:.6f},"z":{z:.6f}}},'
        f'"orientation":{{"x":{qx:.6f},"y":{qy:.6f},"z":{qz:.6f},"w":{qw:.6f}}}}}}}'
    ).encode()


def mark_message(time_ns: int, text: str) -> bytes:
    """A mark as a `foxglove.Log` JSON message."""
    sec, nsec = divmod(time_ns, 1_000_000_000)
    stamp = {"sec": sec, "nsec": nsec}
    return json.dumps(
        {"timestamp": stamp, "level": _INFO, "message": text, "name": "mark", "file": "", "line": 0}
    ).encode()


def _about() -> dict[str, str]:
    return {"format": "1", "software": f"sixpoint {version('sixpoint')}", "created": datetime.now(UTC).isoformat()}
