"""Telling a running session what to do, over OSC.

`/sixpoint/act` with `live`, `idle` or `clip` says what is shown; `/sixpoint/set` with a live setting's name and a value
changes it (`capture.tuning`); `/sixpoint/record` with 1 or 0 begins or ends a take; `/sixpoint/mark`, with or without a
text, marks the moment in it; `/sixpoint/poke` hits the flesh.
"""

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

from pythonosc.dispatcher import Dispatcher
from pythonosc.osc_server import ThreadingOSCUDPServer

from capture.director import Act, Director
from capture.take_desk import TakeDesk
from capture.tuning import Tuning
from devices.errors import SettingError

ADDRESS = "/sixpoint/act"

Order = Callable[[tuple], None]
"""Does what an address's arguments ask; may raise SettingError for arguments that ask nothing."""


def orders(
    director: Director | None = None,
    tuning: Tuning | None = None,
    desk: TakeDesk | None = None,
    poke: Callable[[], None] | None = None,
) -> dict[str, Order]:
    """What a session obeys, by address."""
    obeyed: dict[str, Order] = {}
    if director is not None:
        obeyed[ADDRESS] = lambda words: _act(director, words)
    if tuning is not None:
        obeyed["/sixpoint/set"] = lambda words: _set(tuning, words)
    if desk is not None:
        obeyed["/sixpoint/record"] = lambda words: _record(desk, words)
        obeyed["/sixpoint/mark"] = lambda words: desk.mark(str(words[0]) if words else None)
    if poke is not None:
        obeyed["/sixpoint/poke"] = lambda _: poke()
    return obeyed


@contextmanager
def listening(
    obeyed: Mapping[str, Order], port: int, host: str = "127.0.0.1", tell: Callable[[str], None] = lambda _: None
) -> Iterator[int]:
    """Obeys while it is open, and gives the port. Raises SettingError where it cannot listen.

    tell: called with one line for each message that asks for what is not there.
    """
    dispatcher = Dispatcher()
    for address, order in obeyed.items():
        dispatcher.map(address, lambda _, *words, order=order: _obey(order, words, tell))
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


def _obey(order: Order, words: tuple, tell: Callable[[str], None]) -> None:
    try:
        order(words)
    except SettingError as error:
        tell(f"OSC: {error}")


def _act(director: Director, words: tuple) -> None:
    if words and words[0] in tuple(Act):
        director.ask(Act(words[0]))


def _set(tuning: Tuning, words: tuple) -> None:
    """Switches may come as numbers: many senders know no truth values."""
    if len(words) != 2:
        raise SettingError("/sixpoint/set takes a setting's name and a value")
    name, value = str(words[0]), words[1]
    is_switch = isinstance(tuning.value(name), bool)
    tuning.ask(name, bool(value) if is_switch and value in (0, 1) else value)


def _record(desk: TakeDesk, words: tuple) -> None:
    wanted = bool(words[0]) if words else desk.path is None
    if wanted and desk.path is None:
        desk.start()
    elif not wanted and desk.path is not None:
        desk.stop()
