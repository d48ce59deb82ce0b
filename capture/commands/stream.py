"""`sixpoint stream`: a motion to other programs, as if it were live."""

from pathlib import Path
from typing import Annotated

import typer


def stream(
    motion: Annotated[Path, typer.Argument(help="The motion to send: .bvh or .amc.")],
    to: Annotated[
        list[str], typer.Option(help="Where to: vmc://HOST:PORT, vrchat://HOST:PORT or json://HOST:PORT; may repeat.")
    ],
    loop: Annotated[bool, typer.Option(help="Again and again, until Ctrl-C.")] = False,
) -> None:
    """Send a motion to other programs as it would be sent live: VMC, VRChat trackers, JSON over UDP."""
    from contextlib import ExitStack, closing

    from capture.progress import progress_bar
    from capture.streaming import open_stream, stream_motion
    from reconstruction.motion_files import read_motion

    given = read_motion(motion)
    with ExitStack() as stack:
        streams = [stack.enter_context(closing(open_stream(address, given.skeleton, given.pose(0)))) for address in to]
        with progress_bar("sending") as progress:
            stream_motion(given, streams, loop, progress)
        for address, one in zip(to, streams, strict=True):
            print(f"{address}: {one.sent} datagrams sent, {one.dropped} not taken")
