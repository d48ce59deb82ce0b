"""The real `hidraw` module of hidapi on devices that umockdev describes to it: nothing of ours stands in between."""

import json
import shutil
import struct
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from devices.protocols import make_protocol
from devices.protocols.generic_hid import GenericHid
from devices.protocols.generic_records import COMMAND, COMMAND_TYPE, INFO_TYPE, START
from devices.protocols.hydra import Hydra, mode_report
from devices.simulators.source import measurements
from tests.devices.motions import waving

pytestmark = pytest.mark.skipif(shutil.which("umockdev-run") is None, reason="umockdev-run is not installed")

ROOT = Path(__file__).parents[2]
NODE = "/dev/hidraw0"

READ = """
import json, sys, time
from devices.hid_link import hid_ports
from devices.registry import make_device
device = make_device(sys.argv[1])
device.open()
samples, end = [], time.perf_counter() + 5
while len(samples) < int(sys.argv[2]) and time.perf_counter() < end:
    samples += device.read(0.2).samples
device.close()
print(json.dumps({"ports": [port.product for port in hid_ports()], "where": device.link.where,
                  "samples": [[s.tracker, s.position, s.orientation] for s in samples]}))
"""


@dataclass(frozen=True)
class Described:
    """A HID device as umockdev is told of it. controls: ioctl records after those that tell the report descriptor."""

    vendor_id: int
    product_id: int
    product: str
    descriptor: bytes
    controls: tuple[str, ...]

    def tree(self) -> str:
        """The nodes of /sys, from the USB device to hidraw."""
        usb = "/devices/pci0000:00/0000:00:14.0/usb1/1-1"
        hid = f"{usb}/1-1:1.0/0003:{self.vendor_id:04X}:{self.product_id:04X}.0001"
        return (
            f"P: {usb}\nE: DEVTYPE=usb_device\nE: SUBSYSTEM=usb\nA: idVendor={self.vendor_id:04x}\\n\n"
            f"A: idProduct={self.product_id:04x}\\n\nA: bcdDevice=0200\\n\nA: product={self.product}\\n\n\n"
            f"P: {usb}/1-1:1.0\nE: DEVTYPE=usb_interface\nE: SUBSYSTEM=usb\nA: bInterfaceNumber=00\\n\n\n"
            f"P: {hid}\nE: SUBSYSTEM=hid\nE: HID_ID=0003:{self.vendor_id:08X}:{self.product_id:08X}\n"
            f"E: HID_NAME={self.product}\nE: HID_UNIQ=\nH: report_descriptor={self.descriptor.hex().upper()}\n\n"
            f"P: {hid}/hidraw/hidraw0\nN: hidraw0\nE: DEVNAME={NODE}\nE: SUBSYSTEM=hidraw\nL: device=../..\n\n"
        )

    def ioctls(self) -> str:
        size = struct.pack("<I", len(self.descriptor))
        described = size + self.descriptor.ljust(4096, b"\0")
        records = (f"HIDIOCGRDESCSIZE 0 {size.hex().upper()}", f"HIDIOCGRDESC 0 {described.hex().upper()}")
        return "\n".join((f"@DEV {NODE}", *records, *self.controls, ""))


def script(reports: list[bytes], first_after_ms: int) -> bytes:
    """Reports every 4 ms as umockdev plays them: control characters and `^` are written with a `^`."""
    escape = {**{byte: b"^" + bytes([byte + 64]) for byte in range(32)}, ord("^"): b"^`"}
    waits = [first_after_ms] + [4] * (len(reports) - 1)
    lines = [
        b"r %d %b\n" % (wait, b"".join(escape.get(byte, bytes([byte])) for byte in report))
        for wait, report in zip(waits, reports, strict=True)
    ]
    return b"d 0 " + NODE.encode() + b"\n" + b"".join(lines)


def read_through_hidraw(folder: Path, device: Described, played: bytes, protocol: str, count: int) -> dict:
    """What a process that sees the described device reads of it."""
    (folder / "tree").write_text(device.tree())
    (folder / "ioctls").write_text(device.ioctls())
    (folder / "script").write_bytes(played)
    command = ["umockdev-run", "-d", folder / "tree", "-i", f"{NODE}={folder}/ioctls", "-s", f"{NODE}={folder}/script"]
    child = [sys.executable, "-c", READ, protocol, str(count)]
    done = subprocess.run([*command, "--", *child], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def told_and_reports(protocol_name: str, trackers: int, cycles: int) -> tuple[list, list[bytes]]:
    simulated = make_protocol(protocol_name).simulator(["left_wrist", "right_wrist"][:trackers])
    simulated.streaming = True
    told, reports = [], []
    for _, samples in list(measurements(waving(trackers, 1.0), 60))[:cycles]:
        told += samples
        reports += simulated.measure(samples)
    return told, reports


def check(read: list, told: list, tolerance_m: float) -> None:
    assert len(read) == len(told)
    for (tracker, position, orientation), sample in zip(read, told, strict=True):
        assert tracker == sample.tracker
        assert position == pytest.approx(sample.position, abs=tolerance_m)
        assert orientation == pytest.approx(sample.orientation, abs=1e-3)


def test_the_hydra_is_found_switched_to_motion_and_read(tmp_path):
    told, reports = told_and_reports("hydra", 2, cycles=30)
    motion = mode_report(motion=True).hex().upper()
    hydra = Described(0x1532, 0x0300, "Razer Hydra", Hydra.report_descriptor, (f"HIDIOCSFEATURE 91 {motion}",))
    # The first report comes after start-up has listened in vain for a second and sent the feature report, and is used
    # up by finding that this has worked.
    read = read_through_hidraw(tmp_path, hydra, script(reports, first_after_ms=1100), "hydra", len(told) - 2)
    assert (read["ports"], read["where"]) == (["Razer Hydra"], NODE)
    check(read["samples"], told[2:], 6e-4)


def test_a_generic_hid_device_is_found_by_its_reports_and_read(tmp_path):
    protocol = make_protocol("generic-hid")
    told, reports = told_and_reports("generic-hid", 2, cycles=30)
    info = protocol.simulator(["left_wrist", "right_wrist"]).get_feature(INFO_TYPE, 52)
    start = COMMAND.pack(COMMAND_TYPE, START, round(protocol.rate_hz))
    device = Described(
        0x1209,
        0x0001,
        "diy trackers",
        GenericHid.report_descriptor,
        (f"HIDIOCGFEATURE 52 {info.hex().upper()}", f"HIDIOCSFEATURE {len(start)} {start.hex().upper()}"),
    )
    read = read_through_hidraw(tmp_path, device, script(reports, first_after_ms=20), "generic-hid", len(told))
    check(read["samples"], told, 1e-6)
