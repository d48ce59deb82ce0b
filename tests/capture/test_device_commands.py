"""`sixpoint devices`, `simulate` and `doctor` as a user runs them."""

import json
import threading
import time
from functools import partial

import numpy as np
import pytest

from capture.commands.devices import devices, doctor, simulate
from devices.errors import DeviceError, FileError, SettingError
from devices.linked_device import LinkedDevice
from devices.protocols import make_protocol, protocols
from devices.registry import make_device
from devices.sample import ROLES, TrackerSample
from devices.simulators import uhid_port, uhid_simulator
from replay_logs.csv_tracks import write_tracks_csv
from replay_logs.frames import load_frames
from replay_logs.golden_takes import FOLDER, walking_on_the_spot
from tests.devices.uhid_kernel import FakeKernel


@pytest.fixture
def tracks(tmp_path):
    """A tracks file of someone who marches on the spot."""
    motion = walking_on_the_spot(ROLES, 3.5, fps=60)
    path = tmp_path / "tracks.csv"
    write_tracks_csv(
        path,
        [
            TrackerSample(role, round(i / 60 * 1e9), tuple(place))
            for i, row in enumerate(motion.positions)
            for role, place in zip(ROLES, row, strict=True)
        ],
    )
    return path


class Simulated:
    """`sixpoint simulate` in a thread, on a port of a known name."""

    def __init__(self, motion, port, **options) -> None:
        self.port = port
        self._thread = threading.Thread(target=simulate, args=(motion,), kwargs={"port": port, **options}, daemon=True)

    def __enter__(self) -> str:
        self._thread.start()
        end = time.perf_counter() + 20
        while not self.port.exists() and time.perf_counter() < end:
            time.sleep(0.02)
        return str(self.port)

    def __exit__(self, *_) -> None:
        self._thread.join(20)
        assert not self._thread.is_alive()


def test_devices_lists_what_can_be_read(capsys):
    devices(as_json=True)
    listed = json.loads(capsys.readouterr().out)
    assert {device["name"] for device in listed["devices"]} == set(protocols())
    devices()
    assert "Polhemus FASTRAK" in capsys.readouterr().out


@pytest.mark.parametrize("motion", ["tracks", "take"])
def test_a_tracks_file_or_a_take_is_streamed(motion, tracks, tmp_path, capsys):
    source = tracks if motion == "tracks" else FOLDER / "generic.mcap"
    with Simulated(source, tmp_path / "port", noise_mm=1.0) as port:
        device = make_device("generic", port)
        device.open()
        assert set(device.role_hints.values()) == set(ROLES)
        assert any(device.read(0.2).samples for _ in range(20))
        device.close()
    assert "samples" in capsys.readouterr().out


def test_the_doctor_measures_a_simulated_device(tracks, tmp_path, capsys):
    with Simulated(tracks, tmp_path / "port", trackers="left_wrist,right_wrist", rate=100.0) as port:
        doctor("generic", port, seconds=2.0, as_json=True)
    report = json.loads(next(line for line in capsys.readouterr().out.splitlines() if line.startswith("{")))
    assert [tracker["tracker"] for tracker in report["trackers"]] == ["1", "2"]
    assert report["trackers"][0]["rate_hz"] == pytest.approx(100, rel=0.2)
    assert report["smoothing_lag_ms"]["2.0"] < report["smoothing_lag_ms"]["0.1"]


def test_a_hid_device_is_played_to_the_kernel(tracks, tmp_path, monkeypatch, capsys):
    kernel = FakeKernel(tmp_path)
    through_fake = partial(uhid_simulator.UhidSimulator, open_descriptor=kernel.descriptor, nodes=kernel.nodes)
    monkeypatch.setattr(uhid_simulator, "UhidSimulator", through_fake)
    options = {"device": "generic-hid", "trackers": "left_wrist,right_wrist"}
    player = threading.Thread(target=simulate, args=(tracks,), kwargs=options, daemon=True)
    player.start()
    end = time.perf_counter() + 20
    while not kernel.ready and time.perf_counter() < end:
        time.sleep(0.02)
    device = LinkedDevice("generic-hid", kernel, make_protocol("generic-hid"))
    device.open()
    heard = {sample.tracker for _ in range(50) for sample in device.read(0.05).samples}
    player.join(20)
    assert not player.is_alive()
    kernel.end()
    assert heard == {"1", "2"}
    said = capsys.readouterr().out.split()
    assert (said[0], said[2]) == ("/dev/hidraw7", "samples,")
    assert int(said[1]) > 100


def test_a_machine_without_uhid_refuses_hid_devices_in_one_line(tracks, tmp_path, monkeypatch):
    monkeypatch.setattr(uhid_port, "UHID", tmp_path / "uhid")
    with pytest.raises(DeviceError, match="try sudo modprobe uhid"):
        simulate(tracks, device="hydra")


def test_wrong_arguments_are_one_line_each(tracks, tmp_path):
    with pytest.raises(SettingError, match="unknown tracker role 'hand'"):
        simulate(tracks, trackers="hand")
    with pytest.raises(SettingError, match="unknown device"):
        simulate(tracks, device="wand")
    with pytest.raises(SettingError, match="hydra is a HID device: --port"):
        simulate(tracks, device="hydra", port=tmp_path / "port")
    with pytest.raises(FileError, match="simulate takes"):
        simulate(tmp_path / "motion.txt")
    with pytest.raises(DeviceError, match="does not exist"):
        doctor("generic", "/dev/ttyUSB77", seconds=2.0)


def test_a_golden_take_goes_on_into_poses(database, run, tmp_path):
    take, out = FOLDER / "flock_of_birds.mcap", tmp_path / "poses.npz"
    status, _, error = run("reconstruct", take, "--database", database, "--out", out)
    assert status == 0, error
    with np.load(out) as poses:
        lengths = {len(poses[key]) for key in poses if poses[key].ndim}
        assert all(np.isfinite(poses[key]).all() for key in poses if poses[key].dtype.kind == "f")
    assert len(load_frames(take, 60)) in lengths
