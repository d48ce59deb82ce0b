"""What documents repeat of the program, options and settings: `python -m tests.command_reference` writes it anew."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from capture.cli import app
from capture.config import commented_config

_DOCS = Path(__file__).parents[1] / "docs"
_BLOCK = re.compile(r"<!-- options of (?P<name>[a-z ]+) -->\n.*?<!-- end of options -->\n", re.DOTALL)
_SETTINGS = re.compile(r"<!-- session.toml -->\n.*?<!-- end of session.toml -->\n", re.DOTALL)


def commands() -> dict[str, Any]:
    """Every command by its words, `database build`, in the order of `sixpoint --help`."""
    return dict(_below(typer.main.get_command(app), ()))


def _below(command: Any, words: tuple[str, ...]) -> Iterator[tuple[str, Any]]:
    inside = getattr(command, "commands", None)
    if inside is None:
        yield " ".join(words), command
        return
    for name, child in inside.items():
        yield from _below(child, (*words, name))


def with_settings(page: str) -> str:
    """The page with `session.toml` as `config init` writes it."""
    block = f"<!-- session.toml -->\n```toml\n{commented_config().rstrip()}\n```\n<!-- end of session.toml -->\n"
    return _SETTINGS.sub(lambda _: block, page)


def with_options(page: str) -> str:
    """The page with every table as it ought to be; commands that it does not know come at the end.

    Raises KeyError for a table of a command that is no more.
    """
    known = commands()
    page = _BLOCK.sub(lambda block: _described(block["name"], known[block["name"]]), page)
    missing = known.keys() - {block["name"] for block in _BLOCK.finditer(page)}
    new = [f"\n## sixpoint {name}\n\n{_described(name, known[name])}" for name in known if name in missing]
    return page + "".join(new)


def _described(name: str, command: Any) -> str:
    """What the command's help says, as Markdown between its marks."""
    rows = [_row(parameter) for parameter in command.params]
    table = "\n".join(["| | meaning | default |", "|---|---|---|", *rows])
    return f"<!-- options of {name} -->\n{command.help}\n\n{table}\n<!-- end of options -->\n"


def _row(parameter: Any) -> str:
    meaning = (parameter.help or _plain(parameter.name)).replace("|", "\\|") + _range(parameter)
    return f"| {_called(parameter)} | {meaning} | {_default(parameter)} |"


def _called(parameter: Any) -> str:
    if parameter.param_type_name == "argument":
        return f"`{parameter.name.upper()}`" + (" ..." if parameter.nargs == -1 else "")
    names = [*parameter.opts, *parameter.secondary_opts]
    return ", ".join(f"`{name}`" for name in names) + (" ..." if parameter.multiple else "")


def _range(parameter: Any) -> str:
    low, high = getattr(parameter, "min", None), getattr(parameter, "max", None)
    if low is None and high is None:
        return ""
    return f" At least {low:g}." if high is None else f" From {low:g} to {high:g}."


def _default(parameter: Any) -> str:
    value = parameter.default
    if parameter.required:
        return "must be given"
    if isinstance(value, bool):
        return ("on" if value else "off") if parameter.secondary_opts else ""
    return "" if value in (None, "", (), []) else f"`{value}`"


def _plain(name: str) -> str:
    return name.replace("_", " ").capitalize() + "."


PAGES = {_DOCS / "commands.md": with_options, _DOCS / "file_formats.md": with_settings}
"""What brings each page up to date."""

if __name__ == "__main__":
    for path, renewed in PAGES.items():
        path.write_text(renewed(path.read_text(encoding="utf-8")), encoding="utf-8")
