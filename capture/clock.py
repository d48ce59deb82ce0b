"""The session's clock."""

import time
from dataclasses import dataclass, field


@dataclass
class SessionClock:
    """Seconds since the session's start, from the host's monotonic nanoseconds."""

    start_ns: int = field(default_factory=time.perf_counter_ns)

    def now_ns(self) -> int:
        """Host time, now: what readings are stamped with. It never goes back, whatever is done to the date."""
        return time.perf_counter_ns()

    def now_s(self) -> float:
        """Seconds since the start, now."""
        return self.seconds(self.now_ns())

    def seconds(self, host_time_ns: int) -> float:
        """Seconds since the start, at that host time."""
        return (host_time_ns - self.start_ns) * 1e-9
