"""The `sixpoint` command: puts the command groups together and turns every error into one line."""

import errno
import os
import sys
from collections.abc import Callable
from importlib.metadata import version
from typing import Annotated

import typer
from typer.exceptions import Abort, TyperException

from capture.commands import bench, bench_reconstruct, config, database, database_fetch, evaluate, take, transition
from capture.commands.batch import batch
from capture.commands.calibrate import calibrate
from capture.commands.deform import deform
from capture.commands.demo import demo
from capture.commands.devices import align, devices, doctor, simulate
from capture.commands.evaluate_calibration import calibration
from capture.commands.evaluate_dropouts import dropouts
from capture.commands.live import live, record
from capture.commands.reconstruct import reconstruct
from capture.commands.replay import replay
from capture.commands.rig import inbetween, rig
from capture.commands.stream import stream
from devices.errors import SixpointError

app = typer.Typer(
    name="sixpoint",
    help="Full-body performance capture from a few positional trackers.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def _tell_version(asked: bool) -> None:
    if asked:
        print(f"sixpoint {version('sixpoint')}")
        raise typer.Exit


@app.callback()
def _root(
    told: Annotated[
        bool, typer.Option("--version", callback=_tell_version, is_eager=True, help="Tell the version.")
    ] = False,
) -> None:
    pass


def _group(name: str, meaning: str, commands: list[tuple[str, Callable[..., None]]]) -> None:
    group = typer.Typer(help=meaning, no_args_is_help=True)
    for title, command in commands:
        group.command(title)(command)
    app.add_typer(group, name=name)


_COMMANDS = (
    demo,
    replay,
    live,
    record,
    calibrate,
    reconstruct,
    batch,
    deform,
    rig,
    inbetween,
    transition.transition,
    stream,
)
_DEVICE_COMMANDS = (devices, doctor, align, simulate)
for command in (*_COMMANDS, *_DEVICE_COMMANDS):
    app.command()(command)
_group(
    "database",
    "Motion databases: what the solver knows.",
    [("build", database.build), ("fetch", database_fetch.fetch), ("info", database.info)],
)
_group(
    "take",
    "Recorded takes: what is in them, parts, sums and other forms of them.",
    [("info", take.info), ("trim", take.trim), ("merge", take.merge), ("convert", take.convert)],
)
_group(
    "evaluate",
    "The papers' experiments on given data.",
    [
        ("tables", evaluate.tables),
        ("actions", evaluate.actions),
        ("transitions", transition.evaluate_transitions),
        ("calibration", calibration),
        ("dropouts", dropouts),
    ],
)
_group(
    "bench",
    "The speeds, measured here and now.",
    [
        ("reconstruct", bench_reconstruct.reconstruct),
        ("deform", bench.deform),
        ("rig", bench.rig),
        ("live", bench.live),
        ("soak", bench.soak),
    ],
)
_group("config", "The session's settings.", [("init", config.init), ("check", config.check)])


_INTERRUPTED = 130
"""Exit status, as shells have it for Ctrl-C."""


def main(arguments: list[str] | None = None) -> int:
    """Runs one command and returns its exit status: 0 done, 2 something a user can mend, 130 interrupted."""
    try:
        status = app(arguments, prog_name="sixpoint", standalone_mode=False)
    except Abort:
        return _failed("interrupted", _INTERRUPTED)
    except KeyboardInterrupt:
        return _failed("interrupted", _INTERRUPTED)
    except TyperException as error:
        return _failed(_usage_message(error))
    except SixpointError as error:
        return _failed(str(error))
    except BrokenPipeError:
        return 0
    except OSError as error:
        return _failed(_os_message(error))
    if status == _INTERRUPTED:  # typer turns Ctrl-C into it
        return _failed("interrupted", _INTERRUPTED)
    return status if isinstance(status, int) else 0


def _usage_message(error: TyperException) -> str:
    """A wrong command line in words; "" where its help was printed in their place."""
    message = " ".join(getattr(error, "format_message", error.__str__)().split())
    if not message.startswith("No such command"):
        return message
    context = getattr(error, "ctx", None)
    return f"{message} `{context.command_path if context else 'sixpoint'} --help` lists them"


def _failed(message: str, status: int = 2) -> int:
    if message:
        print(f"sixpoint: {message}", file=sys.stderr)
    return status


def _os_message(error: OSError) -> str:
    """A system error in words: which file, and what would mend the common ones."""
    where = f"{error.filename}: " if error.filename else ""
    remedy = {errno.ENOSPC: "; free some space and run it again", errno.EACCES: "; check who may read and write there"}
    return f"{where}{error.strerror or error}{remedy.get(error.errno or 0, '')}"


def script() -> None:
    """The console script's entry point.

    Numerical libraries get one thread each, unless the user's environment says otherwise: what is worked out for one
    frame is too small to share, and threads that wait for each other on a busy machine cost tens of milliseconds.
    """
    for pool in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(pool, "1")
    sys.exit(main())


if __name__ == "__main__":
    script()
