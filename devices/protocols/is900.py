"""InterSense IS-900 and IS-600, which speak FASTRAK's language with more stations and items of their own.

Sources: the IS-900 user guide's protocol appendix; the VRPN driver.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from devices.protocols import fastrak
from devices.protocols._records import Item

ITEMS: Mapping[int, Item] = {
    **fastrak.ITEMS,
    18: Item("position", "3H", full_scale=3.0),
    19: Item("euler", "3H", full_scale=180.0),
    20: Item("quaternion", "4H", full_scale=1.0),
    21: Item("time_ms", "f"),
}
"""18 to 20 are packed into 14 bits a value, 18 in metres whatever the unit. Joystick, buttons, status are not read."""


@dataclass
class Is900(fastrak.Fastrak):
    """An IS-900 or IS-600 with up to 12 stations. Options as FASTRAK's; 21 in `items` adds the device's clock."""

    name: ClassVar[str] = "is900"
    title: ClassVar[str] = "InterSense IS-900 / IS-600"
    rate_hz: ClassVar[float] = 60.0
    max_trackers: ClassVar[int] = 12

    stations: ClassVar[str] = "123456789ABC"
    table: ClassVar[Mapping[int, Item]] = ITEMS
    endings: ClassVar[tuple[int, ...]] = (0, 1, 20)
    flagging: ClassVar[bool] = False

    def simulator(self, roles: Sequence[str]) -> fastrak.SimulatedFastrak:
        return fastrak.SimulatedFastrak(self, len(roles), status="4.00  INTERSENSE IS-900", status_size=54)
