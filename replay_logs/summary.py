"""What is in a take: devices and their health, how much of the time each role was seen, marks, the session."""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from devices.driver import RawChunk
from devices.health import TrackerHealth, diagnose
from devices.intake import RoleReading
from devices.sample import ROLES, TrackerSample
from replay_logs.converting import role_readings
from replay_logs.span import Span
from replay_logs.take import RecordedDevice, Take

_GAP_PERIODS = 1.75
"""Readings farther apart than this many periods have lost one between them; as in `devices.track`."""
_INTERVALS = 31
"""The period is the median of so many intervals around: devices of other rates may follow on each other."""
_LEAST_GAP_S = 1e-3


@dataclass(frozen=True)
class DeviceSummary:
    """One device. opened: how often; lost_bytes: bytes that were of no good message; health: of each tracker."""

    name: str
    protocol: str
    trackers: dict[str, str]
    raw_bytes: int
    opened: int
    lost_bytes: int
    health: tuple[TrackerHealth, ...]


@dataclass(frozen=True)
class RoleSummary:
    """How much of the take one role was seen.

    rate_hz: readings a second while it was seen. seen: share of the time. dropouts: (start, end) seconds from the
    beginning of the take, in which readings are missing.
    """

    role: str
    readings: int
    rate_hz: float
    seen: float
    dropouts: tuple[tuple[float, float], ...]

    @property
    def longest_s(self) -> float:
        """Of the dropouts."""
        return max((end - start for start, end in self.dropouts), default=0.0)

    def timeline(self, duration_s: float, columns: int) -> NDArray[np.float64]:
        """(columns,) share of each equal stretch of the take in which the role was seen."""
        edges = np.linspace(0.0, duration_s, columns + 1)
        missing = np.zeros(columns)
        for start, end in self.dropouts:
            missing += np.clip(np.minimum(edges[1:], end) - np.maximum(edges[:-1], start), 0.0, None)
        return 1.0 - missing / max(duration_s / columns, 1e-9)


@dataclass(frozen=True)
class TakeSummary:
    """All that `sixpoint take info` tells. marks: (seconds, text); changes: (seconds, settings); session: what the
    session's file said that is not the default."""

    name: str
    duration_s: float
    software: str
    created: str
    devices: tuple[DeviceSummary, ...]
    roles: tuple[RoleSummary, ...]
    marks: tuple[tuple[float, str], ...]
    changes: tuple[tuple[float, dict[str, float | bool]], ...]
    missing: str | None
    trimmed: bool

    def figures(self) -> dict[str, object]:
        """All of it as plain values, for JSON."""
        return {
            "take": self.name,
            "duration_s": round(self.duration_s, 3),
            "software": self.software,
            "created": self.created,
            "missing": self.missing,
            "trimmed": self.trimmed,
            "devices": [
                {
                    "name": d.name,
                    "protocol": d.protocol,
                    "trackers": d.trackers,
                    "raw_bytes": d.raw_bytes,
                    "opened": d.opened,
                    "lost_bytes": d.lost_bytes,
                    "health": [health.figures() for health in d.health],
                }
                for d in self.devices
            ],
            "roles": [
                {
                    "role": r.role,
                    "readings": r.readings,
                    "rate_hz": round(r.rate_hz, 2),
                    "seen": round(r.seen, 4),
                    "dropouts": [[round(start, 3), round(end, 3)] for start, end in r.dropouts],
                    "longest_dropout_s": round(r.longest_s, 3),
                }
                for r in self.roles
            ],
            "marks": [{"time_s": round(at, 3), "text": text} for at, text in self.marks],
            "changes": [{"time_s": round(at, 3), "settings": values} for at, values in self.changes],
        }


def summarised(take: Take) -> TakeSummary:
    """What is in a take. Raises FileError where no tracker with a role was read."""
    readings, span = role_readings(take), Span.of(take)
    first_ns, last_ns = (span.from_ns, span.to_ns) if span else (readings[0].host_time_ns, readings[-1].host_time_ns)
    duration_s = (last_ns - first_ns) * 1e-9
    return TakeSummary(
        name=take.path.name,
        duration_s=duration_s,
        software=take.metadata.get("software", ""),
        created=take.metadata.get("created", ""),
        devices=tuple(_device(take, device) for device in take.devices),
        roles=tuple(_role(role, readings, first_ns, duration_s) for role in range(len(ROLES))),
        marks=tuple(((mark.time_ns - first_ns) * 1e-9, mark.text) for mark in take.marks),
        changes=tuple(((change.time_ns - first_ns) * 1e-9, dict(change.values)) for change in take.changes),
        missing=take.missing,
        trimmed=span is not None,
    )


def said_in_session(take: Take) -> dict[str, object]:
    """The `session.toml` that a take was recorded with, as nested tables; empty where it has none that can be read."""
    try:
        return tomllib.loads(take.metadata.get("session", ""))
    except tomllib.TOMLDecodeError:
        return {}


def _device(take: Take, device: RecordedDevice) -> DeviceSummary:
    protocol, chunks = device.make_protocol(), take.chunks[device.name]
    samples: list[TrackerSample] = []
    missed = lost = 0
    for chunk in (*chunks, RawChunk(0, b"")):
        if chunk.data:
            samples += protocol.feed(chunk.data, chunk.host_time_ns)
            continue
        missed, lost = missed + protocol.counters.missed, lost + protocol.counters.bytes_dropped
        protocol.reset()
    return DeviceSummary(
        device.name,
        device.protocol,
        dict(device.assignment),
        sum(len(chunk.data) for chunk in chunks),
        sum(not chunk.data for chunk in chunks),
        lost,
        tuple(diagnose(samples, protocol.rate_hz, missed)) if samples else (),
    )


def _role(role: int, readings: Sequence[RoleReading], first_ns: int, duration_s: float) -> RoleSummary:
    times = (np.array([r.host_time_ns for r in readings if r.role == role], np.int64) - first_ns) * 1e-9
    if not len(times):
        return RoleSummary(ROLES[role], 0, 0.0, 0.0, ((0.0, duration_s),))
    times = np.unique(times)
    intervals = np.diff(times)
    period_s = float(np.median(intervals)) if len(intervals) else 0.0
    edges = np.concatenate([[min(0.0, times[0])], times, [max(duration_s, times[-1])]])
    usual = np.pad(median_filter(intervals, _INTERVALS, mode="nearest"), 1, "edge") if len(intervals) else np.zeros(2)
    gaps = np.flatnonzero(np.diff(edges) > np.maximum(_GAP_PERIODS * usual, _LEAST_GAP_S))
    dropouts = tuple((float(edges[gap]), float(edges[gap + 1])) for gap in gaps)
    missing_s = sum(end - start for start, end in dropouts)
    seen_s = max(duration_s - missing_s, 0.0)
    rate_hz = 1 / period_s if period_s else 0.0
    return RoleSummary(ROLES[role], len(times), rate_hz, seen_s / duration_s if duration_s else 1.0, dropouts)
