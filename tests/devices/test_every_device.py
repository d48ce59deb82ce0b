"""Every serial device, simulated on a real pseudo-terminal and read with real pyserial through its own start-up."""

import time
from dataclasses import replace
from itertools import groupby

import numpy as np
import pytest

from devices.protocols import protocols
from devices.registry import make_device
from devices.sample import ROLES
from devices.simulators.pty_simulator import simulate_device
from tests.devices.motions import waving

SERIAL = [name for name, protocol in protocols().items() if protocol.link == "serial"]
SECONDS = 0.6


@pytest.mark.parametrize("name", SERIAL)
def test_it_starts_streams_the_motion_and_stops(name):
    trackers = min(4, protocols()[name].max_trackers)
    motion = waving(trackers, SECONDS)
    # Within the reach of the shortest-ranged device.
    motion = replace(motion, positions=0.5 * motion.positions)
    with simulate_device(motion, name, roles=ROLES[:trackers]) as simulator:
        device = make_device(name, simulator.path)
        device.open()
        samples, end = [], time.perf_counter() + 20
        while not simulator.finished.is_set() and time.perf_counter() < end:
            samples += device.read(0.05).samples
        samples += device.read(0.05).samples
        device.close()
    assert device.protocol.counters.bytes_dropped == 0
    rows = [
        [s.position for s in group]
        for _, group in groupby(sorted(samples, key=lambda s: s.tracker), key=lambda s: s.tracker)
    ]
    assert len(rows) == trackers
    rate = protocols()[name].rate_hz
    for tracker, places in enumerate(rows):
        assert len(places) >= 0.3 * SECONDS * rate
        path = motion.positions[:, tracker]
        nearest = [min(np.linalg.norm(path - np.array(place), axis=1)) for place in places]
        assert max(nearest) < 0.01


def test_every_device_has_a_simulator_and_says_how_it_was_checked():
    for protocol in protocols().values():
        assert protocol.title
        assert protocol.checked
        assert protocol().simulator(ROLES[: min(2, protocol.max_trackers)])
