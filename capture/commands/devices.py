"""`sixpoint devices`, `sixpoint simulate` and `sixpoint doctor`."""

import json
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from devices.simulators.paced_simulator import PacedSimulator
    from devices.simulators.source import SimulatedMotion

JsonOption = Annotated[bool, typer.Option("--json", help="Print as JSON.")]


def devices(as_json: JsonOption = False) -> None:
    """List the serial ports and HID devices of this machine, and the trackers that sixpoint can read."""
    from dataclasses import asdict

    from devices.hid_link import hid_ports, matches
    from devices.protocols import protocols
    from devices.serial_link import serial_ports

    known = protocols()
    hid = [
        (port, next((p.name for p in known.values() if any(matches(port, m) for m in p.hid)), None))
        for port in hid_ports()
    ]
    if as_json:
        listed = {
            "serial_ports": [asdict(port) for port in serial_ports()],
            "hid_devices": [asdict(port) | {"device": name} for port, name in hid],
            "devices": [
                {"name": p.name, "title": p.title, "link": p.link, "rate_hz": p.rate_hz, "checked": p.checked}
                for p in known.values()
            ],
        }
        print(json.dumps(listed))
        return
    print("Serial ports:")
    for port in serial_ports():
        print(f"  {port.path:<24} {port.description}")
    print("HID devices:")
    for port, name in hid:
        print(f"  {port.path:<24} {port.product} ({port.vendor_id:04x}:{port.product_id:04x}) {name or _no_use(port)}")
    print("Devices that sixpoint reads:")
    for p in known.values():
        print(f"  {p.name:<18} {p.link:<7} {p.rate_hz:>5.0f} Hz  {p.title} (checked: {p.checked})")


def _no_use(port: object) -> str:
    try:
        from devices.protocols.without_position import why_no_position  # type: ignore[import-not-found]
    except ImportError:
        return ""
    return why_no_position(port.vendor_id, port.product_id) or ""  # type: ignore[attr-defined]


def doctor(
    device: Annotated[str, typer.Argument(help="Which device; `sixpoint devices` lists them.")] = "generic",
    port: Annotated[str, typer.Option(help="Its port, or socket://host:port; empty to look for it.")] = "",
    baud: Annotated[int | None, typer.Option(help="Bits a second; else what the device prefers.")] = None,
    seconds: Annotated[float, typer.Option(min=2, max=3600, help="How long to listen.")] = 8.0,
    assign: Annotated[bool, typer.Option("--assign", help="Find who wears what: walk forward meanwhile.")] = False,
    roles: Annotated[str | None, typer.Option(help="With --assign: the roles that are worn, with commas.")] = None,
    option: Annotated[list[str] | None, typer.Option(help="The device's own: name=value; may be repeated.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Measure a device: rate, loss, jitter, noise at rest and clock drift of each tracker, with a verdict.

    Let the trackers lie still for a while for the noise, or walk straight ahead for `--assign`.
    """
    from capture.config import DeviceConfig
    from capture.diagnosis import listen
    from capture.progress import progress_bar
    from devices.assignment import find_assignment
    from devices.errors import DeviceError
    from devices.health import diagnose
    from devices.noise_meter import trembling
    from devices.protocols import option_from_text
    from devices.registry import make_device

    options = dict(option_from_text(device, text) for text in option or ())
    opened = make_device(device, port, baud=baud, options=options)
    worn = tuple(role.strip() for role in roles.split(",")) if roles else None
    opened.open()
    try:
        with progress_bar("walk straight ahead" if assign else "listening") as progress:
            (samples,) = listen([opened], seconds, progress)
    finally:
        opened.close()
    if not samples:
        raise DeviceError(f"{opened.link.where}: {opened.protocol.title} sends nothing; check power, baud rate, cable")
    counters = opened.protocol.counters
    trackers = diagnose(samples, opened.protocol.rate_hz, counters.missed)
    found = find_assignment(samples, worn) if assign else None
    smoothed = trembling(samples, DeviceConfig().smooth_above_mm)
    if as_json:
        report = {
            "device": device,
            "port": opened.link.where,
            "trackers": [tracker.figures() for tracker in trackers],
            "bytes_dropped": counters.bytes_dropped,
            "bad_frames": counters.bad_frames,
            "smoothing_lag_ms": _smoothing_lag_ms(opened.protocol.rate_hz),
            "smoothed_trackers": smoothed,
        }
        if found:
            report["assignment"] = {"roles": found.roles, "certainty": found.certainty, "walked": found.walked}
        print(json.dumps(report))
        return
    print(f"{opened.protocol.title} at {opened.link.where}")
    print("tracker   rate Hz   lost   jitter ms   noise mm   drift ppm   verdict")
    for t in trackers:
        print(
            f"{t.tracker:<8} {t.rate_hz:>8.1f} {t.lost:>6.1%} {t.jitter_ms:>11.2f} {_or_dash(t.noise_mm):>10}"
            f" {_or_dash(t.drift_ppm):>11}   {t.verdict}"
        )
    if counters.bytes_dropped or counters.bad_frames:
        print(f"{counters.bytes_dropped} stray bytes, {counters.bad_frames} damaged frames: check cable and baud rate")
    lag = _smoothing_lag_ms(opened.protocol.rate_hz)
    print("One-Euro smoothing delays by " + ", ".join(f"{ms:.0f} ms at {speed} m/s" for speed, ms in lag.items()))
    print(
        f"It is for what trembles more than {DeviceConfig().smooth_above_mm:g} mm: {', '.join(smoothed) or 'none here'}"
    )
    if found:
        print("\n[device.trackers]")
        for tracker, role in found.roles.items():
            print(f'"{tracker}" = "{role}"')
        sure = "" if found.walked else "; left and right are a guess: walk straight ahead next time"
        print(f"# certainty {found.certainty:.0%}{sure}")


def _smoothing_lag_ms(rate_hz: float) -> dict[str, float]:
    from devices.filters import OneEuroSettings, measured_lag_s

    settings = OneEuroSettings()
    return {str(speed): round(1000 * measured_lag_s(settings, speed, rate_hz), 1) for speed in (0.1, 0.5, 2.0)}


def _or_dash(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def align(
    device: Annotated[str, typer.Argument(help="The device whose place is sought.")],
    reference: Annotated[str, typer.Argument(help="The device whose axes are the room's.")],
    port: Annotated[str, typer.Option(help="Port of the device.")] = "",
    reference_port: Annotated[str, typer.Option(help="Port of the reference.")] = "",
    tracker: Annotated[str, typer.Option(help="The device's tracker in your hand.")] = "1",
    reference_tracker: Annotated[str, typer.Option(help="The reference's tracker in the same hand.")] = "1",
    seconds: Annotated[float, typer.Option(min=2, max=120, help="How long to wave.")] = 8.0,
    as_json: JsonOption = False,
) -> None:
    """Find where a second device stands: hold one tracker of each in one hand and draw large circles.

    Prints the place for session.toml, and by how much the two disagree when it is used.
    """
    from contextlib import ExitStack

    from scipy.spatial.transform import Rotation

    from capture.diagnosis import listen
    from capture.progress import progress_bar
    from devices.alignment import align as align_paths
    from devices.alignment import tracker_path
    from devices.registry import make_device

    pair = (make_device(device, port), make_device(reference, reference_port))
    with ExitStack() as closing, progress_bar("draw large circles") as progress:
        for opened in pair:
            opened.open()
            closing.callback(opened.close)
        waved, known = listen(pair, seconds, progress)
    found = align_paths(tracker_path(known, reference_tracker), tracker_path(waved, tracker))
    yaw, pitch, roll = Rotation.from_quat(found.room.rotation).as_euler("YXZ", degrees=True)
    if as_json:
        place = {"rotation_xyzw": found.room.rotation, "translation_m": found.room.translation}
        print(json.dumps(place | {"residual_mm": 1000 * found.residual_m, "used": found.used}))
        return
    x, y, z = found.room.translation
    print(f"room_translation_m = [{x:.3f}, {y:.3f}, {z:.3f}]")
    print(f"room_yaw_deg = {yaw:.1f}")
    print(f"room_tilt_deg = [{pitch:.1f}, {roll:.1f}]")
    print(f"# the trackers then keep {1000 * found.residual_m:.0f} mm from each other")


def simulate(
    motion: Annotated[Path, typer.Argument(help="A motion (.bvh, .amc), tracks (.csv) or a take (.mcap).")],
    device: Annotated[str, typer.Option(help="Which device to be; `sixpoint devices` lists them.")] = "generic",
    port: Annotated[Path | None, typer.Option(help="A fixed name for the port: a link is made there.")] = None,
    trackers: Annotated[str | None, typer.Option(help="Roles of trackers 1, 2, ..., with commas between.")] = None,
    rate: Annotated[float | None, typer.Option(min=1, max=2000, help="Measurements a second.")] = None,
    noise_mm: Annotated[float, typer.Option(min=0, help="Standard deviation of each coordinate.")] = 0.0,
    dropout: Annotated[float, typer.Option(min=0, max=0.95, help="Share of the time a tracker is not seen.")] = 0.0,
    garbage: Annotated[float, typer.Option(min=0, max=1, help="Share of packets with random bytes before.")] = 0.0,
    unplug_at: Annotated[float | None, typer.Option(min=0, help="Pull the cable out after so many seconds.")] = None,
    replug_after: Annotated[float, typer.Option(min=0, help="Put it back so many seconds later.")] = 2.0,
    loop: Annotated[bool, typer.Option("--loop", help="Play on, forwards and backwards, until interrupted.")] = False,
    option: Annotated[list[str] | None, typer.Option(help="The device's own: name=value; may be repeated.")] = None,
    seed: Annotated[int, typer.Option(help="Of noise, dropouts and garbage.")] = 0,
) -> None:
    """Be a tracker device: a motion's tracker positions as the device's bytes on a pseudo-terminal.

    A HID device is made through Linux's /dev/uhid instead, which mostly takes root; `--port` and `--garbage` are for
    serial devices. Prints the port to open, and begins when it is opened.
    """
    from devices.errors import SettingError
    from devices.protocols import make_protocol, option_from_text
    from devices.sample import ROLES
    from devices.simulators.pty_simulator import PtySimulator
    from devices.simulators.source import Faults, measurements
    from devices.simulators.uhid_simulator import UhidSimulator, identity_of

    options = dict(option_from_text(device, text) for text in option or ())
    chosen = make_protocol(device, **options)
    hid = chosen.link == "hid"
    if hid and (port or garbage):
        raise SettingError(f"device {device} is a HID device: --port and --garbage are for serial devices")
    rate_hz = rate or chosen.rate_hz
    roles = tuple(role.strip() for role in trackers.split(",")) if trackers else ROLES[: chosen.max_trackers]
    measured = _trackers_of(motion, roles, rate_hz)
    faults = Faults(noise_m=noise_mm / 1000, dropout=dropout, seed=seed)
    source = measurements(measured, rate_hz, faults, loop)
    simulated = chosen.simulator(roles)
    with (
        UhidSimulator(simulated, source, identity_of(chosen))
        if hid
        else PtySimulator(simulated, source, garbage=garbage, link=port, seed=seed)
    ) as simulator:
        print(port or simulator.path, flush=True)
        _play(simulator, unplug_at, replug_after)
        # The host still has to read what lies in the port.
        time.sleep(0.5)
    print(f"{simulator.samples_sent} samples, {simulator.bytes_sent} bytes sent")


def _play(simulator: "PacedSimulator", unplug_at: float | None, replug_after: float) -> None:
    """Until the motion ends, with the cable pulled and put back on the way."""
    simulator.started.wait()
    if unplug_at is not None and not simulator.finished.wait(unplug_at):
        simulator.unplug()
        print("unplugged", flush=True)
        time.sleep(replug_after)
        print(f"plugged in again: {simulator.replug()}", flush=True)
    simulator.finished.wait()


def _trackers_of(path: Path, roles: tuple[str, ...], fps: float) -> "SimulatedMotion":
    """Where the trackers of these roles are in a motion, tracks file or take.

    Raises SettingError for an unknown role, FileError for a file of another kind.
    """
    import numpy as np

    from devices.errors import FileError, choice_error
    from devices.sample import ROLES
    from devices.simulators.source import SimulatedMotion
    from reconstruction.motion_files import MOTION_ENDINGS

    for role in roles:
        if role not in ROLES:
            raise choice_error("tracker role", role, ROLES)
    kind = path.suffix.lower()
    if kind in (".csv", ".mcap"):
        from replay_logs.frames import load_frames

        frames = load_frames(path, fps)
        columns = [ROLES.index(role) for role in roles]
        positions = np.array([frame.positions[columns] for frame in frames])
        return SimulatedMotion(positions, fps, np.array([frame.orientations[columns] for frame in frames]))
    if kind not in MOTION_ENDINGS:
        raise FileError(f"{path}: simulate takes {', '.join(MOTION_ENDINGS)}, .csv or .mcap")
    return _trackers_of_motion(path, roles)


def _trackers_of_motion(path: Path, roles: tuple[str, ...]) -> "SimulatedMotion":
    from scipy.spatial.transform import Rotation

    from devices.simulators.source import SimulatedMotion
    from reconstruction.kinematics import world_joints
    from reconstruction.motion_files import read_motion

    motion = read_motion(path)
    positions, rotations = world_joints(motion.skeleton, motion.root_positions, motion.rotations)
    joints = [motion.skeleton.role_joint(role) for role in roles]
    chosen = rotations[:, joints]
    quaternions = Rotation.from_matrix(chosen.reshape(-1, 3, 3)).as_quat().reshape(*chosen.shape[:2], 4)
    return SimulatedMotion(positions[:, joints], motion.fps, quaternions)
