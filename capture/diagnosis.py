"""Listening to open devices for some seconds, for `sixpoint doctor` and `sixpoint align`."""

import time
from collections.abc import Sequence

from devices.driver import Driver
from devices.progress import Progress, no_progress
from devices.sample import TrackerSample

_READ_S = 0.01
_WARM_UP_S = 0.3


def listen(devices: Sequence[Driver], seconds: float, progress: Progress = no_progress) -> list[list[TrackerSample]]:
    """What each open device says in that time, without what piled up before. Raises DeviceLost where one is gone."""
    warm = time.perf_counter() + _WARM_UP_S
    while time.perf_counter() < warm:
        for device in devices:
            device.read(_READ_S)
    heard: list[list[TrackerSample]] = [[] for _ in devices]
    begin = time.perf_counter()
    while (passed := time.perf_counter() - begin) < seconds:
        for device, samples in zip(devices, heard, strict=True):
            samples += device.read(_READ_S).samples
        progress(round(10 * passed), round(10 * seconds))
    return heard
