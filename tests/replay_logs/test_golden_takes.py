"""Each protocol's golden take through its driver into samples and frames, as a live session would have them."""

import numpy as np
import pytest

from devices.protocols import protocols
from devices.sample import ROLES
from replay_logs.frames import load_frames
from replay_logs.golden_takes import FOLDER, GARBAGE, HIDDEN_S, SECONDS, GoldenSource, walking_on_the_spot
from replay_logs.player import TakePlayer
from replay_logs.take import read_take
from tests.replay_logs.recordings import read_out

every_protocol = pytest.mark.parametrize("name", protocols())


@every_protocol
def test_the_player_gives_every_sample_and_its_bytes(name):
    path = FOLDER / f"{name}.mcap"
    assert path.stat().st_size < 100_000
    take = read_take(path)
    assert take.missing is None
    (device,) = take.devices
    played = read_out(TakePlayer(take, device, speed=None))
    assert played.samples == list(take.samples(device))
    assert tuple(played.chunks) == take.chunks[device.name]
    source = GoldenSource.of(name)
    told = len(list(source.told())) * len(source.roles)
    # Garbage may cost the frame behind it, and a device may leave out a tracker that it does not see.
    unseen = (HIDDEN_S[1] - HIDDEN_S[0]) / SECONDS / len(source.roles)
    assert (1 - 2 * GARBAGE - unseen) * told - 3 * len(source.roles) <= len(played.samples) <= told


@every_protocol
def test_its_frames_are_where_the_person_was(name):
    frames = load_frames(FOLDER / f"{name}.mcap", 60)
    roles = GoldenSource.of(name).roles
    assert abs(len(frames) - 60 * SECONDS) < 60 / GoldenSource.of(name).rate_hz + 2
    positions = np.array([frame.positions[[ROLES.index(role) for role in roles]] for frame in frames])
    times = np.array([frame.time_s for frame in frames])
    truth = walking_on_the_spot(roles, SECONDS)
    seen = np.isfinite(positions[..., 0])
    hidden = (times > HIDDEN_S[0] + 0.1) & (times < HIDDEN_S[1] - 0.1)
    assert not seen[hidden, 1].any()
    assert seen[:, 0].mean() > 0.6
    # A device of few readings a second draws a wrist's curve with straight lines.
    tolerance = 0.005 + 2.0 / GoldenSource.of(name).rate_hz ** 2
    clock = np.arange(len(truth.positions)) / truth.fps
    for tracker in range(len(roles)):
        for axis in range(3):
            expected = np.interp(times, clock, truth.positions[:, tracker, axis])
            error = np.abs(positions[:, tracker, axis] - expected)[seen[:, tracker]]
            assert error.max() < tolerance, (roles[tracker], axis)
