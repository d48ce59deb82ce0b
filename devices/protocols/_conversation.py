"""Parts of start-up scripts that several serial devices share."""

from collections.abc import Callable, Generator, Sequence

from devices.errors import DeviceError
from devices.protocols._framing import FramedProtocol
from devices.protocols.protocol import Script, SetBaud, Step

Question = Generator[Step, bytes, bool]
"""A script that returns whether the device answered as it should."""

COMMON_BAUDS = (19200, 9600, 38400, 57600, 115200)


def find_baud(protocol: FramedProtocol, bauds: Sequence[int], question: Callable[[], Question], hint: str) -> Script:
    """Asks at the speed the port was opened with, then at others, until the device answers.

    Once found, a speed is the only one that is tried: a device that comes back is heard at once. Raises DeviceError
    naming the device, the speeds and the hint where there is no answer.
    """
    if protocol.found_baud:
        yield SetBaud(protocol.found_baud)
        bauds = ()
    if (yield from question()):
        return
    for baud in bauds:
        yield SetBaud(baud)
        if (yield from question()):
            protocol.found_baud = baud
            return
    others = f", nor at {', '.join(map(str, bauds))} baud" if bauds else ""
    own = f"{protocol.found_baud} baud" if protocol.found_baud else "the port's speed"
    raise DeviceError(f"no answer from {protocol.title} at {own}{others}: {hint}")


class CommandLine:
    """Cuts what a host writes into commands: some letters take effect at once, the others end in CR.

    immediate: the letters (or control characters) that are whole commands.
    """

    def __init__(self, immediate: str = "") -> None:
        self._immediate = immediate
        self._typed = ""

    def commands(self, data: bytes) -> list[str]:
        """The commands that these bytes complete, without their CR; a lone CR ends a half-typed one silently."""
        whole = []
        for char in data.decode("latin-1"):
            if not self._typed and char in self._immediate:
                whole.append(char)
            elif char == "\r":
                if self._typed:
                    whole.append(self._typed)
                self._typed = ""
            elif char != "\n":
                self._typed += char
        return whole
