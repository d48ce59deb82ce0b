"""A live session from a simulated device's bytes on a real pseudo-terminal to vertices, timed stage by stage."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from capture.config import CharacterConfig, DatabaseConfig, DeviceConfig, OutputConfig, SessionConfig, SolverConfig
from capture.demo_take import trackers_on
from capture.going_live import live_figures, solve_live
from capture.latency import latency_table
from capture.library import open_named_database
from capture.soak import SoakMeter, figures, table
from devices.errors import SixpointError
from devices.sample import ROLES
from devices.simulators.pty_simulator import simulate_device
from reconstruction.motion_library import demo_motion

_STREAMS = ("vmc://127.0.0.1:39539", "vrchat://127.0.0.1:9000", "json://127.0.0.1:6060")
_START_S = 1.5


def bench_live(seconds: float, database: str, resolution: str, as_json: bool) -> None:
    """Prints what a session of `seconds` took, with six trackers at 60 Hz, recording and three streams on."""
    rate_hz = round(open_named_database(database).fps, 3)
    with _device(rate_hz) as port:
        start_s = _start_to_first_pose_s(port, database, resolution, rate_hz)
    meter = SoakMeter(seconds)
    with tempfile.TemporaryDirectory() as folder, _device(rate_hz) as port:
        config = bench_config(database, resolution, rate_hz, port)
        session = solve_live(
            config,
            Path(folder) / "bench.mcap",
            seconds,
            shown=False,
            watchers=[lambda shot: meter.add(shot.frame.time_s, shot.stages_ns.get("whole frame", 0) * 1e-6)],
        )
    told = live_figures(session) | {"start_to_first_pose_s": start_s, "waiting_ms": config.solver.latency_ms}
    summary = session.latencies.summary()
    if as_json:
        long = figures(meter.parts) if len(meter.parts) > 1 else {}
        print(json.dumps(told | {"milliseconds": summary, "by_tenths": long}))
        return
    from rich.console import Console

    Console().print(latency_table(summary))
    if seconds >= 60:
        Console().print(table(meter.parts))
    print(", ".join(f"{name} {value}" for name, value in told.items()))
    print("'last byte to vertices' begins when the last reading a frame needs is there, or it has waited long enough;")
    print("'moment to vertices' at the moment it shows: there is in it what the frame waits for, the next readings.")


def bench_config(database: str, resolution: str, rate_hz: float, port: str = "") -> SessionConfig:
    """A session with all that costs time: the mannequin's flesh at that resolution, and three streams."""
    return SessionConfig(
        database=DatabaseConfig(path=database),
        solver=SolverConfig(rate_hz=rate_hz),
        character=CharacterConfig.model_validate({"resolution": resolution}),
        device=(DeviceConfig(protocol="generic", port=port),),
        output=OutputConfig(streams=_STREAMS),
    )


@contextmanager
def _device(rate_hz: float) -> Iterator[str]:
    """The port of a simulated device with six trackers."""
    motion = trackers_on(demo_motion())
    with simulate_device(motion, "generic", roles=ROLES, rate_hz=rate_hz, loop=True) as device:
        yield device.path


def _start_to_first_pose_s(port: str, database: str, resolution: str, rate_hz: float) -> float:
    """Of `sixpoint live` in a process of its own, the second time: warm is with all caches, Python's own among them.

    Raises SixpointError with what it says where it fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        settings = Path(folder) / "session.toml"
        settings.write_text(
            f'database.path = "{database}"\nsolver.rate_hz = {rate_hz}\ncharacter.resolution = "{resolution}"\n'
        )
        command = [sys.executable, "-c", "from capture.cli import script; script()", "live", str(settings)]
        options = ["--port", port, "--no-window", "--seconds", str(_START_S), "--json"]
        # A shell may have told Python to keep no compiled modules: then they are kept here.
        kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
        kept["PYTHONPYCACHEPREFIX"] = str(Path(folder) / "modules")
        _, warm = (_told([*command, *options], kept) for _ in range(2))
    return warm["start_to_first_pose_s"]


def _told(command: list[str], environment: dict[str, str]) -> dict:
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SixpointError(f"sixpoint live does not start: {done.stderr.strip()}")
    return json.loads(done.stdout)
