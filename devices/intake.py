"""From a device's samples to readings of roles in the world: which tracker is where, and where the device is."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from devices.arrival_clock import ArrivalClock
from devices.axes import Quaternion, Vector
from devices.clock_map import ClockMap
from devices.errors import choice_error
from devices.filters import GateSettings, OneEuroFilter, OneEuroSettings, OutlierGate
from devices.noise_meter import NoiseMeter
from devices.room import RoomTransform
from devices.sample import ROLES, SampleFlag, TrackerSample

_STAYS_SMOOTHED = 0.7
"""Smoothing that noise has switched on goes off again below this share of it: it does not flicker."""


@dataclass(frozen=True, slots=True)
class RoleReading:
    """Where a role was at a moment of host time.

    role: index into `ROLES`. position: (3,) metres, world; orientation: (x, y, z, w), world, or None.
    """

    role: int
    host_time_ns: int
    position: Vector
    orientation: Quaternion | None


def role_indices(assignment: Mapping[str, str]) -> dict[str, int]:
    """Tracker -> index into `ROLES` for tracker -> role. Raises SettingError for an unknown role."""
    for role in assignment.values():
        if role not in ROLES:
            raise choice_error("tracker role", role, ROLES)
    return {tracker: ROLES.index(role) for tracker, role in assignment.items()}


@dataclass
class DeviceIntake:
    """Turns one device's samples into role readings; trackers without a role, lost and held samples fall away.

    assignment: tracker -> role, such as {"1": "left_wrist"}. room: where the device stands. gate, smoothing: what is
    done against outliers and noise, None for nothing; both may be replaced between two samples. Readings get the
    host time at which they were taken, not that of their arrival: by the device's clock (`clock`) where it has one,
    else by the evenness of its beat. Raises SettingError for an unknown role.
    """

    assignment: Mapping[str, str]
    room: RoomTransform = field(default_factory=RoomTransform)
    gate: GateSettings | None = field(default_factory=GateSettings)
    smoothing: OneEuroSettings | None = None
    clock: ClockMap = field(default_factory=ClockMap)

    def __post_init__(self) -> None:
        self._roles = role_indices(self.assignment)
        self._gates: dict[str, OutlierGate] = {}
        self._filters: dict[str, OneEuroFilter] = {}
        self._beats: dict[str, ArrivalClock] = {}
        self._meters: dict[str, NoiseMeter] = {}

    @property
    def rejected(self) -> int:
        """Readings that the gate kept out."""
        return sum(gate.rejected for gate in self._gates.values())

    def readings(self, samples: Iterable[TrackerSample]) -> list[RoleReading]:
        """The readings of the samples that have a role and a position to be believed."""
        found = []
        for sample in samples:
            role = self._roles.get(sample.tracker)
            time_ns = sample.host_time_ns
            if sample.device_time_s is not None:
                time_ns = self.clock.host_ns(sample.device_time_s, time_ns)
            elif role is not None:
                time_ns = self._beats.setdefault(sample.tracker, ArrivalClock()).host_ns(time_ns, sample.sequence)
            if role is None or sample.position is None or sample.flags & SampleFlag.HELD:
                continue
            if self._believed(time_ns * 1e-9, sample):
                position, orientation = self._placed(sample.position, sample.orientation)
                position, orientation = self._smoothed(sample.tracker, time_ns * 1e-9, position, orientation)
                found.append(RoleReading(role, time_ns, position, orientation))
        return found

    def _believed(self, time_s: float, sample: TrackerSample) -> bool:
        if self.gate is None or not self.gate.on:
            return True
        gate = self._gates.get(sample.tracker)
        if gate is None:
            gate = self._gates[sample.tracker] = OutlierGate(self.gate)
        gate.settings = self.gate
        return gate(time_s, sample)

    def _smoothed(
        self, tracker: str, time_s: float, position: Vector, orientation: Quaternion | None
    ) -> tuple[Vector, Quaternion | None]:
        """Through the tracker's filter; one that is switched on begins where the tracker is."""
        if self.smoothing is None or not self._needs_smoothing(tracker, self.smoothing, time_s, position):
            self._filters.pop(tracker, None)
            return position, orientation
        smooth = self._filters.get(tracker)
        if smooth is None:
            smooth = self._filters[tracker] = OneEuroFilter(self.smoothing)
        smooth.settings = self.smoothing
        return smooth(time_s, position, orientation)

    def _needs_smoothing(self, tracker: str, settings: OneEuroSettings, time_s: float, position: Vector) -> bool:
        """Whether it is on, and the tracker trembles as much as it takes."""
        if not settings.on or not settings.noise_above_mm:
            return settings.on
        meter = self._meters.get(tracker)
        if meter is None:
            meter = self._meters[tracker] = NoiseMeter()
        meter.add(time_s, position)
        least_mm = settings.noise_above_mm * (_STAYS_SMOOTHED if tracker in self._filters else 1.0)
        return meter.sigma_m is not None and 1000 * meter.sigma_m > least_mm

    def _placed(self, position: Vector, orientation: Quaternion | None) -> tuple[Vector, Quaternion | None]:
        if self.room.is_identity:
            return position, orientation
        return self.room.point(position), self.room.orientation(orientation) if orientation else None


IDENTITY_ASSIGNMENT: Mapping[str, str] = {role: role for role in ROLES}
"""For sources that name their trackers by role: tracks files, simulated generic devices."""
