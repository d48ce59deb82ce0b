"""What a device protocol is: pure functions of bytes, with the conversation around them written as data.

A protocol never touches a port. It turns bytes into samples (`feed`), says what to write of its own accord (`to_send`,
for polled devices), and describes start, stop and recovery as scripts: generators that yield `Step`s, which a link
carries out, sending back what each step received. Adding a device is adding one file with one `DeviceProtocol` in it.
"""

from abc import ABC, abstractmethod
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, field, fields
from typing import ClassVar, Literal

from devices.sample import TrackerSample


@dataclass(frozen=True, slots=True)
class Write:
    """Write these bytes (serial), or this output report, its ID first (HID). Receives b""."""

    data: bytes


@dataclass(frozen=True, slots=True)
class Receive:
    """Read until `until` is seen or `size` bytes are there, at most `timeout_s`. Receives what came, perhaps b""."""

    timeout_s: float
    until: bytes = b""
    size: int = 0


@dataclass(frozen=True, slots=True)
class Drain:
    """Throw away what comes until the line has been silent for `silence_s`, at most `timeout_s`. Receives b""."""

    silence_s: float = 0.05
    timeout_s: float = 1.0


@dataclass(frozen=True, slots=True)
class Pause:
    """Wait without reading. Receives b""."""

    seconds: float


@dataclass(frozen=True, slots=True)
class SetBaud:
    """Change the line's speed. Receives b""."""

    baud: int


@dataclass(frozen=True, slots=True)
class SetRts:
    """Drive the RTS line, where the port has one. Receives b""."""

    on: bool


@dataclass(frozen=True, slots=True)
class Break:
    """Send a serial BREAK. Receives b""."""

    seconds: float = 0.25


@dataclass(frozen=True, slots=True)
class SendFeature:
    """Send this HID feature report, its ID (0 where there is none) first. Receives b""."""

    report: bytes


@dataclass(frozen=True, slots=True)
class GetFeature:
    """Read a HID feature report of `size` bytes with its ID first. Receives the report, or b"" where it fails."""

    report_id: int
    size: int


Step = Write | Receive | Drain | Pause | SetBaud | SetRts | Break | SendFeature | GetFeature
Script = Generator[Step, bytes, None]
"""Yields steps, is sent what each received. It may raise DeviceError with a line that says what to check."""


@dataclass(frozen=True, slots=True)
class SerialFormat:
    """How the line is set when it is opened. parity: "N", "E" or "O"."""

    baud: int = 115200
    data_bits: int = 8
    parity: Literal["N", "E", "O"] = "N"
    stop_bits: int = 1
    rtscts: bool = False


@dataclass(frozen=True, slots=True)
class HidMatch:
    """Which HID devices are this one. None matches anything; the first match wins.

    report_size: bytes of one input report, its ID included where it has one: what one `read` asks for.
    """

    vendor_id: int | None = None
    product_id: int | None = None
    usage_page: int | None = None
    usage: int | None = None
    interface: int | None = None
    report_size: int = 64


@dataclass(slots=True)
class StreamCounters:
    """What went wrong on the wire since the last `reset`; `feed` keeps them."""

    bytes_dropped: int = 0
    """Bytes that belonged to no good frame."""
    bad_frames: int = 0
    """Frames whose checksum or contents were wrong."""
    missed: int = 0
    """Samples that running numbers say were sent and did not come."""


class SimulatedDevice(ABC):
    """The other end: behaves on the wire as the real device does. Made by `DeviceProtocol.simulator`."""

    streaming: bool = True
    """Whether it has been told to send (or be polled): until then a simulated motion waits at its beginning."""

    @abstractmethod
    def measure(self, samples: Sequence[TrackerSample]) -> list[bytes]:
        """The device has measured all its trackers once; returns the packets it sends by itself, perhaps none.

        samples: one a tracker, tracker = "1", "2", ... in order; metres, `RUB`, device_time_s set; position None is
        a tracker that is not seen. Serial: packets are written one after the other. HID: one input report each.
        A polled device remembers them for `answer`; one that was not told to start returns [].
        """

    def answer(self, data: bytes) -> bytes:
        """The host wrote these bytes (any split); returns the device's replies."""
        return b""

    def set_feature(self, report: bytes) -> None:  # noqa: B027 - most devices have none
        """The host sent a HID feature report, its ID first."""

    def get_feature(self, report_id: int, size: int) -> bytes:
        """The host reads a HID feature report; returned with its ID first, b"" where there is none."""
        return b""


@dataclass
class DeviceProtocol(ABC):
    """A device's language. Subclasses are dataclasses whose fields are the user's options for the device.

    What `feed` needs to know must be in these fields (start-up may write what it learns into them), since a take keeps
    them (`options`) and replays the bytes through a protocol made from them.
    """

    name: ClassVar[str]
    """What users call it: `fastrak`."""
    title: ClassVar[str]
    """Product name for lists."""
    link: ClassVar[Literal["serial", "hid"]] = "serial"
    serial: ClassVar[SerialFormat] = SerialFormat()
    hid: ClassVar[tuple[HidMatch, ...]] = ()
    report_descriptor: ClassVar[bytes] = b""
    """What a HID device tells the host of its reports: for simulators, the driver does not look at it."""
    rate_hz: ClassVar[float] = 60.0
    """Usual samples a second of each tracker: the simulator's default and the doctor's expectation."""
    max_trackers: ClassVar[int] = 6
    filters_itself: ClassVar[bool] = False
    """Whether the device smooths its own output, so that our filters stay off by default."""
    checked: ClassVar[str] = "documents and simulator"
    """What this file was checked against, as docs and lists say it."""

    counters: StreamCounters = field(default_factory=StreamCounters, init=False, repr=False, compare=False)
    role_hints: dict[str, str] = field(default_factory=dict, init=False, repr=False, compare=False)
    """Tracker -> role, where the device itself says who sits where."""

    @abstractmethod
    def feed(self, data: bytes, host_time_ns: int) -> list[TrackerSample]:
        """The samples these bytes complete, in metres and `RUB` axes. Never raises, whatever the bytes.

        Serial: any split of the stream gives the same samples (but for host_time_ns, which is that of the bytes that
        completed the sample). HID: each call is one whole input report.
        """

    def reset(self) -> None:
        """Forget half a frame, unwrapped clocks and counters: a new stream starts. Subclasses extend it."""
        self.counters = StreamCounters()

    def to_send(self, host_time_ns: int) -> bytes:
        """What to write now, b"" mostly: called after each `feed` and at least every 10 ms (polled devices)."""
        return b""

    def start(self) -> Script:
        """Bring the device from any state, streaming or not, to streaming what `feed` reads."""
        yield from ()

    def stop(self) -> Script:
        """Leave the device quiet."""
        yield from ()

    def recover(self) -> Script:
        """The device has been silent for a while though its port is there: by default, start again."""
        yield from self.start()

    @abstractmethod
    def simulator(self, roles: Sequence[str]) -> SimulatedDevice:
        """A simulated device with one tracker a role, with the options of this protocol."""

    def options(self) -> dict[str, object]:
        """The option fields as they now are: `make_protocol(name, **options)` reads the same stream."""
        return {f.name: getattr(self, f.name) for f in fields(self) if f.init}


def run_dry(script: Script, replies: Iterator[bytes]) -> list[Step]:
    """All steps of a script, sending the next of `replies` to each `Receive` and `GetFeature`: for tests and docs."""
    steps: list[Step] = []
    answer: bytes | None = None
    while True:
        try:
            step = next(script) if answer is None else script.send(answer)
        except StopIteration:
            return steps
        steps.append(step)
        answer = next(replies, b"") if isinstance(step, Receive | GetFeature) else b""
