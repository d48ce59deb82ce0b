"""Questions to the person at the terminal: only where there is one."""

import sys
from collections.abc import Callable, Sequence
from typing import Protocol

from rich.console import Console
from rich.prompt import Confirm, FloatPrompt, IntPrompt, Prompt

from devices.errors import SixpointError


def can_ask() -> bool:
    """Whether there is somebody to ask: input and output are a terminal."""
    return sys.stdin.isatty() and sys.stderr.isatty()


class Asker(Protocol):
    """Who is asked. Every question has a default, which an empty answer means."""

    def say(self, text: str) -> None:
        """A line that needs no answer."""
        ...

    def choose(self, question: str, choices: Sequence[str], default: int = 0) -> int:
        """The number of a choice, from 0."""
        ...

    def number(self, question: str, low: float, high: float, default: float) -> float:
        """A number from `low` to `high`."""
        ...

    def yes(self, question: str, default: bool = True) -> bool:
        """Yes or no."""
        ...

    def text(self, question: str, default: str) -> str:
        """A few words."""
        ...


class TerminalAsker:
    """Asks on standard error, so that what a command prints stays clean. What does not fit is asked again."""

    def __init__(self) -> None:
        self._console = Console(stderr=True, highlight=False)

    def say(self, text: str) -> None:
        """See `Asker`."""
        self._console.print(text)

    def choose(self, question: str, choices: Sequence[str], default: int = 0) -> int:
        """See `Asker`."""
        self.say(question)
        for number, choice in enumerate(choices, 1):
            self.say(f"  {number}  {choice}")
        numbers = [str(number) for number in range(1, len(choices) + 1)]
        given = IntPrompt.ask("Number", console=self._console, choices=numbers, default=default + 1, show_choices=False)
        return given - 1

    def number(self, question: str, low: float, high: float, default: float) -> float:
        """See `Asker`."""
        while True:
            given = FloatPrompt.ask(f"{question} ({low:g} to {high:g})", console=self._console, default=default)
            if low <= given <= high:
                return given
            self.say(f"a number from {low:g} to {high:g}, please")

    def yes(self, question: str, default: bool = True) -> bool:
        """See `Asker`."""
        return Confirm.ask(question, console=self._console, default=default)

    def text(self, question: str, default: str) -> str:
        """See `Asker`."""
        return Prompt.ask(question, console=self._console, default=default).strip()


def checked_answer(asker: Asker, question: str, default: str, check: Callable[[str], object]) -> str:
    """A text that `check` does not object to with a SixpointError; what it says is told, and it is asked again."""
    while True:
        given = asker.text(question, default)
        try:
            check(given)
        except SixpointError as error:
            asker.say(str(error))
        else:
            return given
