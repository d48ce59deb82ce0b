"""Frames at the solver's rate from readings that come when they come. Pure: no threads, no clock of its own."""

from collections.abc import Iterable

import numpy as np

from devices.errors import SettingError
from devices.frame import TrackerFrame, frozen
from devices.intake import RoleReading
from devices.sample import ROLES
from devices.track import Track

_END_SLACK = 0.02
"""Share of a frame period by which the last frame may lie after the last reading: file times are rounded."""


_SILENT_S = 0.25
"""A role that is so far behind the others is not waited for; those late by less are."""


class FrameAssembler:
    """Frame k lies at start + k / rate_hz; each role is interpolated between the readings around it.

    rate_hz: frames a second. latency_s: how long a frame waits for late readings: what `frames` gives is at least this
    old. extrapolate_s: how far a role is carried past its newest reading when the next is later than that.
    start_ns: host time of frame 0, by default that of the first reading. first: number of the first frame that is made.
    epoch_ns: host time that `time_s` counts from, by default that of frame 0.
    """

    def __init__(
        self,
        rate_hz: float = 60.0,
        latency_s: float = 0.02,
        extrapolate_s: float = 0.025,
        start_ns: int | None = None,
        epoch_ns: int | None = None,
        first: int = 0,
    ) -> None:
        if not (rate_hz > 0 and latency_s >= 0 and extrapolate_s >= 0):
            raise SettingError("a frame rate must be above 0 Hz, latency and extrapolation at least 0 s")
        self.rate_hz = rate_hz
        self.latency_s = latency_s
        self.dropped = 0
        """Readings older than one of the same role before them, or than the start."""
        self._start_ns = start_ns
        self._epoch_ns = epoch_ns
        self._next = first
        self._tracks = [Track(1.05 / rate_hz, extrapolate_s) for _ in ROLES]

    def push(self, readings: Iterable[RoleReading]) -> None:
        """Takes readings in; those of one role in time order, those of different roles in any."""
        for reading in readings:
            if self._start_ns is None:
                self._start_ns = reading.host_time_ns
            time_s = (reading.host_time_ns - self._start_ns) * 1e-9
            if not self._tracks[reading.role].push(time_s, reading.position, reading.orientation):
                self.dropped += 1

    def complete(self) -> list[TrackerFrame]:
        """The frames for which no reading can come any more that would change them: every role that is being read has
        one at or after their moment. They need not wait. In the beginning, while roles turn up, all do."""
        newest = [track.newest_s for track in self._tracks if track.newest_s is not None]
        last = max(newest, default=0.0)
        if last < _SILENT_S:
            return []
        return self._up_to(min(time_s for time_s in newest if time_s >= last - _SILENT_S))

    def frames(self, until_ns: int) -> list[TrackerFrame]:
        """The frames that are due at host time `until_ns`, each `latency_s` after its moment."""
        if self._start_ns is None:
            return []
        return self._up_to((until_ns - self._start_ns) * 1e-9 - self.latency_s)

    def finish(self, last_ns: int) -> list[TrackerFrame]:
        """The frames still to come up to `last_ns`, the time of the last reading, without waiting any more."""
        if self._start_ns is None:
            return []
        return self._up_to((last_ns - self._start_ns) * 1e-9 + _END_SLACK / self.rate_hz)

    def _up_to(self, time_s: float) -> list[TrackerFrame]:
        made = []
        while self._next / self.rate_hz <= time_s:
            made.append(self._frame(self._next / self.rate_hz))
            self._next += 1
        return made

    def _frame(self, time_s: float) -> TrackerFrame:
        positions = np.full((len(ROLES), 3), np.nan)
        orientations = np.full((len(ROLES), 4), np.nan)
        states = np.zeros(len(ROLES), np.int8)
        for role, track in enumerate(self._tracks):
            place = track.at(time_s)
            track.forget_before(time_s)
            if place is not None:
                positions[role], orientation, states[role] = place
                if orientation is not None:
                    orientations[role] = orientation
        epoch_s = 0.0 if self._epoch_ns is None else ((self._start_ns or 0) - self._epoch_ns) * 1e-9
        return TrackerFrame(epoch_s + time_s, frozen(positions), frozen(orientations), frozen(states))
