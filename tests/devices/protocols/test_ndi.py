"""NDI's Combined API against the worked vectors, its polling, and its start-up conversation."""

import pytest

from devices.errors import DeviceError, FileError, SettingError
from devices.protocols.ndi import Ndi, with_crc
from devices.protocols.protocol import Break, SetBaud, Write, run_dry
from devices.sample import SampleFlag, TrackerSample
from tests.devices.protocols.wire import POSE_A_FRD, VECTORS, Wire, decode, started

BX, TX = VECTORS["ndi_BX_0001_reply_2_handles"], VECTORS["ndi_TX_0001_reply_2_handles"]
NOT_SEEN = TrackerSample("2", 0)


@pytest.mark.parametrize(("vector", "tolerance"), [(BX, 1e-6), (TX, 1e-4)], ids=["BX", "TX"])
def test_reply_vectors(vector, tolerance):
    seen, missing = Ndi(axes="FRD").feed(vector, 7)
    assert (seen.tracker, seen.host_time_ns, seen.sequence) == ("1", 7, 8000)
    assert seen.device_time_s == pytest.approx(8000 / 60)
    assert seen.position == pytest.approx(POSE_A_FRD.position, abs=1e-6)
    assert seen.orientation == pytest.approx(POSE_A_FRD.orientation, abs=tolerance)
    assert (missing.tracker, missing.position, missing.orientation) == ("2", None, None)


@pytest.mark.parametrize(("binary", "vector", "error"), [(True, BX, (37, 41)), (False, TX, (49, 55))], ids=["BX", "TX"])
def test_the_simulator_writes_the_vectors(binary, vector, error):
    """But for the error of the transform, which a sample has none of, and the checksums over it."""
    protocol = Ndi(binary=binary, axes="FRD")
    device = started(protocol, 2)
    for _ in range(8000):
        device.measure([POSE_A_FRD, NOT_SEEN])
    sent = device.answer(protocol.to_send(0))
    assert sent[: error[0]] == vector[: error[0]]
    assert sent[error[1] : -5] == vector[error[1] : -5]
    assert len(sent) == len(vector)


def test_crc_vectors():
    listed = (
        "INIT:E3A5 OKAYA896 RESETBE6F TX:0001031A BX:0001C26D TSTART:5423 TSTOP:2C14 PHSR:02E17E PHSR:0020FF"
        " PINIT:0131EA PENA:01D6D3B PINIT:0AD5EB PENA:0ADAD1E COMM:500000048"
    )
    for text in listed.encode().split():
        assert with_crc(text[:-4]) == text + b"\r"


def test_the_same_frame_polled_twice_is_one_sample():
    assert len(decode(Ndi(), [BX, BX])) == 2


def test_the_next_poll_waits_for_the_reply_or_for_its_loss():
    protocol = Ndi()
    poll = b"BX:0001C26D\r"
    assert protocol.to_send(0) == poll
    assert protocol.to_send(100_000_000) == b""
    assert protocol.to_send(260_000_000) == poll
    protocol.feed(BX, 0)
    assert protocol.to_send(265_000_000) == b""
    assert protocol.to_send(270_000_000) == poll


def test_an_error_reply_does_not_make_it_poll_faster():
    protocol = Ndi(binary=False)
    protocol.to_send(0)
    assert protocol.feed(with_crc(b"ERROR0C"), 0) == []
    assert protocol.to_send(10_000_000) == b""


def test_a_tool_out_of_the_volume_is_flagged():
    device = started(Ndi(), 1)
    device.measure([POSE_A_FRD])
    device._ports[1] |= 0x40
    (sample,) = Ndi().feed(device.answer(b"BX 0001\r"), 0)
    assert sample.flags == SampleFlag.SUSPECT


def test_start_wakes_the_device_by_a_break_and_raises_the_speed():
    okay = with_crc(b"OKAY")
    none = with_crc(b"00")
    replies = [b"", with_crc(b"RESET"), okay, okay, okay, none, with_crc(b"010A001"), okay, with_crc(b"010A011"), okay]
    steps = run_dry(Ndi().start(), iter([*replies, with_crc(b"010A031"), okay]))
    assert [s.baud for s in steps if isinstance(s, SetBaud)] == [115200, 9600, 115200]
    assert any(isinstance(s, Break) for s in steps)
    written = [s.data for s in steps if isinstance(s, Write)]
    assert written[-8:] == [
        b"COMM:500000048\r",
        b"PHSR:01" + with_crc(b"PHSR:01")[-5:],
        b"PHSR:02E17E\r",
        b"PINIT:0AD5EB\r",
        with_crc(b"PHSR:03"),
        b"PENA:0ADAD1E\r",
        with_crc(b"PHSR:04"),
        b"TSTART:5423\r",
    ]


def test_passive_tools_are_loaded_from_their_files(tmp_path):
    rom = tmp_path / "tool.rom"
    rom.write_bytes(bytes(range(100)))
    okay, none = with_crc(b"OKAY"), with_crc(b"00")
    replies = [okay, okay, none, with_crc(b"0B"), okay, okay, none, none, with_crc(b"010B031"), okay]
    steps = run_dry(Ndi(tool_roms=(str(rom),)).start(), iter(replies))
    chunks = [s.data for s in steps if isinstance(s, Write) and s.data.startswith(b"PVWR:")]
    assert [c[:11] for c in chunks] == [b"PVWR:0B0000", b"PVWR:0B0040"]
    assert bytes.fromhex(chunks[0][11:-5].decode() + chunks[1][11:-5].decode()) == bytes(range(100)) + bytes(28)
    with pytest.raises(FileError, match=r"tool file .*: No such file"):
        run_dry(Ndi(tool_roms=("/nowhere.rom",)).start(), iter([okay, okay, none]))


def test_a_frame_rate_of_zero_is_refused():
    with pytest.raises(SettingError, match="must be above 0"):
        Ndi(frame_hz=0)


def test_a_speed_it_does_not_have_is_named():
    with pytest.raises(SettingError, match="unknown line_baud 1200: use 9600, 14400"):
        Ndi(line_baud=1200)


def test_no_answer_and_no_tool_are_one_clear_line():
    with pytest.raises(DeviceError, match="no answer from NDI Polaris / Aurora at 115200 or 9600 baud"):
        Wire(Ndi().simulator(["a"]), bauds=()).run(Ndi().start())
    with pytest.raises(DeviceError, match="has no tool: plug one in"):
        Wire(Ndi().simulator([])).run(Ndi().start())


def test_the_simulator_refuses_a_wrong_checksum_and_an_unknown_command():
    device = Ndi().simulator(["a"])
    assert device.answer(b"INIT:0000\r") == with_crc(b"ERROR04")
    assert device.answer(b"BEEP 1\r") == with_crc(b"ERROR01")
    assert device.answer(b"TX 0001\r") == with_crc(b"ERROR0C")


def test_garbage_before_a_binary_reply_costs_nothing():
    assert len(decode(Ndi(), [b"\xc4\xa5junk", BX])) == 2
