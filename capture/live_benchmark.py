"""A live session from a simulated device's bytes on a real pseudo-terminal to vertices, timed stage by stage."""

import json
import tempfile
from pathlib import Path

from capture.config import CharacterConfig, DatabaseConfig, DeviceConfig, OutputConfig, SessionConfig
from capture.demo_take import trackers_on
from capture.going_live import solve_live
from capture.latency import latency_table
from devices.sample import ROLES
from devices.simulators.pty_simulator import simulate_device
from reconstruction.motion_library import demo_motion

_STREAMS = ("vmc://127.0.0.1:39539", "vrchat://127.0.0.1:9000", "json://127.0.0.1:6060")


def bench_live(seconds: float, database: str, resolution: str, as_json: bool) -> None:
    """Prints what a session of `seconds` took, with six trackers at 60 Hz, recording and three streams on."""
    motion = trackers_on(demo_motion())
    with (
        tempfile.TemporaryDirectory() as folder,
        simulate_device(motion, "generic", roles=ROLES, rate_hz=60.0, loop=True) as device,
    ):
        config = SessionConfig(
            database=DatabaseConfig(path=database),
            character=CharacterConfig.model_validate({"resolution": resolution}),
            device=(DeviceConfig(protocol="generic", port=device.path),),
            output=OutputConfig(streams=_STREAMS),
        )
        session = solve_live(config, Path(folder) / "bench.mcap", seconds, shown=False)
    figures = {"poses": session.solved, "skipped": session.skipped, "waiting_ms": config.solver.latency_ms}
    summary = session.latencies.summary()
    if as_json:
        print(json.dumps(figures | {"milliseconds": summary}))
        return
    from rich.console import Console

    Console().print(latency_table(summary))
    print(", ".join(f"{name} {value}" for name, value in figures.items()))
    print(f"'moment to vertices' holds the {config.solver.latency_ms:g} ms that a frame waits for late samples")
