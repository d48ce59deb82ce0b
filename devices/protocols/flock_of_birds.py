"""Ascension Flock of Birds on RS-232: all birds through the master's port, in group mode.

Sources: the VRPN and VESS drivers; the manual's data formats.

A record is a row of 14-bit words, each in two 7-bit bytes; only the record's first byte has bit 7 set. In group mode
the bird's address follows. There is no checksum: the phase bits and a quaternion of length 1 keep it in step.
"""

from collections.abc import Generator, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from devices.axes import Quaternion
from devices.errors import DeviceError, choice_error
from devices.protocols._conversation import Question, find_baud
from devices.protocols._framing import DROP_ONE, WAIT, FramedProtocol, Scan
from devices.protocols._phase_words import scaled, word_bytes, words
from devices.protocols._poses import (
    FORWARD_RIGHT_DOWN,
    IDENTITY,
    INCH_M,
    euler_from_quaternion,
    quaternion_from_euler,
    unit_quaternion,
)
from devices.protocols.protocol import Drain, Pause, Receive, Script, SetRts, SimulatedDevice, Step, Write
from devices.sample import SampleFlag, TrackerSample

RECORDS = {"position": (b"V", 3), "position_angles": (b"Y", 6), "position_quaternion": (b"]", 7)}
"""Name -> (command that asks for it, words in it)."""

HEMISPHERES = {
    "forward": b"\x00\x00",
    "aft": b"\x00\x01",
    "upper": b"\x0c\x01",
    "lower": b"\x0c\x00",
    "left": b"\x06\x01",
    "right": b"\x06\x00",
}
FULL_SCALES_IN = (36, 72, 144)
"""Reach in inches: the default, the doubled scale (parameter 3), an extended-range transmitter."""

_BAUDS = (38400, 19200, 9600, 57600, 115200)
_RECOVERIES_A_RESET = 4
_POINT, _STREAM = b"B", b"@"
_FLOCK_STATUS = b"O\x24"
_STATUS_SIZE = 14
_REACHABLE, _RUNNING, _HAS_RECEIVER = 0x80, 0x40, 0x20
_HIGHEST_ADDRESS = 14


@dataclass
class FlockOfBirds(FramedProtocol):
    """A flock of up to 14 birds.

    birds: how many there are; 0 takes all that answer. full_scale_in: 36, 72 or 144, as the device is set.
    first_address: 2 where an extended-range transmitter has address 1. record: what each bird sends.
    hemisphere: where the birds are, seen from the transmitter. group: False for a single bird without group mode.
    """

    name: ClassVar[str] = "flock_of_birds"
    title: ClassVar[str] = "Ascension Flock of Birds"
    rate_hz: ClassVar[float] = 100.0
    max_trackers: ClassVar[int] = _HIGHEST_ADDRESS
    filters_itself: ClassVar[bool] = True

    birds: int = 0
    full_scale_in: int = 36
    first_address: int = 1
    record: str = "position_quaternion"
    hemisphere: str = "forward"
    group: bool = True
    _recoveries: int = field(default=0, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for what, given, allowed in (
            ("record", self.record, RECORDS),
            ("hemisphere", self.hemisphere, HEMISPHERES),
            ("full_scale_in", self.full_scale_in, FULL_SCALES_IN),
        ):
            if given not in allowed:
                raise choice_error(f"{what} of a flock", given, allowed)
        self._word_bytes = 2 * RECORDS[self.record][1]

    def scan(self, buffer: bytes, start: int, host_time_ns: int) -> Scan:
        if buffer[start] < 0x80:
            return DROP_ONE
        end = start + self._word_bytes + self.group
        if len(buffer) < end:
            return WAIT
        if not buffer[start + 1 : end].isascii():
            return DROP_ONE
        address = buffer[end - 1] if self.group else self.first_address
        sample = self._sample(words(buffer[start : start + self._word_bytes]), address, host_time_ns)
        if sample is None:
            self.counters.bad_frames += 1
            return DROP_ONE
        return end - start, [sample]

    def _sample(self, values: list[int], address: int, host_time_ns: int) -> TrackerSample | None:
        """The sample of a record's words; all zero is a receiver that is saturated or missing."""
        number = address - self.first_address + 1
        if not 1 <= number <= _HIGHEST_ADDRESS:
            return None
        if not any(values):
            return TrackerSample(str(number), host_time_ns, flags=SampleFlag.SUSPECT)
        unit = self.full_scale_in * INCH_M / 32768
        x, y, z = values[:3]
        turn: Quaternion | None = None
        if self.record == "position_quaternion":
            qw, qx, qy, qz = (value / 32768 for value in values[3:])
            turn = unit_quaternion((qx, qy, qz, qw))
            if turn is None:
                return None
        elif self.record == "position_angles":
            azimuth, elevation, roll = (value * 180 / 32768 for value in values[3:])
            turn = quaternion_from_euler((azimuth, elevation, roll))
        axes = FORWARD_RIGHT_DOWN
        position = axes.to_rub((x * unit, y * unit, z * unit))
        return TrackerSample(str(number), host_time_ns, position, turn and axes.quaternion_to_rub(turn))

    def start(self) -> Script:
        try:
            yield from self._reach(())
        except DeviceError:
            yield from self._reset()
            yield from self._reach(_BAUDS)
        yield from self._configure()

    def recover(self) -> Script:
        """As `start`, but mostly without the reset, which for three seconds makes a flock deaf that has come back."""
        self._recoveries += 1
        if self._recoveries % _RECOVERIES_A_RESET == 0:
            yield from self._reset()
        yield from self._reach(())
        yield from self._configure()

    def _reach(self, bauds: Sequence[int]) -> Script:
        yield SetRts(False)
        hint = "check power, the FLY switch, the baud switches, and a cable with RTS (the flock's reset)"
        yield from find_baud(self, bauds, self._answers, hint)

    def _configure(self) -> Script:
        """Forms the group, sets every bird's record and hemisphere, and starts the stream."""
        addresses = yield from self._addresses()
        if self.group:
            yield from self._form_group(addresses)
        command = RECORDS[self.record][0]
        for address in addresses:
            yield Write(self._to_bird(address) + command)
        for address in addresses:
            yield Write(self._to_bird(address) + b"L" + HEMISPHERES[self.hemisphere])
        yield from self._check_running(addresses)
        yield Write(_STREAM)

    def stop(self) -> Script:
        yield Write(_POINT)
        yield Drain()

    def _reset(self) -> Script:
        yield SetRts(True)
        yield Pause(1.0)
        yield SetRts(False)
        yield Pause(2.0)

    def _answers(self) -> Question:
        """`B` ends a stream; whether the flock then tells its status."""
        status = yield from self._status()
        return any(bird & _REACHABLE for bird in status)

    def _status(self) -> Generator[Step, bytes, bytes]:
        """14 bytes, one an address from 1; fewer where the flock does not answer."""
        yield Write(_POINT)
        yield Drain()
        yield Write(_FLOCK_STATUS)
        status = yield Receive(0.5, size=_STATUS_SIZE)
        return status if len(status) == _STATUS_SIZE else b""

    def _addresses(self) -> Generator[Step, bytes, Sequence[int]]:
        """The addresses to stream from: as many as `birds`, or every receiver that is reachable."""
        if self.birds:
            return range(self.first_address, self.first_address + self.birds)
        status = yield from self._status()
        found = [a for a, bird in enumerate(status, start=1) if bird & _REACHABLE and a >= self.first_address]
        if not found:
            raise DeviceError(f"{self.title}: no bird is reachable at address {self.first_address} or above")
        return found

    def _form_group(self, addresses: Sequence[int]) -> Script:
        """Auto-configures the flock where a bird is not running yet, and switches group mode on."""
        status = yield from self._status()
        if not all(status[a - 1 : a] and status[a - 1] & _RUNNING for a in addresses):
            yield Pause(0.4)
            yield Write(bytes((*b"P\x32", max(addresses))))
            yield Pause(0.6)
        yield Write(b"P\x23\x01")

    def _check_running(self, addresses: Sequence[int]) -> Script:
        status = yield from self._status()
        lame = [a for a in addresses if not (status[a - 1 : a] and status[a - 1] & _RUNNING)]
        if lame:
            raise DeviceError(
                f"{self.title}: bird at address {', '.join(map(str, lame))} is not running: check its switches and FBB"
                " cable, or set birds to the number that are there"
            )

    def _to_bird(self, address: int) -> bytes:
        return bytes((0xF0 + address,)) if self.group else b""

    def simulator(self, roles: Sequence[str]) -> "SimulatedFlock":
        return SimulatedFlock(self, len(roles))


class SimulatedFlock(SimulatedDevice):
    """A flock after power-up: birds reachable, not yet running, streaming nothing."""

    _ARGUMENTS: ClassVar[dict[int, int]] = {ord("L"): 2, ord("O"): 1, ord("P"): 2}

    def __init__(self, protocol: FlockOfBirds, trackers: int) -> None:
        self._scale_m = protocol.full_scale_in * INCH_M
        self._first = protocol.first_address
        self._addresses = range(self._first, self._first + trackers)
        self._record = dict.fromkeys(self._addresses, b"Y")
        self._pending = b""
        self._samples: Sequence[TrackerSample] = ()
        self.streaming, self.group, self.running = False, False, not protocol.group

    def measure(self, samples: Sequence[TrackerSample]) -> list[bytes]:
        self._samples = samples
        return self._records() if self.streaming else []

    def answer(self, data: bytes) -> bytes:
        self._pending += data
        replies = b""
        while command := self._next_command():
            replies += self._answer(*command)
        return replies

    def _next_command(self) -> tuple[int, bytes] | None:
        """(address, command with its arguments) of the first whole command written, removed from what is pending."""
        prefixed = self._pending[:1] >= b"\xf0"
        address = self._pending[0] - 0xF0 if prefixed else self._first
        rest = self._pending[prefixed:]
        size = 1 + self._ARGUMENTS.get(rest[0], 0) if rest else 1
        if len(rest) < size:
            return None
        self._pending = rest[size:]
        return address, rest[:size]

    def _answer(self, address: int, command: bytes) -> bytes:
        match command[:1]:
            case b"@":
                self.streaming = True
            case b"B":
                self.streaming = False
                return b"".join(self._records())
            case b"V" | b"Y" | b"]":
                self._record[address] = command
            case b"P" if command[1] == 0x32:
                self.running = True
            case b"P" if command[1] == 0x23:
                self.group = bool(command[2])
            case b"O" if command == _FLOCK_STATUS:
                return self._flock_status()
        return b""

    def _flock_status(self) -> bytes:
        bird = _REACHABLE | _HAS_RECEIVER | (_RUNNING if self.running else 0)
        return bytes(bird if a in self._addresses else 0 for a in range(1, _STATUS_SIZE + 1))

    def _records(self) -> list[bytes]:
        """One record a bird in group mode, else the first bird's alone; one not seen or out of reach sends zeros."""
        records = []
        for address, sample in zip(self._addresses, self._samples, strict=False):
            body = bytearray(word_bytes(self._words(self._record[address], sample)))
            body[0] |= 0x80
            records.append(bytes(body) + (bytes((address,)) if self.group else b""))
        return records if self.group else records[:1]

    def _words(self, record: bytes, sample: TrackerSample) -> list[int]:
        count = next(words for command, words in RECORDS.values() if command == record)
        if sample.position is None or max(map(abs, sample.position)) > self._scale_m:
            return [0] * count
        axes = FORWARD_RIGHT_DOWN
        turn = axes.quaternion_from_rub(sample.orientation or IDENTITY)
        values = [scaled(value, self._scale_m) for value in axes.from_rub(sample.position)]
        if record == b"]":
            values += [scaled(value, 1.0) for value in (turn[3], *turn[:3])]
        elif record == b"Y":
            values += [scaled(angle, 180.0) for angle in euler_from_quaternion(turn)]
        return values
