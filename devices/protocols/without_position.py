"""Devices people own and ask about that cannot be used here, since they give no position by themselves."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class WithoutPosition:
    """A device without positions. product_ids: empty means all of the vendor's that the title names."""

    title: str
    vendor_id: int | None
    product_ids: tuple[int, ...]
    reason: str


_LIGHTHOUSE = (
    "it sends the times of laser sweeps, and a place comes only of a lighthouse solver such as SteamVR or libsurvive"
)
_CAMERA = "its HID reports carry turns only; its place was seen by a camera"
_INERTIAL = "it measures turns and accelerations only"

WITHOUT_POSITION = (
    WithoutPosition(
        "SlimeVR receiver or tracker",
        0x1209,
        (0x7690, 0x7692),
        "its trackers measure turns only; the SlimeVR server makes places up from a skeleton's bone lengths",
    ),
    WithoutPosition(
        "HTC Vive tracker or wand, Tundra tracker",
        0x28DE,
        (0x2000, 0x2012, 0x2022, 0x2101, 0x2102, 0x2300),
        _LIGHTHOUSE,
    ),
    WithoutPosition("OSVR HDK", 0x1532, (0x0B00,), _CAMERA),
    WithoutPosition("OSVR HDK", 0x03EB, (0x2421,), _CAMERA),
    WithoutPosition(
        "PlayStation Move", 0x054C, (0x03D5, 0x0C5E), "its place is seen by the PlayStation Eye camera, not by itself"
    ),
    WithoutPosition("InterSense InterTrax, InertiaCube, IS-300", None, (), _INERTIAL),
    WithoutPosition("Perception Neuron", None, (), _INERTIAL),
    WithoutPosition("PlayStation VR headset", None, (), _INERTIAL),
)


def why_no_position(vendor_id: int, product_id: int) -> str | None:
    """One line on why this USB device gives no position; None where it is not known to give none."""
    for device in WITHOUT_POSITION:
        if device.vendor_id == vendor_id and product_id in device.product_ids:
            return f"{device.title} gives no position: {device.reason}"
    return None
