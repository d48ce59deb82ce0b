"""The window in a process of its own, so that drawing never holds up the solver.

Open3D keeps Python's interpreter lock while it draws and while it waits for the screen; a thread that solves at 60 Hz
beside it would miss its time. Here the other process asks for a scene when it is ready to draw one, and this one
answers: nothing piles up, and a slow screen costs pictures, not poses.
"""

import contextlib
import io
import multiprocessing
import os
import pickle
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.scene import Scene
from capture.viewing import Action, FrameSource, Layers
from devices.errors import SixpointError

_LOOK_UP_S = 0.05
_MOST_SHARED = 64
_NICER = 5


@dataclass(frozen=True)
class _Opening:
    """What the window is told once."""

    title: str
    width: int
    height: int
    layers: Layers | None
    keys: Mapping[str, str]
    duration_s: float | None
    frame_s: float
    pictures: int | None


@dataclass(frozen=True)
class _Request:
    """The window is ready to draw: the moment, the layers, and the session's keys pressed since the last."""

    time_s: float
    layers: Layers
    pressed: tuple[str, ...]


def show_apart(
    source: FrameSource,
    *,
    title: str,
    width: int,
    height: int,
    layers: Layers | None,
    actions: Mapping[str, Action],
    until: Callable[[], bool] | None,
    pictures: int | None,
) -> None:
    """`capture.viewer.show` with the drawing elsewhere. Scenes and actions are still called from this thread.

    Raises SixpointError where no window can be opened, or where it is lost other than by being closed.
    """
    keys = {key: action.text for key, action in actions.items()}
    opening = _Opening(title, width, height, layers, keys, source.duration_s, source.frame_s, pictures)
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_draw, args=(there, opening), name="sixpoint window", daemon=True)
    process.start()
    there.close()
    stopped = False
    try:
        _serve(here, source, actions, until)
    finally:
        here.close()
        process.join(timeout=5)
        if stopped := process.is_alive():
            process.terminate()
            process.join()
        status = process.exitcode
        process.close()
    if status and not stopped:
        raise SixpointError(f"the window is lost: its process ended with status {status}")


def _serve(
    connection: Connection, source: FrameSource, actions: Mapping[str, Action], until: Callable[[], bool] | None
) -> None:
    sender = SceneSender()
    while not (until and until()):
        if not connection.poll(_LOOK_UP_S):
            continue
        try:
            request = connection.recv()
        except (EOFError, ConnectionError):
            return
        if isinstance(request, SixpointError):
            raise request
        for key in request.pressed:
            actions[key].do()
        try:
            connection.send_bytes(sender.packed(source.scene(request.time_s, request.layers)))
        except (BrokenPipeError, ConnectionError):
            return


def _draw(connection: Connection, opening: _Opening) -> None:
    """What the window's process does."""
    import signal

    from capture.viewer import show_here

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the session ends in order, and then the window does
    _give_way()
    source = _RemoteSource(connection, opening)
    try:
        show_here(
            source,
            title=opening.title,
            width=opening.width,
            height=opening.height,
            layers=opening.layers,
            actions={key: Action(text, source.presser(key)) for key, text in opening.keys.items()},
            until=None,
            pictures=opening.pictures,
        )
    except SixpointError as error:
        connection.send(error)
    except (EOFError, ConnectionError):
        pass
    connection.close()


def _give_way() -> None:
    """A busy machine shall miss pictures before poses; drawing by software leaves a core to the solver."""
    with contextlib.suppress(AttributeError, OSError):  # not everywhere
        os.nice(_NICER)
    os.environ.setdefault("LP_NUM_THREADS", str(max(1, (os.cpu_count() or 2) - 1)))


class _RemoteSource:
    """`FrameSource` at the window's end of the pipe. Raises EOFError when the session has ended."""

    def __init__(self, connection: Connection, opening: _Opening) -> None:
        self.duration_s, self.frame_s = opening.duration_s, opening.frame_s
        self._connection = connection
        self._receiver = SceneReceiver()
        self._pressed: list[str] = []

    def scene(self, time_s: float, layers: Layers) -> Scene:
        pressed, self._pressed = tuple(self._pressed), []
        self._connection.send(_Request(time_s, layers, pressed))
        return self._receiver.unpacked(self._connection.recv_bytes())

    def presser(self, key: str) -> Callable[[], None]:
        return lambda: self._pressed.append(key)


class SceneSender:
    """Packs scenes; integer arrays that stay the same object (triangles, say) go over once."""

    def __init__(self) -> None:
        self._shared: dict[int, NDArray[Any]] = {}

    def packed(self, scene: Scene) -> bytes:
        """One message for a `SceneReceiver` that has had all messages before it."""
        fresh: dict[int, NDArray[Any]] = {}
        forget = len(self._shared) > _MOST_SHARED
        if forget:
            self._shared.clear()
        buffer = io.BytesIO()
        pickler = pickle.Pickler(buffer, protocol=5)
        pickler.persistent_id = self._remember(fresh)  # type: ignore[method-assign]
        pickler.dump(scene)
        return pickle.dumps((forget, fresh, buffer.getvalue()), protocol=5)

    def _remember(self, fresh: dict[int, NDArray[Any]]) -> Callable[[object], int | None]:
        def persistent_id(value: object) -> int | None:
            if not isinstance(value, np.ndarray) or value.dtype.kind != "i" or value.nbytes < 4096:
                return None
            number = id(value)
            if self._shared.get(number) is not value:
                self._shared[number] = fresh[number] = value
            return number

        return persistent_id


class SceneReceiver:
    """Unpacks what a `SceneSender` packed, in order."""

    def __init__(self) -> None:
        self._shared: dict[int, NDArray[Any]] = {}

    def unpacked(self, message: bytes) -> Scene:
        """The scene of the next message."""
        forget, fresh, body = pickle.loads(message)
        if forget:
            self._shared.clear()
        self._shared.update(fresh)
        unpickler = pickle.Unpickler(io.BytesIO(body))
        unpickler.persistent_load = self._shared.__getitem__  # type: ignore[method-assign]
        return unpickler.load()
