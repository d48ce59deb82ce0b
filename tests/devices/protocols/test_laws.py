"""What holds for every protocol: the simulator is understood, and nothing on the wire upsets the parser."""

import json
import random
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import pairwise
from math import cos, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from devices.protocols import make_protocol
from devices.protocols.protocol import DeviceProtocol, run_dry
from devices.sample import SampleFlag, TrackerSample
from tests.devices.protocols.wire import Wire, decode, poll, started

CYCLES = 6


@dataclass(frozen=True, eq=False)
class Case:
    """One protocol with one set of options. tolerance_m: its resolution. turns: whether it gives orientations."""

    name: str
    tolerance_m: float
    trackers: int = 2
    turns: bool = True
    checksum: bool = False
    options: dict = field(default_factory=dict)

    def protocol(self) -> DeviceProtocol:
        return make_protocol(self.name, **self.options)

    @property
    def serial(self) -> bool:
        return self.protocol().link == "serial"

    def __str__(self) -> str:
        return "-".join([self.name, *(f"{key}_{value}" for key, value in self.options.items())]).replace(" ", "")


CASES = [
    Case("generic", 6e-5, trackers=4, checksum=True),
    Case("generic-binary", 1e-6, trackers=4, checksum=True),
    Case("generic-hid", 1e-6, trackers=4),
    Case("fastrak", 1e-6, trackers=4),
    Case("fastrak", 1e-6, options={"inches": True, "items": (2, 4, 1)}),
    Case("fastrak", 1e-4, options={"binary": False, "items": (2, 4, 1)}),
    Case("fastrak", 3e-4, options={"binary": False, "inches": True, "items": (2, 11, 0)}),
    Case("is900", 1e-6, trackers=12),
    Case("is900", 2e-4, trackers=6, options={"items": (18, 21, 20)}),
    Case("is900", 1e-4, options={"binary": False, "items": (2, 4, 1)}),
    Case("isotrak2", 1e-4),
    Case("liberty", 1e-6, trackers=6),
    Case("liberty", 1e-6, options={"inches": True, "items": (8, 2, 4, 0)}),
    Case("liberty", 1e-6, options={"items": (10, 3, 5, 1)}),
    Case("patriot", 1e-6),
    Case("flock_of_birds", 6e-5, trackers=4),
    Case("flock_of_birds", 3e-4, options={"full_scale_in": 144, "record": "position_angles", "first_address": 2}),
    Case("flock_of_birds", 6e-5, trackers=1, options={"group": False}),
    Case("flock_of_birds", 6e-5, turns=False, options={"record": "position"}),
    Case("viper", 1e-6, trackers=6, checksum=True),
    Case("ndi", 1e-6, trackers=4, checksum=True),
    Case("ndi", 1e-5, checksum=True, options={"binary": False, "axes": "FRD"}),
    Case("dwm1001", 0.0051, trackers=4, turns=False),
    Case("dwm1001", 0.0051, trackers=1, turns=False),
    Case("dwm1001", 6e-4, trackers=1, turns=False, options={"binary": True}),
    Case("marvelmind", 6e-4, trackers=4, turns=False, checksum=True),
    Case("hydra", 6e-4, checksum=True),
    Case("vive_ultimate", 1e-6, trackers=5),
    Case("vive_ultimate", 1e-6, options={"quaternion_order": "wzyx"}),
]
every_case = pytest.mark.parametrize("case", CASES, ids=str)
every_serial_case = pytest.mark.parametrize("case", [case for case in CASES if case.serial], ids=str)


def moving(trackers: int, cycle: int) -> list[TrackerSample]:
    """Trackers on slow curves above the ground and in front of the device, turning a little."""
    samples = []
    for n in range(trackers):
        t = 0.1 * cycle + n
        x, y, z = 0.2 * sin(t), 0.1 * cos(t), 0.1 * sin(2 * t)
        samples.append(
            TrackerSample(
                tracker=str(n + 1),
                host_time_ns=0,
                position=(0.3 * sin(t), 0.6 + 0.2 * cos(t), -0.4 + 0.2 * sin(3 * t)),
                orientation=(x, y, z, (1 - x * x - y * y - z * z) ** 0.5),
                device_time_s=cycle / 50,
                sequence=cycle,
            )
        )
    return samples


@cache
def packets(case: Case) -> tuple[bytes, ...]:
    """What the simulated device sends in some cycles, packet by packet."""
    protocol = case.protocol()
    device = started(protocol, case.trackers)
    sent = []
    for cycle in range(CYCLES):
        sent += device.measure(moving(case.trackers, cycle))
        if reply := poll(protocol, device, host_time_ns=cycle * 200_000_000):
            protocol.feed(reply, 0)
            sent.append(reply)
    return tuple(sent)


def read(case: Case, chunks: Iterable[bytes]) -> list[TrackerSample]:
    return decode(case.protocol(), chunks)


def poses(samples: Iterable[TrackerSample]) -> list[tuple]:
    """What must survive damage; a running clock or number may count on from a broken one without a checksum."""
    return [(s.tracker, s.position, s.orientation) for s in samples]


@cache
def poses_by_packet(case: Case) -> tuple[list[tuple], ...]:
    protocol = case.protocol()
    return tuple(poses(protocol.feed(packet, 0)) for packet in packets(case))


def joined(parts: Iterable[list[tuple]]) -> list[tuple]:
    return [pose for part in parts for pose in part]


def check_damage(case: Case, sent: list[bytes], first: int, last: int) -> None:
    """Packets before `first` and from `last` on must come through, in order; the sent stream differs between them."""
    got = poses(read(case, [b"".join(sent)] if case.serial else sent))
    before, after = joined(poses_by_packet(case)[:first]), joined(poses_by_packet(case)[last:])
    assert got[: len(before)] == before
    assert got[len(got) - len(after) :] == after
    if case.checksum:
        told = iter(joined(poses_by_packet(case)))
        assert all(pose in told for pose in got), "a sample that was never sent"


@every_case
def test_the_parser_reads_what_the_simulator_was_told(case):
    told = [sample for cycle in range(CYCLES) for sample in moving(case.trackers, cycle)]
    for got, sent in zip(read(case, packets(case)), told, strict=True):
        assert int(got.tracker) == int(sent.tracker)
        assert got.position == pytest.approx(sent.position, abs=case.tolerance_m)
        if case.turns:
            assert got.orientation == pytest.approx(sent.orientation, abs=2e-3)


@every_case
def test_a_tracker_that_is_not_seen_gives_no_position_and_the_others_go_on(case):
    protocol = case.protocol()
    device = started(protocol, case.trackers)
    samples = moving(case.trackers, 0)
    sent = device.measure([replace(samples[0], position=None, orientation=None), *samples[1:]])
    got = decode(protocol, [*sent, poll(protocol, device, 0)] if case.serial else sent)
    seen = {int(s.tracker) for s in got if s.position is not None and not s.flags & SampleFlag.HELD}
    assert seen == {int(s.tracker) for s in samples[1:]}


@every_case
def test_the_options_that_a_take_keeps_read_the_stream(case):
    protocol = case.protocol()
    started(protocol, case.trackers)
    again = make_protocol(case.name, **json.loads(json.dumps(protocol.options())))
    assert decode(again, packets(case)) == read(case, packets(case))


@pytest.mark.parametrize("case", [case for case in CASES if run_dry(case.protocol().stop(), iter(()))], ids=str)
def test_after_stop_the_device_is_silent(case):
    protocol = case.protocol()
    device = started(protocol, case.trackers)
    Wire(device).run(protocol.stop())
    assert decode(protocol, device.measure(moving(case.trackers, 0))) == []
    assert not device.streaming


@every_case
def test_a_device_left_streaming_by_a_crash_is_started_again(case):
    protocol = case.protocol()
    device = started(protocol, case.trackers)
    wire = Wire(device, samples=moving(case.trackers, 0))
    wire.inbox = b"".join(device.measure(moving(case.trackers, 0)))[5 if case.serial else 0 :]
    wire.run(protocol.start())
    protocol.reset()
    sent = device.measure(moving(case.trackers, 1))
    if case.serial:
        sent.append(poll(protocol, device, 0))
    assert len(decode(protocol, sent)) == case.trackers


@every_serial_case
@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_any_split_of_the_stream_gives_the_same_samples(case, data):
    stream = b"".join(packets(case))
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=12)))
    chunks = [stream[a:b] for a, b in pairwise([0, *cuts, len(stream)])]
    assert read(case, chunks) == read(case, [stream])


@every_serial_case
@settings(max_examples=20, deadline=None)
@given(noise=st.binary(max_size=60))
def test_byte_by_byte_gives_the_same_samples_in_noise_too(case, noise):
    stream = noise.join(packets(case))
    assert read(case, (stream[i : i + 1] for i in range(len(stream)))) == read(case, [stream])


@every_serial_case
@settings(max_examples=60, deadline=None)
@given(data=st.data(), garbage=st.binary(max_size=80))
def test_garbage_between_frames_costs_one_good_frame_at_most(case, data, garbage):
    sent = packets(case)
    at = data.draw(st.integers(0, len(sent)))
    check_damage(case, [*sent[:at], garbage, *sent[at:]], at, at + 1)


@every_case
@settings(max_examples=80, deadline=None)
@given(data=st.data())
def test_a_flipped_bit_costs_its_frame_and_one_more_at_most(case, data):
    sent = packets(case)
    at = data.draw(st.integers(0, len(sent) - 1))
    bit = data.draw(st.integers(0, 8 * len(sent[at]) - 1))
    flipped = bytearray(sent[at])
    flipped[bit // 8] ^= 1 << bit % 8
    check_damage(case, [*sent[:at], bytes(flipped), *sent[at + 1 :]], at, at + 2)


@every_case
@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_a_cut_frame_costs_itself_and_one_more_at_most(case, data):
    sent = packets(case)
    at = data.draw(st.integers(0, len(sent) - 1))
    start = data.draw(st.integers(0, len(sent[at]) - 1))
    end = data.draw(st.integers(start + 1, len(sent[at])))
    check_damage(case, [*sent[:at], sent[at][:start] + sent[at][end:], *sent[at + 1 :]], at, at + 2)


@every_case
@settings(max_examples=30, deadline=None)
@given(chunks=st.lists(st.binary(max_size=200), max_size=8))
def test_no_bytes_make_it_raise(case, chunks):
    protocol = case.protocol()
    for chunk in chunks:
        protocol.feed(chunk, 0)
        protocol.to_send(0)


@every_case
@pytest.mark.nightly
def test_a_million_random_bytes(case):
    rng = random.Random(20261122)
    sent = packets(case)
    protocol = case.protocol()
    fed = found = 0
    while fed < 1_000_000:
        noise = rng.randbytes(rng.randint(1, 4096) if case.serial else len(sent[0]))
        found += len(protocol.feed(noise, 0))
        fed += len(noise)
    if case.checksum:
        assert found <= fed / 65536
    last = poses_by_packet(case)[-1]
    assert poses(decode(protocol, sent))[-len(last) :] == last
