"""From a device's samples to readings of roles in the world: which tracker is where, and where the device is."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from devices.axes import Quaternion, Vector
from devices.errors import choice_error
from devices.room import RoomTransform
from devices.sample import ROLES, SampleFlag, TrackerSample


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

    assignment: tracker -> role, such as {"1": "left_wrist"}. Raises SettingError for an unknown role.
    """

    assignment: Mapping[str, str]
    room: RoomTransform = field(default_factory=RoomTransform)

    def __post_init__(self) -> None:
        self._roles = role_indices(self.assignment)

    def readings(self, samples: Iterable[TrackerSample]) -> list[RoleReading]:
        """The readings of the samples that have a role and a position."""
        moved = not self.room.is_identity
        found = []
        for sample in samples:
            role = self._roles.get(sample.tracker)
            if role is None or sample.position is None or sample.flags & SampleFlag.HELD:
                continue
            position, orientation = sample.position, sample.orientation
            if moved:
                position = self.room.point(position)
                orientation = self.room.orientation(orientation) if orientation else None
            found.append(RoleReading(role, sample.host_time_ns, position, orientation))
        return found


IDENTITY_ASSIGNMENT: Mapping[str, str] = {role: role for role in ROLES}
"""For sources that name their trackers by role: tracks files, simulated generic devices."""
