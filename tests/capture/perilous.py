"""Work for other processes that may kill them; it imports nothing, so that they are up soon."""

import os
import signal
import time
from pathlib import Path


def perilous(job: str) -> str:
    """Is killed in its own way: `fine` is not, `once:FILE` dies if it has not yet, `always` dies, `slow` takes long."""
    kind, _, marker = job.partition(":")
    if kind == "slow":
        time.sleep(60)
    if kind == "always" or (kind == "once" and not Path(marker).exists()):
        if marker:
            Path(marker).touch()
        time.sleep(0.2)
        os.kill(os.getpid(), signal.SIGKILL)
    return f"{kind} done"
