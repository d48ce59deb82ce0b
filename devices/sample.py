"""One reading of one tracker."""

from dataclasses import dataclass
from enum import IntFlag

ROLES = ("root", "head", "left_wrist", "right_wrist", "left_ankle", "right_ankle")
"""The tracker roles, in the order that every array over roles has."""


class SampleFlag(IntFlag):
    """What a device says of its own sample."""

    NONE = 0
    HELD = 1
    """Not measured now: the last value repeated."""
    ESTIMATED = 2
    """Position comes from a model inside the device, not from a measurement."""
    BUTTON = 4
    CHARGING = 8
    SUSPECT = 16
    """The device reports an error or distortion for this sample."""


@dataclass(frozen=True, slots=True)
class TrackerSample:
    """One reading of one tracker, already in metres and in right-handed, Y-up axes of the device's own room.

    tracker: the device's own name or number for it, as text ("1", "left_wrist").
    host_time_ns: `time.perf_counter_ns` when the last byte of the reading had arrived.
    position: (3,) metres, or None where the device gave none.
    orientation: (4,) unit quaternion (x, y, z, w), or None.
    device_time_s: the device's own clock, unwrapped, or None where it has none.
    sequence: the device's running number, or None.
    quality, battery: 0 to 1, or None where unknown.
    """

    tracker: str
    host_time_ns: int
    position: tuple[float, float, float] | None = None
    orientation: tuple[float, float, float, float] | None = None
    device_time_s: float | None = None
    sequence: int | None = None
    quality: float | None = None
    battery: float | None = None
    flags: SampleFlag = SampleFlag.NONE
