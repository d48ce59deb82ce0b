"""Putting a live session together from its configuration: devices opened, database, body, character, recorder."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from scipy.spatial.transform import Rotation

from capture.character_settings import character_settings, configured_cast, deform_settings
from capture.characters import average_pose
from capture.clock import SessionClock
from capture.config import DeviceConfig, SessionConfig, commented_config
from capture.device_settings import device_settings
from capture.director import make_director
from capture.library import open_named_database
from capture.pipeline import Pipeline, Shot
from capture.profiles import profile_path
from capture.session import Session, SessionDevice
from capture.solve_settings import CALIBRATION
from capture.solving import performer
from capture.streaming import open_stream
from capture.tuning import LiveSetting, Tuning
from devices.assembler import FrameAssembler
from devices.errors import DeviceError, SettingError
from devices.filters import GateSettings, OneEuroSettings
from devices.intake import IDENTITY_ASSIGNMENT
from devices.progress import Progress, no_progress
from devices.reconnecting import ReconnectingDevice
from devices.registry import make_device
from devices.room import RoomTransform
from reconstruction.motion_files import read_motion
from reconstruction.solver import Reconstructor
from reconstruction.solver_settings import SolverSettings
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
        return SessionDevice(self.driver, self.recorded.intake())


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
    linked = make_device(config.protocol, config.port, name=config.name, baud=config.baud, options=config.options)
    driver = ReconnectingDevice(linked, tell)
    driver.open()
    assignment = dict(config.trackers) or {**IDENTITY_ASSIGNMENT, **linked.role_hints}
    if not config.trackers and not linked.role_hints:
        tell(
            f"{config.name}: the device does not say which tracker is on which limb, and neither does [device.trackers]"
            " in session.toml; `sixpoint doctor --assign` finds out"
        )
    turns = (config.room_yaw_deg, *config.room_tilt_deg)
    rotation = Rotation.from_euler("YXZ", turns, degrees=True).as_quat().tolist()
    room = RoomTransform(tuple(rotation), config.room_translation_m)
    spoken = linked.protocol
    gate, smoothing = filters_of(config, spoken.filters_itself)
    recorded = RecordedDevice(config.name, config.protocol, spoken.options(), assignment, room, gate, smoothing)
    return OpenDevice(driver, recorded)


def filters_of(config: DeviceConfig, filters_itself: bool) -> tuple[GateSettings, OneEuroSettings]:
    """What is done against outliers and noise. filters_itself: whether the device smooths its own output."""
    smooth = not filters_itself if config.smooth is None else config.smooth
    gate = GateSettings(config.max_speed_m_s, config.accept_after, config.min_quality, config.gate)
    cutoffs = (config.min_cutoff_hz, config.beta, config.speed_cutoff_hz)
    return gate, OneEuroSettings(*cutoffs, smooth, config.smooth_above_mm)


def start_recording(path: Path, config: SessionConfig, devices: Sequence[OpenDevice]) -> TakeRecorder:
    """A new take that knows the session and its devices. Raises FileError where it cannot be written."""
    told = {"session": commented_config(config)}
    if config.performer.profile:
        told[CALIBRATION] = profile_path(config.performer.profile).read_text(encoding="utf-8")
    recorder = TakeRecorder(path, told)
    for device in devices:
        recorder.add_device(device.recorded)
    return recorder


def make_pipeline(config: SessionConfig, progress: Progress = no_progress) -> Pipeline:
    """The solver on the configured database and body, what is shown when, and the character on it."""
    database = open_named_database(config.database.path, progress)
    if abs(config.solver.rate_hz - database.fps) > 0.01:
        raise SettingError(
            f"solver.rate_hz is {config.solver.rate_hz:g}, but the database has {database.fps:g} poses a second:"
            " set it to that, or build the database with --fps"
        )
    who = performer(database, config.performer.height_m, Path(p) if (p := config.performer.profile) else None)
    settings = SolverSettings(method=config.solver.method)
    reconstructor = Reconstructor(database, who.skeleton, settings, mounting=who.mounting)
    reference = average_pose(database, who.skeleton)
    clip = read_motion(config.show.clip) if config.show.clip else None
    director = make_director(who.skeleton, reference, clip)
    chosen = configured_cast(config.character, who.skeleton, reference)
    return Pipeline(reconstructor, chosen, director, deform_settings(config.character))


@contextmanager
def open_streams(config: SessionConfig, pipeline: Pipeline) -> Iterator[list[Callable[[Shot], None]]]:
    """What sends each shot to the configured addresses, closed at the end. Raises SettingError for a wrong address."""
    reconstructor = pipeline.reconstructor
    reference = average_pose(reconstructor.database, reconstructor.skeleton)
    with ExitStack() as stack:
        streams = [
            stack.enter_context(closing(open_stream(address, reconstructor.skeleton, reference)))
            for address in config.output.streams
        ]
        yield [lambda shot, to=to: to.send(shot.frame.time_s, shot.joints) for to in streams]


def make_session(
    config: SessionConfig,
    devices: Sequence[OpenDevice],
    pipeline: Pipeline | None,
    recorder: TakeRecorder | None,
    watchers: Sequence[Callable[[Shot], None]] = (),
    tell: Tell = lambda _: None,
) -> Session:
    """A session ready to run. tell: as `Session` has it."""
    if not devices:
        raise DeviceError("a session needs a device")
    clock = SessionClock()
    assembler = FrameAssembler(config.solver.rate_hz, config.solver.latency_ms / 1000, epoch_ns=clock.start_ns)
    taking = [device.session_device() for device in devices]
    tuning = Tuning(live_settings(taking, pipeline))
    return Session(taking, assembler, pipeline, clock, recorder, watchers, tuning, tell)


def live_settings(devices: Sequence[SessionDevice], pipeline: Pipeline | None) -> list[LiveSetting]:
    """All that can be changed while the session runs, by its name in `session.toml`."""
    of_devices = [s for device in devices for s in device_settings(device.driver.name, device.intake)]
    return [*of_devices, *(character_settings(pipeline) if pipeline else ())]
