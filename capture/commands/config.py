"""`sixpoint config init`: a session.toml to start from."""

from pathlib import Path
from typing import Annotated

import typer

from devices.errors import FileError


def init(
    path: Annotated[Path, typer.Argument(help="The file to write.")] = Path("session.toml"),
) -> None:
    """Write a session.toml with every setting at its default, its meaning and its range beside it."""
    from capture.config import commented_config

    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(commented_config())
    except FileExistsError:
        raise FileError(f"{path}: there is a file already; name another one") from None
    print(f"wrote {path}")


def check(path: Annotated[Path, typer.Argument(help="A session.toml.")] = Path("session.toml")) -> None:
    """Say whether a session.toml is right, and what is wrong where."""
    from capture.config import read_config

    config = read_config(path)
    print(f"{path}: right; {len(config.device) or 'no'} device{'' if len(config.device) == 1 else 's'} named")
