"""What the documents show works: every command line runs, every link and picture is there, every option is named.

A fenced block marked `sh` holds what a user types; its `sixpoint` lines run one after the other in an empty folder,
with the example files that they name put there first. `sh norun` marks what needs a display, hardware, the internet or
minutes; `/dev/` in a line, and a `simulate` that waits in the foreground, do so by themselves. Those are only parsed.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.exceptions import TyperException

from capture.cli import app, main
from reconstruction.motion import Motion
from reconstruction.motion_files import read_motion, write_bvh
from reconstruction.motion_operations import cropped
from tests.capture.conftest import clips, database, tracks  # noqa: F401
from tests.command_reference import PAGES

ROOT = Path(__file__).parents[1]
DOCUMENTS = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])
NAMES = [str(path.relative_to(ROOT)) for path in DOCUMENTS]
BRIEF = {"demo": ["--seconds", "1", "--resolution", "low"]}
"""What is added to a command, to be done within seconds."""

_FENCE = re.compile(r"^```sh(?P<norun> norun)?\n(?P<body>.*?)^```$", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"\]\((?P<target>[^)\s]+)\)")
_HEADING = re.compile(r"^#+ +(.+)$", re.MULTILINE)
_ANY_FENCE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
_OUTPUTS = ("--out", "--record")


@dataclass(frozen=True)
class CommandLine:
    """One `sixpoint` line of a document. words: without `sixpoint`; background: ends with &."""

    words: tuple[str, ...]
    run: bool
    background: bool


def command_lines(text: str) -> Iterator[CommandLine]:
    """The `sixpoint` lines in the `sh` blocks of a document, in order."""
    for block in _FENCE.finditer(text):
        for line in block["body"].replace("\\\n", " ").splitlines():
            words = shlex.split(line, comments=True)
            if not words or Path(words[0]).name != "sixpoint":
                continue
            background = words[-1] == "&"
            words = words[1:-1] if background else words[1:]
            waits = "/dev/" in line or (words[:1] == ["simulate"] and not background)
            yield CommandLine(tuple(words), not (block["norun"] or waits), background)


def parse(words: tuple[str, ...]) -> None:
    """Whether there is such a command with such options, without doing anything. Raises typer's exceptions."""
    command, rest = typer.main.get_command(app), list(words)
    while hasattr(command, "commands"):
        if rest in ([], ["--help"]):
            return
        name = rest.pop(0)
        assert name in command.commands, f"no command {name!r}: there are {', '.join(command.commands)}"
        command = command.commands[name]
    command.make_context("sixpoint", rest)


@pytest.fixture(scope="session")
def examples(clips, database, tracks, tmp_path_factory) -> dict[str, Callable[[Path], object]]:  # noqa: F811
    """What makes each file that the documents take as given."""

    def copied(source: Path) -> Callable[[Path], object]:
        return lambda to: shutil.copytree(source, to) if source.is_dir() else shutil.copy(source, to)

    return {
        "clips": copied(clips),
        "my_database": copied(database),
        "walk.csv": copied(tracks),
        "walk.bvh": lambda to: write_bvh(beginning(clips / "walk_1.bvh"), to),
        "run.bvh": lambda to: write_bvh(beginning(clips / "run_1.bvh"), to),
        "take.mcap": copied(ROOT / "replay_logs" / "takes" / "generic.mcap"),
        "session.toml": lambda to: main(["config", "init", str(to)]),
        "hero.glb": lambda to: make_hero(clips / "walk_1.bvh", to),
        "playlist.txt": lambda to: to.write_text("walk.bvh 0.5s\nrun.bvh\n"),
    }


def beginning(path: Path, seconds: float = 3.0) -> Motion:
    """The first seconds of a motion."""
    motion = read_motion(path)
    return cropped(motion, 0, round(seconds * motion.fps))


def make_hero(path: Path, to: Path) -> None:
    """A character's file: the small mannequin."""
    from capture.export import write_glb
    from deformation.character import mannequin_character

    walk = beginning(path)
    write_glb(mannequin_character(walk.skeleton, "low", walk.pose(0)), walk, to)


def prepare(line: CommandLine, examples: dict[str, Callable[[Path], object]]) -> None:
    """Puts the example files that a line reads into the folder, where the document has not made them itself."""
    made = {line.words[at + 1] for at, word in enumerate(line.words[:-1]) if word in _OUTPUTS}
    if line.words[:2] == ("config", "init"):
        made.update(line.words[2:] or ("session.toml",))
    needed = [name for name in line.words if name in examples and name not in made]
    for name in (*needed, *(("walk.bvh", "run.bvh") if "playlist.txt" in needed else ())):
        if not Path(name).exists():
            examples[name](Path(name))


@pytest.mark.xdist_group("library")
@pytest.mark.parametrize("name", NAMES)
def test_every_command_shown_works(name, examples, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for variable in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(variable, raising=False)
    simulators: list[subprocess.Popen] = []
    try:
        for line in command_lines((ROOT / name).read_text(encoding="utf-8")):
            shown = f"sixpoint {shlex.join(line.words)}"
            try:
                parse(line.words)
            except typer.Exit:
                pass  # --help, --version
            except Exception as error:
                pytest.fail(f"{name}: {shown}: {error}")
            if not line.run:
                continue
            prepare(line, examples)
            if line.background:
                simulators.append(started(line))
                continue
            status = main([*line.words, *(BRIEF.get(line.words[0], []) if "--help" not in line.words else [])])
            assert status == 0, f"{name}: {shown}: {capsys.readouterr().err}"
    finally:
        for simulator in simulators:
            simulator.kill()
            simulator.communicate()


def started(line: CommandLine) -> subprocess.Popen:
    """A line in the background, when it has printed its first line: a simulator's port is there then."""
    paths = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    process = subprocess.Popen(
        [sys.executable, "-m", "capture.cli", *line.words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": paths},
    )
    assert process.stdout is not None
    if not process.stdout.readline():
        pytest.fail(f"sixpoint {shlex.join(line.words)}: {process.communicate()[1]}")
    return process


@pytest.mark.parametrize("name", NAMES)
def test_every_link_leads_somewhere(name):
    here = ROOT / name
    for link in _LINK.finditer(_ANY_FENCE.sub("", here.read_text(encoding="utf-8"))):
        if re.match(r"[a-z]+:", link["target"]):
            continue
        file, _, part = link["target"].partition("#")
        target = here.parent / file if file else here
        assert target.exists(), f"{name} links {link['target']}: there is no such file"
        if part:
            parts = {anchor(heading) for heading in _HEADING.findall(target.read_text(encoding="utf-8"))}
            assert part in parts, f"{name} links {link['target']}: there are {', '.join(sorted(parts))}"


def anchor(heading: str) -> str:
    """What a heading is linked as."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-")


def test_every_document_is_in_the_index():
    linked = {
        (ROOT / "docs" / link["target"].partition("#")[0]).resolve()
        for link in _LINK.finditer((ROOT / "docs" / "README.md").read_text(encoding="utf-8"))
    }
    pages = {path for path in DOCUMENTS if path.is_relative_to(ROOT / "docs") and path.name != "README.md"}
    assert pages <= linked, f"not in docs/README.md: {', '.join(str(p.relative_to(ROOT)) for p in pages - linked)}"


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_options_and_settings_are_those_of_the_program(page):
    text = page.read_text(encoding="utf-8")
    assert text == PAGES[page](text), f"{page.name} is not up to date: run `python -m tests.command_reference`"


def test_what_a_document_may_say_is_understood():
    text = (
        "```sh\nsixpoint demo --out x  # why\nmake demo\n```\n```sh norun\nsixpoint replay t \\\n --height-m 1.7\n```\n"
        "```sh\nsixpoint simulate walk.bvh --port p &\nsixpoint doctor x --port /dev/ttyUSB0\n```\n```python\nx\n```\n"
    )
    assert list(command_lines(text)) == [
        CommandLine(("demo", "--out", "x"), True, False),
        CommandLine(("replay", "t", "--height-m", "1.7"), False, False),
        CommandLine(("simulate", "walk.bvh", "--port", "p"), True, True),
        CommandLine(("doctor", "x", "--port", "/dev/ttyUSB0"), False, False),
    ]


@pytest.mark.parametrize("words", [("demo", "--nonsense"), ("nonsense",), ("database", "build", "clips"), ("replay",)])
def test_a_wrong_command_line_is_noticed(words):
    with pytest.raises((AssertionError, TyperException)):
        parse(words)


def test_the_examples_are_read(examples, tmp_path, monkeypatch):
    from deformation.character_files import read_character
    from replay_logs.take import read_take

    monkeypatch.chdir(tmp_path)
    for name, make in examples.items():
        make(Path(name))
    assert read_character("hero.glb").rig is not None
    assert np.ptp([reading.host_time_ns for reading in read_take("take.mcap").readings()]) > 2e9
