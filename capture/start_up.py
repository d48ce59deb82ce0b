"""How long this process has been at work."""

import os
import time
from pathlib import Path

_LOADED_NS = time.perf_counter_ns()


def process_age_s(host_time_ns: int) -> float:
    """Seconds from the start of this process to that host time; on other systems than Linux from loading this module.

    Linux tells it in its own ticks, hundredths of a second mostly.
    """
    since_loaded_s = (host_time_ns - _LOADED_NS) * 1e-9
    return _AGE_WHEN_LOADED_S + since_loaded_s


def _age_s() -> float:
    try:
        fields = Path("/proc/self/stat").read_text().rsplit(")", 1)[1].split()
        up_s = float(Path("/proc/uptime").read_text().split()[0])
        return max(0.0, up_s - int(fields[19]) / os.sysconf("SC_CLK_TCK"))
    except (OSError, IndexError, ValueError, AttributeError):
        return 0.0


_AGE_WHEN_LOADED_S = _age_s()
