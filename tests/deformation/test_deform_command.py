"""The command `sixpoint deform` and the tables of speed and volume, on the smallest mannequin."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from capture.commands.deform import deform
from capture.deform_benchmark import benchmark, table
from capture.export import write_npz
from capture.volume_report import HARD_POSES, volume_report, volume_table
from deformation.character import Character, mannequin_character
from devices.errors import SixpointError
from reconstruction.motion import Motion
from reconstruction.standard_body import standard_skeleton


@pytest.fixture(scope="module")
def mannequin() -> Character:
    return mannequin_character(standard_skeleton(), "low")


@pytest.fixture
def motion_file(tmp_path: Path) -> Path:
    skeleton, frames = standard_skeleton(), 4
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (frames, len(skeleton), 1))
    knee = skeleton.names.index("LeftLeg")
    bend = np.linspace(0, 0.8, frames)
    rotations[:, knee, 0], rotations[:, knee, 3] = np.sin(bend / 2), np.cos(bend / 2)
    motion = Motion(skeleton, np.tile(skeleton.offsets[0], (frames, 1)), rotations, 30.0, "bend")
    write_npz(motion, tmp_path / "bend.npz")
    return tmp_path / "bend.npz"


def run(*arguments: object) -> None:
    app = typer.Typer()
    app.command()(deform)
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output


def test_vertices_of_every_frame_are_written(motion_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "x.npz"
    run("mannequin", motion_file, "--out", out, "--resolution", "low", "--particles", "600")
    with np.load(out) as data:
        assert data["vertices"].shape[0] == 4
        assert data["vertices"].shape[2] == 3
        assert data["quads"].max() == data["vertices"].shape[1] - 1
        assert np.abs(data["vertices"][3] - data["vertices"][0]).max() > 0.1
        assert float(data["fps"]) == 30
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bend.npz", "x.npz"]


def test_pictures_and_characters_are_written(motion_file: Path, tmp_path: Path) -> None:
    run(
        "mannequin", motion_file, "--out", tmp_path / "frames", "--resolution", "low", "--width", "96", "--height", "64"
    )
    assert len(list((tmp_path / "frames").glob("frame_*.png"))) == 4
    run("mannequin", motion_file, "--out", tmp_path / "x.glb", "--resolution", "low")
    assert (tmp_path / "x.glb").read_bytes()[:4] == b"glTF"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--out", "x.xyz"], "ending"),
        (["--out", "no/such/x.npz"], "does not exist"),
        (["--out", "x.npz", "--delta", "2"], "delta"),
        (["--out", "x.npz", "--particles", "500", "--cell-size-m", "0.1"], "use one of them"),
    ],
)
def test_what_cannot_be_is_said_before_work_begins(motion_file: Path, arguments: list[str], message: str) -> None:
    with pytest.raises(SixpointError, match=message):
        run("mannequin", motion_file, *arguments)


def test_volume_stays_and_the_wrist_does_not_wring(mannequin: Character) -> None:
    rows = volume_report(mannequin)
    assert [row["pose"] for row in rows] == list(HARD_POSES)
    for row in rows:
        assert abs(row["ours"]["worst_part"]) <= 0.01
        assert abs(row["ours"]["lattice"]) <= 0.007
        assert abs(row["linear"]["worst_part"]) > 0.05
    twist = next(row for row in rows if "twist" in row["pose"])
    assert 1 - twist["ours"]["smallest_girth"] < 0.5 * (1 - twist["linear"]["smallest_girth"])
    assert volume_table(rows).row_count == len(rows)  # type: ignore[attr-defined]


def test_no_leg_of_the_mannequin_follows_the_other(mannequin: Character) -> None:
    names = mannequin.skeleton.names
    weights = np.zeros((len(mannequin.mesh.vertices), len(names)))
    for k in range(4):
        weights[np.arange(len(weights)), mannequin.vertex_joints[:, k]] += mannequin.vertex_weights[:, k]
    legs = {
        side: [names.index(f"{side}{part}") for part in ("UpLeg", "Leg", "Foot", "ToeBase")]
        for side in ("Left", "Right")
    }
    left = np.isin(weights.argmax(axis=1), legs["Left"])
    assert left.sum() > 200
    assert weights[left][:, legs["Right"]].sum(axis=1).max() < 0.02


def test_the_benchmark_gives_every_figure() -> None:
    rows = benchmark(particles=(700,), resolution="low", frames=10, reference_frames=1)
    row = json.loads(json.dumps(rows))[0]
    assert set(row["stages_ms"]) == set(row["numpy_ms"]) == {"skinning", "volume", "secondary", "vertices", "normals"}
    assert all(math.isfinite(ms) and ms > 0 for ms in row["stages_ms"].values())
    assert row["joints"] == 38
    assert row["frame_cpu_ms"]["p50"] <= row["frame_cpu_ms"]["max"]
    assert row["worst_part_loss"] < 0.01
    assert table(rows).row_count == 1  # type: ignore[attr-defined]
