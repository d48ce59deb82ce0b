"""Telling a running session what to show, over OSC: `/sixpoint/act` with `live`, `idle` or `clip`."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from pythonosc.dispatcher import Dispatcher
from pythonosc.osc_server import ThreadingOSCUDPServer

from capture.director import Act, Director
from devices.errors import SettingError

ADDRESS = "/sixpoint/act"


@contextmanager
def listening(director: Director, port: int, host: str = "127.0.0.1") -> Iterator[int]:
    """Listens while it is open, and gives the port; messages that mean nothing are ignored. Raises SettingError."""
    dispatcher = Dispatcher()
    dispatcher.map(ADDRESS, lambda _, *words: _obey(director, words))
    try:
        server = ThreadingOSCUDPServer((host, port), dispatcher)
    except OSError as error:
        raise SettingError(f"OSC port {port}: {error.strerror}; choose another one") from None
    thread = threading.Thread(target=server.serve_forever, name="osc", daemon=True)
    thread.start()
    try:
        yield server.server_address[1]
    finally:
        server.shutdown()
        server.server_close()
        thread.join(timeout=2)


def _obey(director: Director, words: tuple) -> None:
    if words and words[0] in tuple(Act):
        director.ask(Act(words[0]))
