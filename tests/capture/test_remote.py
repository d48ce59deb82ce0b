"""What a session obeys over OSC, sent as datagrams."""

import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from pythonosc.udp_client import SimpleUDPClient

from capture.remote import listening, orders
from capture.take_desk import TakeDesk, dated_take
from capture.tuning import LiveSetting, Tuning
from devices.errors import FileError


class FakeSession:
    """Takes up what the desk hands it at once."""

    def __init__(self):
        self.recorder, self.marks = None, []

    def record(self, recorder):
        self.recorder = recorder

    def mark(self, text):
        self.marks.append(text)


@pytest.fixture
def session():
    return FakeSession()


@pytest.fixture
def desk(session, tmp_path):
    return TakeDesk(session, lambda path: SimpleNamespace(path=path), tmp_path / "takes")


def wait_for(condition):
    end = time.monotonic() + 5
    while not condition() and time.monotonic() < end:
        time.sleep(0.01)
    return condition()


def test_settings_takes_marks_and_pokes_come_over_osc(session, desk):
    held = {"a.number": 0.2, "a.switch": True}
    names = [LiveSetting(n, n, lambda n=n: held[n], lambda v, n=n: held.update({n: v})) for n in held]
    tuning, told, pokes = Tuning(names), [], []
    with listening(orders(None, tuning, desk, lambda: pokes.append(1)), 0, tell=told.append) as port:
        client = SimpleUDPClient("127.0.0.1", port)
        client.send_message("/sixpoint/set", ["a.number", 0.75])
        client.send_message("/sixpoint/set", ["a.switch", 0])
        assert wait_for(lambda: tuning.value("a.switch") is False)
        assert wait_for(lambda: tuning.value("a.number") == 0.75)
        client.send_message("/sixpoint/set", ["a.number", 7.0])
        client.send_message("/sixpoint/set", ["a.colour", 1.0])
        assert wait_for(lambda: len(told) == 2)
        assert "a number from 0 to 1" in " ".join(told)
        assert "use a.number, a.switch" in " ".join(told)
        client.send_message("/sixpoint/record", 1)
        assert wait_for(lambda: session.recorder is not None)
        client.send_message("/sixpoint/mark", "here")
        client.send_message("/sixpoint/mark", [])
        assert wait_for(lambda: len(session.marks) == 2)
        assert set(session.marks) == {"here", "mark 2"} or set(session.marks) == {"here", "mark 1"}
        client.send_message("/sixpoint/record", 0)
        assert wait_for(lambda: session.recorder is None)
        client.send_message("/sixpoint/poke", [])
        assert wait_for(lambda: pokes == [1])
        client._sock.close()
    assert tuning.apply() == {"a.number": 0.75, "a.switch": False}


def test_r_begins_a_take_and_ends_it(session, desk, tmp_path):
    desk.toggle()
    assert session.recorder.path.parent == tmp_path / "takes"
    assert session.recorder.path.suffix == ".mcap"
    desk.mark()
    assert session.marks == ["mark 1"]
    assert "1 mark" in desk.badges()[0].text
    desk.toggle()
    assert session.recorder is None
    assert desk.badges() == ()


def test_a_mark_without_a_take_is_told_and_does_nothing(session, desk):
    desk.mark()
    assert session.marks == []
    assert "nothing is being recorded" in desk.badges()[0].text


def test_a_take_that_cannot_begin_is_told_and_the_session_goes_on(session, tmp_path):
    def refuse(path: Path):
        raise FileError(f"{path}: the disk is full")

    desk = TakeDesk(session, refuse, tmp_path)
    desk.toggle()
    assert session.recorder is None
    assert "the disk is full" in desk.badges()[0].text


def test_a_take_that_the_session_gave_up_is_no_longer_shown(session, desk):
    desk.start()
    desk._since -= 60.0
    session.recorder = None
    assert desk.badges() == ()
    desk.toggle()
    assert session.recorder is not None


def test_no_two_takes_of_a_second_have_one_name(tmp_path):
    made = []
    for _ in range(4):
        made.append(dated_take(tmp_path))
        made[-1].touch()
    assert len(set(made)) == 4
