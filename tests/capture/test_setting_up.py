"""The first session of somebody who configured nothing: found, asked, saved; over a real terminal too."""

import json
import os
import pty
import re
import select
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from capture import device_finding, setting_up
from capture.cli import main
from capture.config import DeviceConfig, PerformerConfig, SessionConfig, read_config
from capture.demo_take import trackers_on
from capture.device_finding import FoundDevice, find_devices, heard_protocol
from capture.profiles import save_profile
from capture.setting_up import choose_device, plan_session, save_session, with_roles
from devices.errors import DeviceError
from devices.sample import ROLES
from devices.serial_link import SerialPort
from devices.simulators.pty_simulator import simulate_device
from reconstruction.calibration import Profile
from reconstruction.motion_library import actions
from reconstruction.motion_library.actions import play
from reconstruction.mounting import Mounting

ROOT = Path(__file__).parents[2]


class ScriptedAsker:
    """Answers from a list, in order, and remembers what it was asked and told."""

    def __init__(self, *answers):
        self.answers, self.heard = list(answers), []

    def say(self, text):
        self.heard.append(text)

    def _answer(self, question):
        self.heard.append(question)
        return self.answers.pop(0)

    def choose(self, question, choices, default=0):
        answer = self._answer(f"{question} {' / '.join(choices)}")
        return list(choices).index(answer) if isinstance(answer, str) else answer

    def number(self, question, low, high, default):
        return self._answer(question)

    def yes(self, question, default=True):
        return self._answer(question)

    def text(self, question, default):
        return self._answer(question)


def walk():
    rng = np.random.default_rng(3)
    return trackers_on(play(actions.walk(rng), 1.75, rng, "walk"))


@pytest.fixture(autouse=True)
def profiles(tmp_path, monkeypatch):
    monkeypatch.setenv("SIXPOINT_PROFILES", str(tmp_path / "profiles"))


def plugged_in(monkeypatch, *found):
    monkeypatch.setattr(setting_up, "find_devices", lambda progress: list(found))


def test_without_a_tracker_it_says_what_to_do(monkeypatch):
    plugged_in(monkeypatch)
    with pytest.raises(DeviceError, match="sixpoint simulate"):
        choose_device(ScriptedAsker())


def test_the_only_tracker_is_taken_and_among_several_one_is_asked_for(monkeypatch):
    one, two = FoundDevice("/dev/a", "generic", "text"), FoundDevice("/dev/b", "", "an adapter")
    plugged_in(monkeypatch, one)
    assert choose_device(ScriptedAsker()) == DeviceConfig(protocol="generic", port="/dev/a")
    plugged_in(monkeypatch, one, two)
    asker = ScriptedAsker("/dev/b: an adapter, silent", "Polhemus FASTRAK")
    assert choose_device(asker) == DeviceConfig(protocol="fastrak", port="/dev/b")
    assert not asker.answers


@pytest.mark.parametrize("protocol", ["generic", "generic-binary"])
def test_a_serial_tracker_is_told_by_what_it_sends(monkeypatch, protocol):
    with simulate_device(walk(), protocol, roles=ROLES) as device:
        ports = [SerialPort(device.path, "USB adapter", (1, 2, "")), SerialPort("/dev/ttyS0", "n/a", None)]
        monkeypatch.setattr(device_finding, "serial_ports", lambda: ports)
        monkeypatch.setattr(device_finding, "hid_ports", list)
        (found,) = find_devices()
    assert (found.port, found.protocol) == (device.path, protocol)


def test_a_port_that_is_silent_or_not_there_speaks_nothing(tmp_path):
    here, there = pty.openpty()
    try:
        assert heard_protocol(os.ttyname(there), 0.05) == ""
    finally:
        os.close(here)
        os.close(there)
    assert heard_protocol(str(tmp_path / "none"), 0.05) == ""


def test_a_device_that_names_its_limbs_asks_nothing():
    with simulate_device(walk(), "generic", roles=ROLES) as device:
        given = DeviceConfig(protocol="generic", port=device.path)
        assert with_roles(ScriptedAsker(), given) == given


def test_who_wears_what_is_found_while_walking_or_said_by_hand(monkeypatch):
    monkeypatch.setattr(setting_up, "_WALK_S", 4.0)
    truth = {str(number): role for number, role in enumerate(ROLES, 1)}
    with simulate_device(walk(), "generic-binary", roles=ROLES) as device:
        given = DeviceConfig(protocol="generic-binary", port=device.path)
        assert with_roles(ScriptedAsker(True, True), given).trackers == truth
        by_hand = ScriptedAsker(False, "root", "head", "nowhere", "left wrist", "nowhere", "nowhere")
        assert with_roles(by_hand, given).trackers == {"1": "root", "2": "head", "4": "left_wrist"}


def test_somebody_new_is_asked_for_name_and_height_and_calibrated(monkeypatch):
    monkeypatch.setattr(setting_up, "with_roles", lambda asker, device: device)
    asker = ScriptedAsker("an/na", "anna", 1.68)
    plan = plan_session(asker, DeviceConfig())
    assert (plan.name, plan.calibrate, plan.config.performer.height_m) == ("anna", True, 1.68)
    assert any("letters" in line for line in asker.heard), "a name that will not do is told, and asked for again"


def test_somebody_known_is_calibrated_again_only_where_trackers_sit_otherwise(monkeypatch):
    monkeypatch.setattr(setting_up, "with_roles", lambda asker, device: device)
    save_profile("anna", Profile({"stature": 1.0}, Mounting.at_the_joints(), 0.4))
    plan = plan_session(ScriptedAsker("anna", True), DeviceConfig())
    assert (plan.name, plan.calibrate, plan.config.performer.profile) == ("anna", False, "anna")
    plan = plan_session(ScriptedAsker("anna", False, 1.7), DeviceConfig())
    assert (plan.calibrate, plan.config.performer.profile) == (True, "")
    plan = plan_session(ScriptedAsker(), DeviceConfig(), "anna")
    assert (plan.calibrate, plan.config.performer.profile) == (False, "anna")


def test_what_is_saved_is_what_was_found_out(tmp_path):
    path = tmp_path / "session.toml"
    device = DeviceConfig(protocol="fastrak", port="/dev/ttyUSB0", trackers={"1": "head", "2": "root"})
    config = SessionConfig(performer=PerformerConfig(profile="anna"), device=(device,))
    assert save_session(ScriptedAsker(), config, path) == path
    assert read_config(path) == config
    assert save_session(ScriptedAsker(False), SessionConfig(), path) is None
    assert read_config(path) == config
    assert [p.name for p in tmp_path.iterdir()] == ["session.toml"]


def test_without_a_terminal_nothing_is_asked(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["live"]) == 2
    told = capsys.readouterr().err
    assert "no terminal" in told
    assert "--device" in told
    assert told.count("\n") == 1


SCRIPT = """
import sys
from types import SimpleNamespace
from capture import going_live, guided_session
from capture.cli import main
from reconstruction.calibration import Profile
from reconstruction.mounting import Mounting

def calibrate(config, height_m, shown):
    assert height_m == 1.68
    assert not shown
    profile = Profile({"stature": 0.96}, Mounting.at_the_joints(), 0.3, height_m=1.68)
    return SimpleNamespace(profile=profile, verdict="it fits", residuals_cm={"head": 0.3})

guided_session.calibrate_live = calibrate
going_live.go_live = lambda config, *rest: print("STARTED", config.model_dump_json())
sys.exit(main(sys.argv[1:]))
"""


def test_the_whole_way_at_a_real_terminal(tmp_path):
    environment = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    environment |= {"PYTHONPATH": str(ROOT), "TERM": "xterm"}
    answers = [("Name of the performer", "anna\n"), ("height in metres", "9\n"), ("height in metres", "1.68\n")]
    with simulate_device(walk(), "generic", roles=ROLES) as device:
        command = [sys.executable, "-c", SCRIPT, "live", "--guide", "--device", "generic", "--port", device.path]
        status, said = at_a_terminal(command, answers, tmp_path, environment)
    assert status == 0, said
    assert "a number from 0.8 to 2.5" in said
    assert "it fits" in said
    config = json.loads(re.search(r"STARTED (\{.*\})", said)[1])
    assert config["performer"]["profile"] == "anna"
    assert read_config(tmp_path / "session.toml").performer.profile == "anna"
    assert (tmp_path / "profiles" / "anna.json").is_file()


def at_a_terminal(command, answers, folder, environment):
    """Runs a command on a pseudo-terminal, answers its questions in turn; gives its status and all it said."""
    here, there = pty.openpty()
    process = subprocess.Popen(command, stdin=there, stdout=there, stderr=there, cwd=folder, env=environment)
    os.close(there)
    said, asked, end = b"", 0, time.monotonic() + 60
    try:
        while time.monotonic() < end:
            if select.select([here], [], [], 0.1)[0]:
                try:
                    piece = os.read(here, 65536)
                except OSError:
                    break  # the other end is closed
                said += piece
            rest = said[asked:].decode(errors="replace")
            if answers and answers[0][0] in rest and rest.rstrip().endswith(":"):
                asked = len(said)
                os.write(here, answers.pop(0)[1].encode())
        return process.wait(10), said.decode(errors="replace").replace("\r\n", "\n")
    finally:
        process.kill()
        process.wait()
        os.close(here)
