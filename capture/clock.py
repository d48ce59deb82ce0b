"""Two clocks: the session's, which only runs, and the player's, which can be paused, stepped, sought and sped up."""

import time
from dataclasses import dataclass, field


@dataclass
class SessionClock:
    """Seconds since the session's start, from the host's monotonic nanoseconds."""

    start_ns: int = field(default_factory=time.perf_counter_ns)

    def now_s(self) -> float:
        """Seconds since the start, now."""
        return self.seconds(time.perf_counter_ns())

    def seconds(self, host_time_ns: int) -> float:
        """Seconds since the start, at that host time."""
        return (host_time_ns - self.start_ns) * 1e-9


class PlaybackClock:
    """Where the playing of a motion of `duration_s` stands. Pure: it is told the host time, it does not read it."""

    def __init__(self, duration_s: float, speed: float = 1.0, loop: bool = True) -> None:
        self.duration_s, self.speed, self.loop = duration_s, speed, loop
        self.playing = True
        self._at_s, self._since_s = 0.0, None  # type: tuple[float, float | None]

    def at(self, host_s: float) -> float:
        """Seconds into the motion at that host time; past the end it starts over, or stays there."""
        if self._since_s is None:
            self._since_s = host_s
        elapsed = (host_s - self._since_s) * self.speed if self.playing else 0.0
        return self._inside(self._at_s + elapsed)

    def seek(self, at_s: float, host_s: float) -> None:
        """Goes to that second of the motion."""
        self._at_s, self._since_s = min(max(at_s, 0.0), self.duration_s), host_s

    def toggle(self, host_s: float) -> None:
        """Plays, or pauses."""
        self.seek(self.at(host_s), host_s)
        self.playing = not self.playing

    def step(self, seconds: float, host_s: float) -> None:
        """Pauses and moves on, or back, by that much."""
        at = self.at(host_s)
        self.playing = False
        self.seek(at + seconds, host_s)

    def set_speed(self, speed: float, host_s: float) -> None:
        """Plays at that many times real time, from where it stands."""
        self.seek(self.at(host_s), host_s)
        self.speed = min(max(speed, 0.05), 16.0)

    def _inside(self, at_s: float) -> float:
        if self.loop and self.duration_s > 0 and at_s > self.duration_s:
            return at_s % self.duration_s
        return min(at_s, self.duration_s)
