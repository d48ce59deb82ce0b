"""Putting a live session together from its configuration: devices opened, database, body, character, recorder."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from capture.characters import average_pose, cast
from capture.clock import SessionClock
from capture.config import DeviceConfig, SessionConfig, commented_config
from capture.library import open_named_database
from capture.pipeline import Pipeline, Shot
from capture.session import Session, SessionDevice
from capture.solving import performer_skeleton
from devices.assembler import FrameAssembler
from devices.errors import DeviceError
from devices.intake import IDENTITY_ASSIGNMENT, DeviceIntake
from devices.progress import Progress, no_progress
from devices.reconnecting import ReconnectingDevice
from devices.registry import make_device
from devices.room import RoomTransform
from reconstruction.solver import Reconstructor
from replay_logs.recorder import TakeRecorder
from replay_logs.take import RecordedDevice

Tell = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class OpenDevice:
    """A device that is streaming, and what a take has to know of it."""

    driver: ReconnectingDevice
    recorded: RecordedDevice

    def session_device(self) -> SessionDevice:
        """As the session loop takes it."""
        return SessionDevice(self.driver, DeviceIntake(self.recorded.assignment, self.recorded.room))


def open_devices(configs: Sequence[DeviceConfig], tell: Tell) -> list[OpenDevice]:
    """Opens every device, or none. Raises DeviceError or SettingError that names the first that cannot be opened."""
    opened: list[OpenDevice] = []
    with ExitStack() as undo:
        for config in configs or (DeviceConfig(),):
            device = _open_device(config, tell)
            undo.callback(device.driver.close)
            opened.append(device)
        undo.pop_all()
    return opened


def _open_device(config: DeviceConfig, tell: Tell) -> OpenDevice:
    linked = make_device(config.protocol, config.port, name=config.name, baud=config.baud)
    driver = ReconnectingDevice(linked, tell)
    driver.open()
    assignment = dict(config.trackers) or {**IDENTITY_ASSIGNMENT, **linked.role_hints}
    if not config.trackers and not linked.role_hints:
        tell(
            f"{config.name}: the device does not say which tracker is on which limb, and neither does [device.trackers]"
            " in session.toml; `sixpoint doctor --assign` finds out"
        )
    room = RoomTransform.turned(config.room_yaw_deg, config.room_translation_m)
    return OpenDevice(driver, RecordedDevice(config.name, config.protocol, {}, assignment, room))


def start_recording(path: Path, config: SessionConfig, devices: Sequence[OpenDevice]) -> TakeRecorder:
    """A new take that knows the session and its devices. Raises FileError where it cannot be written."""
    recorder = TakeRecorder(path, {"session": commented_config(config)})
    for device in devices:
        recorder.add_device(device.recorded)
    return recorder


def make_pipeline(config: SessionConfig, skinned: bool, progress: Progress = no_progress) -> Pipeline:
    """The solver on the configured database and body, and the character on it where it is to be shown."""
    database = open_named_database(config.database.path, progress)
    skeleton = performer_skeleton(database, config.performer.height_m)
    reconstructor = Reconstructor(database, skeleton)
    if not skinned:
        return Pipeline(reconstructor)
    look = config.character
    return Pipeline(reconstructor, cast(look.mesh, skeleton, look.resolution, average_pose(database, skeleton)))


def make_session(
    config: SessionConfig,
    devices: Sequence[OpenDevice],
    pipeline: Pipeline | None,
    recorder: TakeRecorder | None,
    watchers: Sequence[Callable[[Shot], None]] = (),
) -> Session:
    """A session ready to run."""
    if not devices:
        raise DeviceError("a session needs a device")
    clock = SessionClock()
    assembler = FrameAssembler(config.solver.rate_hz, config.solver.latency_ms / 1000, epoch_ns=clock.start_ns)
    return Session([device.session_device() for device in devices], assembler, pipeline, clock, recorder, watchers)
