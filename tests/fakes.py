"""Stand-ins for what tests have no hardware or no time for."""

import time

from devices.driver import RawChunk, Reading
from devices.errors import DeviceError
from devices.protocols import make_protocol
from devices.sample import ROLES, TrackerSample


class FakeDriver:
    """A device that gives each reading of a list once, then nothing; or fails to open.

    before: what is done by the number of the reading that comes next.
    """

    def __init__(self, readings=(), name="fake", broken=False, before=None):
        self.name, self.broken, self.before = name, broken, dict(before or {})
        self._given = 0
        self.closed = 0
        self._readings = list(readings)

    def open(self):
        if self.broken:
            raise DeviceError(f"{self.name} is broken: mend it")

    def read(self, timeout_s):
        if self._readings:
            self.before.get(self._given, lambda: None)()
            self._given += 1
            return self._readings.pop(0)
        time.sleep(min(timeout_s, 0.005))
        return Reading()

    def close(self):
        self.closed += 1


def wait_until(true, seconds=10.0):
    """Until that holds, for what another thread does."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "it never came"
        time.sleep(0.001)


def readings_now(count, rate_hz=200.0, roles=ROLES):
    """Readings of all roles, named by role, one after another in host time from now; raw bytes number them."""
    start = time.perf_counter_ns()
    made = []
    for number in range(count):
        at = start + round(number / rate_hz * 1e9)
        samples = tuple(TrackerSample(role, at, (float(i), 1.0, number / rate_hz)) for i, role in enumerate(roles))
        made.append(Reading((RawChunk(at, b"%d;" % number),), samples))
    return made


def generic_readings(count, rate_hz=200.0):
    """What a `generic` device with six shaking trackers gives, bytes and the samples decoded from them."""
    source, parser = make_protocol("generic"), make_protocol("generic")
    simulated = source.simulator(ROLES)
    start = time.perf_counter_ns()
    made = []
    for number in range(count):
        at = start + round(number / rate_hz * 1e9)
        told = [
            TrackerSample(str(i), at, (0.01 * ((7 * number + i) % 5), 1.0, 0.1 * i), None, number / rate_hz)
            for i, _ in enumerate(ROLES, 1)
        ]
        data = b"".join(simulated.measure(told))
        made.append(Reading((RawChunk(at, data),), tuple(parser.feed(data, at))))
    return made
