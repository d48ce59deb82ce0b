"""Progress bars on the terminal for anything that takes a `devices.progress.Progress`."""

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

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


def tell_all(lines: Iterable[str]) -> None:
    """Lines for the person at the keyboard, on standard error."""
    for line in lines:
        print(f"sixpoint: {line}", file=sys.stderr)
