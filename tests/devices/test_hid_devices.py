"""HID links: reports whole, devices that vanish or refuse, and what is said of those that cannot be opened."""

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from devices import hid_link
from devices.errors import DeviceError, DeviceLost
from devices.hid_link import HidLink, HidPort, matches
from devices.protocols import protocols
from devices.protocols.protocol import HidMatch


class FakeHidapi:
    """A `hidraw` module with one device, whose reports and failures a test sets."""

    def __init__(self, product_id: int = 0x0300) -> None:
        self.listed = [{"path": b"/dev/hidraw3", "vendor_id": 0x1532, "product_id": product_id, "interface_number": 0}]
        self.reports: list[bytes] = []
        self.openable = self.plugged = True
        self.written: list[bytes] = []

    def enumerate(self):
        return self.listed

    def device(self):
        return self

    def open_path(self, path):
        if not self.openable:
            raise OSError("open failed")

    def set_nonblocking(self, on):
        pass

    def read(self, size, timeout_ms=0):
        if not self.plugged:
            raise OSError("read error")
        return list(self.reports.pop(0)) if self.reports else []

    def write(self, data):
        self.written.append(data)
        return len(data) if self.plugged else -1

    send_feature_report = write

    def get_feature_report(self, report_id, size):
        raise OSError("no such report")

    def close(self):
        pass


@pytest.fixture
def hidapi(monkeypatch):
    fake = FakeHidapi()
    monkeypatch.setattr(hid_link, "_module", lambda name: fake if name == "hidraw" else None)
    return fake


WANTED = (HidMatch(0x1532, 0x0300, interface=0, report_size=52),)


def test_reports_come_whole_and_all_that_wait_at_once(hidapi):
    link = HidLink("", WANTED)
    link.open()
    hidapi.reports = [b"one", b"two", b"three"]
    assert link.read(0.1) == [b"one", b"two", b"three"]
    assert link.read(0.02) == []
    assert link.where == "/dev/hidraw3"


def test_an_unplugged_device_is_lost_and_opens_again(hidapi):
    link = HidLink("", WANTED)
    link.open()
    hidapi.plugged = False
    with pytest.raises(DeviceLost, match="gone"):
        link.read(0.1)
    with pytest.raises(DeviceLost, match="not open"):
        link.write(b"x")
    hidapi.plugged = True
    link.open()
    link.send_feature(b"\0\1")
    assert hidapi.written == [b"\0\1"]
    assert link.get_feature(2, 52) == b""
    link.close()


def test_what_cannot_be_opened_says_what_to_do(hidapi):
    hidapi.openable = False
    with pytest.raises(DeviceError, match=r"60-sixpoint\.rules"):
        HidLink("", WANTED).open()
    with pytest.raises(DeviceError, match="is not here; HID devices here:"):
        HidLink("/dev/hidraw9", WANTED).open()
    hidapi.listed = []
    with pytest.raises(DeviceError, match="HID devices here: none"):
        HidLink("", WANTED).open()


def test_a_refused_report_is_said_so(hidapi):
    link = HidLink("", WANTED)
    link.open()
    hidapi.plugged = False
    with pytest.raises(DeviceError, match="refuses"):
        link.send_feature(b"\0")


def test_matching_by_number_usage_and_interface():
    port = HidPort("/dev/hidraw0", "hidraw", 1, 2, "", "", 1, 0xFF00, 1)
    assert matches(port, HidMatch(1, 2))
    assert matches(port, HidMatch(usage_page=0xFF00, usage=1))
    assert not matches(port, HidMatch(1, 2, interface=0))
    assert not matches(port, HidMatch(usage_page=0xFF00, usage=2))


def test_another_package_called_hid_is_passed_over(monkeypatch):
    monkeypatch.setitem(sys.modules, "hid", SimpleNamespace(Device=object))
    assert hid_link._module("hid") is None


def test_the_udev_rules_name_every_hid_device_that_has_a_number():
    rules = Path(hid_link.__file__).with_name("60-sixpoint.rules").read_text()
    for protocol in protocols().values():
        for match in protocol.hid:
            if match.vendor_id is not None and match.product_id is not None:
                assert f'"{match.vendor_id:04x}", ATTRS{{idProduct}}=="{match.product_id:04x}"' in rules
