"""Independent jobs by several processes of this machine, or by the workers of a Dask cluster.

A job that kills its process, or loses it, does not take the others with it.
"""

import signal
import sys
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context
from typing import Any, TypeVar

from devices.errors import SettingError

J = TypeVar("J")
R = TypeVar("R")
Lost = Callable[[J, str], R]
"""What comes of a job whose process was lost, by the reason in words."""

PATIENCE = "10s"
"""How long a scheduler may take to answer."""


def by_processes(work: Callable[[J], R], jobs: Sequence[J], lost: Lost, processes: int) -> Iterator[R]:
    """Each job's result as it is ready. work, jobs and results go from process to process.

    Where a process dies, the jobs that were being done are done again, each in a process of its own: the one that kills
    that, too, is lost. Raises what `work` raises.
    """
    waiting = list(reversed(jobs))
    while waiting:
        suspects = yield from _until_broken(work, waiting, processes)
        for job in suspects:
            broken = yield from _until_broken(work, [job], 1)
            if broken:
                yield lost(job, "its process died twice: out of memory, or killed")


def _until_broken(work: Callable[[J], R], waiting: list[J], processes: int) -> Generator[R, None, list[J]]:
    """Takes jobs from the end of `waiting`; gives those that were being done when a process died."""
    # Ctrl-C reaches the whole group: the parent alone answers it, and ends the others; those that have only just begun
    # and cannot ignore it yet inherit that it is blocked.
    pool = ProcessPoolExecutor(processes, get_context("spawn"), signal.signal, (signal.SIGINT, signal.SIG_IGN))
    asked: dict[Future[R], J] = {}
    broken: list[J] = []
    alive = True
    try:
        while (waiting and alive) or asked:
            while waiting and alive and len(asked) < processes:
                job = waiting.pop()
                try:
                    with _sigint_blocked():
                        asked[pool.submit(work, job)] = job
                except BrokenProcessPool:
                    waiting.append(job)
                    alive = False
            for future in wait(asked, return_when=FIRST_COMPLETED).done:
                job = asked.pop(future)
                try:
                    yield future.result()
                except BrokenProcessPool:
                    broken.append(job)
                    alive = False
    except BaseException:
        for process in active_children():
            process.terminate()
        raise
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
    return broken


@contextmanager
def _sigint_blocked() -> Iterator[None]:
    """Ctrl-C waits until the end, for this thread and for good for processes that are begun in it (but on Windows)."""
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def by_cluster(work: Callable[[J], R], jobs: Sequence[J], lost: Lost, scheduler: str) -> Iterator[R]:
    """Each job's result as it is ready, by the workers of the Dask cluster at that address.

    A job whose worker is lost is done by another. Dask blames all that were with a worker when it was lost, so those
    that lost several are tried once more, each alone: one that loses its worker then is lost itself. Raises
    SettingError where Dask is not installed or no scheduler answers.
    """
    try:
        from distributed import Client, KilledWorker, as_completed
    except ImportError:
        raise SettingError("--dask needs Dask's distributed scheduler: pip install 'sixpoint[dask]'") from None
    try:
        client = Client(scheduler, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise SettingError(f"--dask {scheduler}: no scheduler answers there ({error})") from None
    with client:
        asked: dict[Any, J] = {client.submit(work, job, pure=False): job for job in jobs}
        suspects: list[J] = []
        for future in as_completed(list(asked), loop=client.loop):
            job = asked.pop(future)
            if isinstance(future.exception(), KilledWorker):
                suspects.append(job)
            else:
                yield _outcome(future, job, lost)
            future.release()
        for job in suspects:
            yield _outcome(client.submit(work, job, pure=False), job, lost)


def _outcome(future: Any, job: J, lost: Callable[[J, str], R]) -> R:
    """What a Dask future came to."""
    error = future.exception()
    return future.result() if error is None else lost(job, f"{type(error).__name__}: {error}")
