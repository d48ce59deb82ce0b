"""`session.toml`: what a live session is, validated as a whole, every wrong key named with its line."""

import re
import tomllib
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from devices.errors import FileError, SettingError
from devices.sample import ROLES

MaterialRegion = Literal["head", "chest", "belly", "hips", "arms", "legs"]
Role = Literal["root", "head", "left_wrist", "right_wrist", "left_ankle", "right_ankle"]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)


class PerformerConfig(_Section):
    """Who is captured."""

    height_m: Annotated[float, Field(ge=0.8, le=2.5)] = 1.75
    """Stature in metres, barefoot; the database's skeleton is scaled to it."""
    profile: str = ""
    """A name or file of `sixpoint calibrate`: body size and how the trackers sit; then the height is not used."""


class DatabaseConfig(_Section):
    """What poses the solver knows."""

    path: str = "library"
    """A folder made by `sixpoint database build`, or `library` for the one that comes with sixpoint."""


class SolverConfig(_Section):
    """How poses are solved."""

    rate_hz: Annotated[float, Field(ge=10, le=240)] = 60.0
    """Poses a second; as many as the database has."""
    latency_ms: Annotated[float, Field(ge=0, le=200)] = 25.0
    """How long a frame waits at most for samples that are late, in milliseconds."""
    method: Literal["default", "paper"] = "default"
    """`paper` is the reconstruction paper to the letter."""


class CharacterConfig(_Section):
    """What is shown."""

    mesh: str = "mannequin"
    """`mannequin`, or the path of an OBJ, PLY, GLB or VRM character."""
    resolution: Literal["low", "medium", "high"] = "medium"
    """The mannequin's: about 7,000, 13,000 or 28,000 vertices."""
    examples: str = ""
    """Example shapes, .toml; otherwise `NAME.examples.toml` beside the mesh, if it is there."""
    painting: str = ""
    """What is painted on it, .npz or .toml; otherwise `NAME.painting.npz` or `.toml` beside the mesh, if there."""
    particles: Annotated[int, Field(ge=300, le=6000)] = 1900
    """How fine the lattice is: about so many particles. Changed while running, it is bound anew meanwhile."""
    region_half_width: Annotated[int, Field(ge=1, le=5)] = 2
    """How far flesh moves as one, in lattice cells. Changed while running, it is bound anew meanwhile."""
    secondary: bool = True
    """Whether the flesh swings."""
    delta: Annotated[float, Field(ge=0, le=0.95)] = 0.6
    """Share of the flesh's own motion in what is shown; 0 is the skin alone."""
    frequency_hz: Annotated[float, Field(ge=0.5, le=12)] = 4.5
    """How fast soft flesh swings, in hertz."""
    damping_ratio: Annotated[float, Field(ge=0, le=2)] = 0.3
    """How soon it stops: 0 swings on, 1 does not overshoot."""
    gravity_m_s2: Annotated[float, Field(ge=0, le=20)] = 0.0
    """A pull downwards beside the one the mesh was modelled under, in metres a second squared."""
    volume: bool = True
    """Whether each part of the body keeps its volume."""
    softness: dict[MaterialRegion, Annotated[float, Field(ge=0, le=3)]] = {}
    """Factors on the softness of `head`, `chest`, `belly`, `hips`, `arms`, `legs`, such as `{ belly = 1.5 }`."""


class DeviceConfig(_Section):
    """One device: how to reach it, how it stands in the room, and who wears its trackers."""

    name: str = "trackers"
    protocol: str = "generic"
    """A name that `sixpoint devices` lists."""
    port: str = ""
    """`/dev/ttyUSB0`, `COM3`, `socket://host:port`, or empty to look for the device."""
    baud: Annotated[int, Field(ge=300, le=12_000_000)] | None = None
    """Bits a second; empty for what the protocol prefers."""
    trackers: dict[str, Role] = {}
    """The device's own tracker number or name to a role; empty where the device says it itself."""
    options: dict[str, bool | int | float | str] = {}
    """The protocol's own options, such as `{ full_scale_in = 144 }`; docs/devices has them."""
    smooth: bool | None = None
    """Whether noise is smoothed (One-Euro); empty for: unless the device does so itself."""
    smooth_above_mm: Annotated[float, Field(ge=0, le=50)] = 2.0
    """Of smoothing: only trackers whose noise at rest is measured above this, in millimetres; 0 is all of them."""
    min_cutoff_hz: Annotated[float, Field(ge=0.1, le=50)] = 4.0
    """Of smoothing: the cut-off at rest, in hertz; lower is calmer and later."""
    beta: Annotated[float, Field(ge=0, le=500)] = 60.0
    """Of smoothing: how many hertz the cut-off gains for each m/s (for turns each rad/s); higher is less delay."""
    speed_cutoff_hz: Annotated[float, Field(ge=0.1, le=50)] = 5.0
    """Of smoothing: the cut-off of the speed that it goes by, in hertz."""
    gate: bool = True
    """Whether readings that cannot be are kept out: jumps, poor quality, what the device itself doubts."""
    max_speed_m_s: Annotated[float, Field(ge=1, le=100)] = 25.0
    """Of the gate: a faster jump is not believed, in metres a second."""
    accept_after: Annotated[int, Field(ge=1, le=120)] = 5
    """Of the gate: so many readings in a row at a new place prove the jump right."""
    min_quality: Annotated[float, Field(ge=0, le=1)] = 0.05
    """Of the gate: readings below it are dropped, where the device tells a quality."""
    room_translation_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where the device's origin lies in the room, metres."""
    room_yaw_deg: Annotated[float, Field(ge=-360, le=360)] = 0.0
    """How far the device's axes are turned about the vertical, degrees."""
    room_tilt_deg: tuple[float, float] = (0.0, 0.0)
    """How far they are pitched and rolled after that, degrees; `sixpoint align` finds all three."""


class ShowConfig(_Section):
    """What is shown besides the performer."""

    clip: str = ""
    """A motion (.bvh, .amc) that the key C, or `clip` over OSC, plays in the performer's place."""
    osc_port: Annotated[int, Field(ge=0, le=65535)] = 0
    """The UDP port on which `/sixpoint/act`, `set`, `record`, `mark`, `poke` are obeyed (docs/window.md); 0 is off."""


class OutputConfig(_Section):
    """Where poses go while they are made."""

    streams: tuple[str, ...] = ()
    """Addresses such as `vmc://127.0.0.1:39539`, `vrchat://127.0.0.1:9000`, `json://127.0.0.1:6060`."""


class RecordConfig(_Section):
    """What is kept."""

    folder: str = "takes"
    """Where takes go when no name is given."""


class SessionConfig(_Section):
    """The whole of `session.toml`."""

    performer: PerformerConfig = PerformerConfig()
    database: DatabaseConfig = DatabaseConfig()
    solver: SolverConfig = SolverConfig()
    character: CharacterConfig = CharacterConfig()
    record: RecordConfig = RecordConfig()
    show: ShowConfig = ShowConfig()
    output: OutputConfig = OutputConfig()
    device: tuple[DeviceConfig, ...] = ()


def read_config(path: str | Path) -> SessionConfig:
    """The configuration in a TOML file. Raises FileError (not there, not TOML) or SettingError (every wrong key)."""
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
        values = tomllib.loads(text)
    except FileNotFoundError:
        raise FileError(f"{path}: no such file; `sixpoint config init` writes one to start from") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise FileError(f"{path}: not TOML: {error}") from None
    try:
        return SessionConfig.model_validate(values)
    except ValidationError as error:
        problems = [_problem(path, text, dict(item)) for item in error.errors()]
        raise SettingError("; ".join(problems)) from None


def _problem(path: Path, text: str, item: dict) -> str:
    """One wrong key as `file:line: key: what is wrong`."""
    keys = [str(k) for k in item["loc"]]
    shown = ".".join(keys)
    where = f"{path}:{line_of(text, keys)}"
    if item["type"] == "extra_forbidden":
        return f"{where}: unknown key {shown!r}: use {', '.join(_allowed(keys[:-1]))}"
    if keys[0] == "device" and "trackers" in keys and item["type"] == "literal_error":
        return f"{where}: {shown}: unknown tracker role {item['input']!r}: use {', '.join(ROLES)}"
    return f"{where}: {shown}: {item['msg'].lower()}, not {item['input']!r}"


def _allowed(keys: list[str]) -> list[str]:
    """The keys that may stand in the section at that place."""
    sections = {name: field.annotation for name, field in SessionConfig.model_fields.items() if name != "device"} | {
        "device": DeviceConfig
    }
    model = sections.get(keys[0], SessionConfig) if keys else SessionConfig
    return list(model.model_fields)  # type: ignore[union-attr]


def line_of(text: str, keys: list[str]) -> int:
    """The line, from 1, on which the innermost of these nested keys stands, or else that of its section."""
    best, section, counts = 1, [], {}
    for number, line in enumerate(text.splitlines(), 1):
        header = re.match(r"\s*\[(\[?)\s*([^\]]+?)\s*\]", line)
        if header:
            section = [part.strip().strip("\"'") for part in header[2].split(".")]
            if header[1]:
                counts[section[0]] = counts.get(section[0], -1) + 1
            if section[0] in counts:
                section.insert(1, str(counts[section[0]]))
            full = section
        else:
            key = re.match(r"\s*([\w.\-\"']+)\s*=", line)
            if not key:
                continue
            full = section + [part.strip("\"'") for part in key[1].split(".")]
        if full == keys[: len(full)]:
            best = number
            if len(full) == len(keys):
                break
    return best


def commented_config(config: SessionConfig | None = None) -> str:
    """A `session.toml` with every key, at its default where the configuration has no other, its meaning above it."""
    config = config or SessionConfig()
    lines = ["# A sixpoint session. Every key may be left out; what stands here is the default.", ""]
    for name in SessionConfig.model_fields:
        is_list = name == "device"
        for section in config.device or (DeviceConfig(),) if is_list else (getattr(config, name),):
            lines += [f"# {(type(section).__doc__ or '').strip()}", "[[device]]" if is_list else f"[{name}]"]
            lines += [*_keys(section), ""]
    return "\n".join(lines)


def _keys(section: BaseModel) -> list[str]:
    lines = []
    for key, field in type(section).model_fields.items():
        lines += [f"# {field.description}{_range(field.metadata)}"] if field.description else []
        value = getattr(section, key)
        lines.append(f"# {key} =" if value is None else f"{key} = {_toml(value)}")
    return lines


def _range(metadata: list) -> str:
    bounds = {type(item).__name__: item for item in metadata}
    return f" Range {bounds['Ge'].ge} to {bounds['Le'].le}." if {"Ge", "Le"} <= bounds.keys() else ""


def _toml(value: object) -> str:
    import tomlkit

    if isinstance(value, dict):
        table = tomlkit.inline_table()
        table.update({key: list(item) if isinstance(item, tuple) else item for key, item in value.items()})
        return table.as_string()
    return tomlkit.item(list(value) if isinstance(value, tuple) else value).as_string()
