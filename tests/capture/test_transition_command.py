"""`sixpoint transition` and `sixpoint evaluate transitions`, as a user runs them."""

import json
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from capture.commands.transition import evaluate_transitions, transition
from devices.errors import FileError, SettingError, SixpointError
from reconstruction.motion_files import read_bvh, write_bvh
from reconstruction.transition import MotionClass

from ..reconstruction.moving_bodies import standing, walking

app = typer.Typer()
app.command("transition")(transition)
app.command("evaluate")(evaluate_transitions)


@pytest.fixture(scope="module")
def clips(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("clips")
    for name, motion in (("walk_1", walking(90)), ("wave_1", standing(60)), ("walk_2", walking(80, speed_m_s=1.0))):
        write_bvh(motion, folder / f"{name}.bvh")
    return folder


def run(*arguments: object) -> str:
    """What the command prints. Raises what it raises."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


def test_two_clips(clips: Path, tmp_path: Path) -> None:
    out = tmp_path / "C.bvh"
    told = run("transition", clips / "walk_1.bvh", clips / "wave_1.bvh", "--at", "0.5s", "--out", out, "--json")
    figures = json.loads(told.splitlines()[-1])
    frames = figures["transitions"][0]["frames"]
    assert len(read_bvh(out)) == 31 + frames + 60
    assert [path.name for path in tmp_path.iterdir()] == ["C.bvh"]


def test_a_playlist(clips: Path, tmp_path: Path) -> None:
    playlist = clips / "list.txt"
    playlist.write_text("# a comment\nwalk_1.bvh 40\nwalk_2.bvh 1.0s 5\nwave_1.bvh\n")
    out = tmp_path / "C.bvh"
    told = run("transition", "--playlist", playlist, "--out", out, "--method", "paper")
    assert told.count("transition of") == 2
    assert len(read_bvh(out)) > 41 + 56 + 60


def test_a_matrix(clips: Path, tmp_path: Path) -> None:
    rows = json.loads(run("transition", "--matrix", clips, "--json", "--out", tmp_path / "m.csv").splitlines()[-1])
    assert len(rows) == 6
    assert {row["left_class"] for row in rows} == {kind.value for kind in MotionClass} - {"space flight"}
    assert len((tmp_path / "m.csv").read_text().splitlines()) == 7


def test_evaluation(clips: Path) -> None:
    report = json.loads(run("evaluate", "--data", clips, "--pairs", 2, "--exits", 2, "--json").splitlines()[-1])
    assert report["methods"][0]["method"] == "natural"
    assert report["methods"][0]["cases"] == 4
    assert report["classification_agreement"] == 1
    assert "natural" in run("evaluate", "--data", clips, "--pairs", 1, "--exits", 1)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ((), SettingError, "give motions, --playlist or --matrix"),
        (("A.bvh", "B.bvh"), SettingError, "--out is missing"),
        (("A.bvh", "B.bvh", "--out", "C.bvh"), FileError, r"A\.bvh: No such file"),
        (("A.bvh", "B.bvh", "--out", "C.xyz"), SettingError, r"\.xyz"),
        (("{}/walk_1.bvh", "--out", "C.bvh"), SettingError, "two motions are needed"),
        (("{}/walk_1.bvh", "{}/wave_1.bvh", "--out", "C.bvh", "--at", "900"), SettingError, "has frames 0 to 89"),
        (("{}/walk_1.bvh", "{}/wave_1.bvh", "--out", "C.bvh", "--at", "soon"), SettingError, "use a frame"),
        (("{}/walk_1.bvh", "{}/wave_1.bvh", "--out", "C.bvh", "--into", "99"), SettingError, "has frames 0 to 59"),
        (("{}/walk_1.bvh", "{}/wave_1.bvh", "--out", "C.bvh", "--method", "x"), SettingError, "use natural, paper"),
        (("--matrix", "{}/nowhere"), FileError, "no such folder"),
    ],
)
def test_wrong_requests_are_one_line(
    clips: Path, arguments: tuple[str, ...], error: type[SixpointError], message: str
) -> None:
    with pytest.raises(error, match=message) as caught:
        run("transition", *(argument.format(clips) for argument in arguments))
    assert "\n" not in str(caught.value)
