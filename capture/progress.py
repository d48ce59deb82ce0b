"""Progress bars on the terminal for anything that takes a `devices.progress.Progress`."""

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager

from devices.progress import Progress


@contextmanager
def progress_bar(description: str) -> Iterator[Progress]:
    """A bar on standard error with rate and time left, gone from pipes; its value is called with (done, total)."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Bar(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(description, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


@contextmanager
def stage_bars() -> Iterator[Callable[[str], Progress]]:
    """Gives each named stage a bar of its own; the one before is finished then."""
    with ExitStack() as bars:

        def stage(name: str) -> Progress:
            bars.close()
            return bars.enter_context(progress_bar(name))

        yield stage


def tell_all(lines: Iterable[str]) -> None:
    """Lines for the person at the keyboard, on standard error."""
    for line in lines:
        print(f"sixpoint: {line}", file=sys.stderr)
