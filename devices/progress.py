"""How long work reports how far it is, without knowing who looks."""

from collections.abc import Callable

Progress = Callable[[int, int], None]
"""Called with (done, total) steps, many times a second at most a few hundred."""


def no_progress(done: int, total: int) -> None:
    """For callers that do not look."""
