"""The first session of somebody who has configured nothing: what can be found is found, the rest is asked."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from capture.asking import Asker, checked_answer
from capture.config import DeviceConfig, PerformerConfig, SessionConfig, commented_config
from capture.device_finding import FoundDevice, find_devices
from capture.diagnosis import listen
from capture.profiles import checked_name, list_profiles
from capture.progress import progress_bar
from devices.assignment import find_assignment
from devices.driver import Driver
from devices.errors import DeviceError, FileError
from devices.protocols import protocols
from devices.registry import make_device
from devices.sample import ROLES
from replay_logs.atomic_file import written_beside

SESSION_FILE = Path("session.toml")
_WALK_S = 6.0
_HEAR_S = 1.5


@dataclass(frozen=True)
class Plan:
    """What was found out. name: the performer's; calibrate: whether they have no profile, or want a new one."""

    config: SessionConfig
    name: str
    calibrate: bool


def plan_session(asker: Asker, given: DeviceConfig | None = None, profile: str | None = None) -> Plan:
    """Finds the device, or takes the one given, and asks for the rest. profile: the performer, where known.

    Raises DeviceError where there is no device, or it sends nothing.
    """
    device = given or choose_device(asker)
    device = with_roles(asker, device)
    if profile is not None:
        return Plan(_session(device, profile, None), profile, False)
    name, is_known = _performer(asker)
    if is_known and not asker.yes("Do the trackers sit as they did when you calibrated?"):
        is_known = False
    height_m = None if is_known else asker.number("Your height in metres, barefoot", 0.8, 2.5, 1.75)
    return Plan(_session(device, name if is_known else "", height_m), name, not is_known)


def choose_device(asker: Asker) -> DeviceConfig:
    """The tracker that is plugged in; asked only where there are several, or one that does not speak by itself."""
    with progress_bar("looking for trackers") as progress:
        found = find_devices(progress)
    if not found:
        raise DeviceError(
            "no tracker is plugged in: `sixpoint devices` lists what is there, `sixpoint simulate` plays one,"
            " and --device and --port name any port"
        )
    one = found[0] if len(found) == 1 else found[asker.choose("Which tracker?", [_words(f) for f in found])]
    protocol = one.protocol or _asked_protocol(asker, one)
    asker.say(f"{protocols()[protocol].title} at {one.port}")
    return DeviceConfig(protocol=protocol, port=one.port)


def with_roles(asker: Asker, device: DeviceConfig) -> DeviceConfig:
    """The device with who wears which tracker: as it says itself, or found out while the performer walks."""
    if device.trackers:
        return device
    opened = make_device(device.protocol, device.port, baud=device.baud, options=device.options)
    opened.open()
    try:
        seen = _seen(opened)
        if seen <= set(ROLES) or seen <= opened.role_hints.keys():
            return device
        return device.model_copy(update={"trackers": _walked(asker, opened)})
    finally:
        opened.close()


def save_session(asker: Asker, config: SessionConfig, path: Path = SESSION_FILE) -> Path | None:
    """Writes the session's file; one that is there is replaced only where that is wanted. None where it was not."""
    if path.exists() and not asker.yes(f"{path} is there already. Replace it?", default=False):
        return None
    try:
        with written_beside(path) as part:
            part.write_text(commented_config(config), encoding="utf-8")
    except OSError as error:
        raise FileError(f"{path}: cannot be written: {error.strerror}") from None
    asker.say(f"Saved as {path}: next time `sixpoint live` starts at once in this folder.")
    return path


def _words(found: FoundDevice) -> str:
    return f"{found.port}: {found.title}" if found.protocol else f"{found.port}: {found.title}, silent"


def _asked_protocol(asker: Asker, found: FoundDevice) -> str:
    serial = [p for p in protocols().values() if p.link == "serial"]
    return serial[asker.choose(f"What is at {found.port}? It says nothing by itself.", [p.title for p in serial])].name


def _performer(asker: Asker) -> tuple[str, bool]:
    """Who is performing, and whether they have a profile."""
    known = [performer.name for performer in list_profiles()]
    if known:
        chosen = asker.choose("Who is performing?", [*known, "somebody new"])
        if chosen < len(known):
            return known[chosen], True
    return checked_answer(asker, "Name of the performer", "me", checked_name), False


def _session(device: DeviceConfig, profile: str, height_m: float | None) -> SessionConfig:
    who = PerformerConfig(profile=profile) if height_m is None else PerformerConfig(profile=profile, height_m=height_m)
    return SessionConfig(performer=who, device=(device,))


def _seen(opened: Driver) -> set[str]:
    with progress_bar("listening to the trackers"):
        (samples,) = listen([opened], _HEAR_S)
    if not samples:
        raise DeviceError(f"{opened.name}: the device sends nothing; check power, baud rate and cable")
    return {sample.tracker for sample in samples if sample.position is not None}


def _walked(asker: Asker, opened: Driver) -> Mapping[str, str]:
    """Tracker -> role, by how they move, until the person agrees or says it tracker by tracker."""
    while True:
        asker.say("Put the trackers on, then walk straight ahead: sixpoint finds out which one is where.")
        if not asker.yes("Ready to walk?"):
            return _by_hand(asker, sorted(_seen(opened)))
        with progress_bar("walk straight ahead") as progress:
            (samples,) = listen([opened], _WALK_S, progress)
        try:
            found = find_assignment(samples)
        except DeviceError as error:
            asker.say(str(error))
            continue
        for tracker, role in found.roles.items():
            asker.say(f"  tracker {tracker}: {role.replace('_', ' ')}")
        if not found.walked:
            asker.say("You hardly walked, so left and right are guesses.")
        if asker.yes(f"Is that right? ({found.certainty:.0%} certain)", default=found.walked):
            return dict(found.roles)


def _by_hand(asker: Asker, trackers: Sequence[str]) -> Mapping[str, str]:
    """Each tracker's role, asked for."""
    roles: dict[str, str] = {}
    for tracker in trackers:
        left = [role for role in ROLES if role not in roles.values()]
        choices = [role.replace("_", " ") for role in left]
        chosen = asker.choose(f"Where is tracker {tracker}?", [*choices, "nowhere"])
        if chosen < len(left):
            roles[tracker] = left[chosen]
    return roles
