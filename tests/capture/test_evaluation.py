import csv
import json
from dataclasses import replace
from pathlib import Path

import pytest

from capture.commands.evaluate import actions, tables, tracker_counts
from capture.evaluation import Plan, mean_scores, run_experiment, run_without_actions
from capture.evaluation_data import (
    ACTION_PATTERN,
    HOLD_OUT,
    Clip,
    evenly_chosen,
    find_clips,
    split_by_action,
    split_off,
)
from capture.evaluation_report import TITLES, markdown, markdown_without_actions, tables_of, write_report
from capture.evaluation_runs import METHODS, TRACKER_SETS, tracker_frames
from devices.errors import FileError, SettingError
from devices.sample import ROLES
from reconstruction.motion_files.bvh import write_bvh
from tests.reconstruction.conftest import strolling

SHOWN = ("mean-16-ik", "default")


def clips(action: str, count: int) -> list[Clip]:
    return [Clip(Path(f"{action}_{number:02d}.bvh"), action) for number in range(count)]


@pytest.mark.parametrize("count", [2, 3, 7, 8, 9, 40])
def test_an_eighth_of_each_action_is_held_out(count: int) -> None:
    split = split_by_action(clips("walk", count) + clips("run", 16))
    walking = [clip for clip in split.held_out if clip.action == "walk"]
    assert len(walking) == max(1, (count + HOLD_OUT // 2 - 1) // HOLD_OUT)
    assert not set(split.held_out) & set(split.training)
    assert len(split.held_out) + len(split.training) == count + 16


def test_an_action_of_one_clip_is_learned_from() -> None:
    split = split_by_action(clips("walk", 8) + clips("bow", 1))
    assert all(clip.action == "walk" for clip in split.held_out)


def test_nothing_to_hold_out_is_told() -> None:
    with pytest.raises(FileError, match="two of one action"):
        split_by_action(clips("walk", 1))


@pytest.mark.parametrize(
    ("name", "action"),
    [
        ("cmu_train_walking_extra_13", "walking"),
        ("dataset-2_raise-up-both-hands_active_001", "raise-up-both-hands"),
        ("Punch03", "punch"),
        ("07_01", "07_01"),
    ],
)
def test_actions_are_read_off_file_names(name: str, action: str, tmp_path: Path) -> None:
    (tmp_path / f"{name}.bvh").touch()
    assert [clip.action for clip in find_clips([tmp_path], ACTION_PATTERN)] == [action]


def test_missing_data_and_bad_patterns_are_told(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="no such file"):
        find_clips([tmp_path / "none"])
    (tmp_path / "a.bvh").touch()
    with pytest.raises(FileError, match="regular expression"):
        find_clips([tmp_path], "(")


def test_frames_have_the_roles_asked_for_alone() -> None:
    frames = tracker_frames(strolling(frames=5), TRACKER_SETS[3])
    assert len(frames) == 5
    assert [role for role, there in zip(ROLES, frames[0].measured, strict=True) if there] == list(TRACKER_SETS[3])


def test_numbers_of_trackers_are_checked() -> None:
    assert tracker_counts("6,4,6") == (6, 4)
    for text in ("1", "7", "six", ""):
        with pytest.raises(SettingError, match="2 to 6"):
            tracker_counts(text)


def test_an_unknown_method_is_told_with_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match="mean-16-ik"):
        run_experiment([tmp_path], tmp_path, Plan(methods=("magic",)))


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    for number in range(10):
        write_bvh(strolling(number, frames=70), folder / f"{'walk' if number < 6 else 'run'}_{number}.bvh")
    return folder


@pytest.fixture(scope="module")
def experiment(data: Path, tmp_path_factory: pytest.TempPathFactory):
    out = tmp_path_factory.mktemp("out")
    return run_experiment([data], out, Plan(methods=SHOWN, counts=(4, 6), seconds=0.6))


def test_every_run_of_every_clip_is_scored(experiment) -> None:
    held = {clip.path.stem for clip in experiment.split.held_out}
    runs = {(s.database, s.trackers, s.method, s.clip) for s in experiment.scores}
    assert runs == {(*run, clip) for run in experiment.plan.runs() for clip in held}
    assert experiment.poses["small"] < experiment.poses["large"]


def test_the_tables_are_means_of_the_scores(experiment) -> None:
    found = tables_of(experiment)
    assert set(found) == set(TITLES)
    six = [s for s in experiment.scores if (s.method, s.trackers, s.database) == ("default", 6, "large")]
    mean = sum(s.accuracy.euler_deg for s in six) / len(six)
    assert found["table1"]["default", "6"].euler_deg == pytest.approx(mean)


def test_the_least_of_a_column_is_bold(experiment) -> None:
    text = markdown(experiment)
    row = next(line for line in text.splitlines() if line.startswith("| sixpoint"))
    other = next(line for line in text.splitlines() if line.startswith("| mean of 16 nearest, then IK"))
    for ours, theirs in zip(row.split("|")[2:-1], other.split("|")[2:-1], strict=True):
        assert ("**" in ours) or ("**" in theirs)


def test_the_report_is_written_whole(experiment, tmp_path: Path) -> None:
    written = write_report(experiment, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {path.name for path in written}
    lines = list(csv.DictReader((tmp_path / "scores.csv").read_text().splitlines()))
    assert len(lines) == len(experiment.scores)
    assert float(lines[0]["euler_deg"]) == pytest.approx(experiment.scores[0].accuracy.euler_deg, abs=1e-4)
    assert (tmp_path / "figure3.png").read_bytes().startswith(b"\x89PNG")


def test_databases_are_kept_for_the_same_clips(data: Path, tmp_path: Path) -> None:
    plan = Plan(methods=("damped-ik",), counts=(6,), clips=1, seconds=0.3)
    first = run_experiment([data], tmp_path, plan)
    stamp = (tmp_path / "large" / "manifest.json").stat().st_mtime_ns
    again = run_experiment([data], tmp_path, plan)
    assert (tmp_path / "large" / "manifest.json").stat().st_mtime_ns == stamp
    assert [s.accuracy for s in first.scores] == [s.accuracy for s in again.scores]


def test_the_command_prints_json(data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tables([data], tmp_path, ["nearest"], "6", 1, 0.5, None, False, 1, True)
    printed = json.loads(capsys.readouterr().out)
    assert printed["table1"][0]["method"] == "nearest"
    assert (tmp_path / "tables.md").is_file()


def test_methods_are_those_of_the_paper_and_the_rivals() -> None:
    assert {"gplvm", "lpca", "lpcr", "paper", "default", "mean-16-ik"} <= set(METHODS)


def test_an_action_is_left_out_whole() -> None:
    split = split_off(clips("walk", 3) + clips("run", 2), "walk")
    assert {clip.action for clip in split.held_out} == {"walk"}
    assert {clip.action for clip in split.training} == {"run"}
    with pytest.raises(FileError, match="run, walk"):
        split_off(clips("walk", 3) + clips("run", 2), "swim")
    with pytest.raises(FileError, match="cannot be left out"):
        split_off(clips("walk", 3), "walk")


def test_clips_are_chosen_evenly() -> None:
    chosen = evenly_chosen(clips("walk", 9) + clips("run", 2), 3)
    assert [clip.path.stem for clip in chosen] == ["walk_00", "walk_04", "walk_08", "run_00", "run_01"]


def test_every_action_left_out_is_scored_without_itself(data: Path, tmp_path: Path) -> None:
    plan = Plan(methods=("default",), counts=(6,), clips=1, seconds=0.5)
    scores = run_without_actions([data], tmp_path, plan)
    assert [(s.database, s.action) for s in scores] == [("without run", "run"), ("without walk", "walk")]
    text = markdown_without_actions(scores)
    all_of_them = mean_scores(scores, lambda s: ())[()]
    assert f"| all | 2 | {all_of_them.euler_deg:.2f} | {all_of_them.worst_deg:.2f} |" in text
    manifest = json.loads((tmp_path / "without-run" / "manifest.json").read_text())
    assert not any(name.startswith("run") for name, _, _ in manifest["clips"])


def test_several_processes_score_as_one(data: Path, tmp_path: Path) -> None:
    plan = Plan(methods=("damped-ik", "default"), counts=(6,), clips=1, seconds=0.5)
    alone = run_experiment([data], tmp_path, plan)
    together = run_experiment([data], tmp_path, replace(plan, jobs=2))
    assert [(s.method, s.database, s.clip, s.accuracy) for s in alone.scores] == [
        (s.method, s.database, s.clip, s.accuracy) for s in together.scores
    ]


def test_the_command_for_actions_prints_json(data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    actions([data], tmp_path, ["run"], ["damped-ik"], "4", 1, 0.5, None, False, 1, True)
    (row,) = json.loads(capsys.readouterr().out)
    assert (row["method"], row["trackers"], row["left_out"]) == ("damped-ik", 4, "run")
    assert (tmp_path / "actions.md").is_file()
