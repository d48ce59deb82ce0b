"""What a person at the window controls: playback, layers and the camera; and what the window asks of a session.

Nothing here knows how the window is drawn (`capture.viewer` does), so all of it works and is tested without one.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

from capture.scene import Camera, Scene

SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0)
_SEEK_S = 1.0
_TURN = math.radians(5)


PAINTS = ("skin", "bones", "parts", "weights", "softness", "regions")
"""What the skin can be coloured by: itself, its strongest bone, its joint-dependent part, one bone's weights, its
softness, the half-width of its shape matching regions (`capture.skin_colours`)."""


@dataclass(frozen=True)
class Layers:
    """What is shown over one another. paint: one of `PAINTS`; bone: the joint, counted, whose weights are painted."""

    skin: bool = True
    skeleton: bool = False
    trackers: bool = True
    lattice: bool = False
    curves: bool = False
    ghosts: bool = False
    uncertainty: bool = False
    statistics: bool = True
    floor: bool = True
    paint: str = "skin"
    bone: int = 0


class FrameSource(Protocol):
    """What the window draws. It is asked from the window's thread, once a picture, and must answer at once."""

    @property
    def duration_s(self) -> float | None:
        """Seconds from the first moment to the last; None while live: then there is nothing to seek in."""
        ...

    @property
    def frame_s(self) -> float:
        """Seconds that one step goes."""
        ...

    def scene(self, time_s: float, layers: Layers) -> Scene:
        """The picture at that moment; a live source ignores the moment and gives its latest."""
        ...


HELD_KEYS = frozenset(["Left", "Right", "Up", "Down", *",.[]ADWS+-N"])
"""Keys that go on while they are held; any other is pressed once."""


def _always() -> bool:
    return True


@dataclass(frozen=True)
class Action:
    """A key of the session's own.

    text: what it does, for the help, or empty for a key that is listed with another; do: called from the window's
    thread; now: whether it has the key at this moment, or else it does what it does in any window.
    """

    text: str
    do: Callable[[], None]
    now: Callable[[], bool] = _always


@dataclass
class Playback:
    """Where in a recording the window is.

    duration_s: None while live, when only the clock runs; marks: seconds of noted moments.
    """

    duration_s: float | None = None
    frame_s: float = 1 / 60
    marks: tuple[float, ...] = ()
    loop: bool = True
    time_s: float = 0.0
    paused: bool = False
    speed: float = 1.0

    @property
    def is_live(self) -> bool:
        return self.duration_s is None

    @property
    def frozen(self) -> bool:
        """Whether a live picture stands still, while the session goes on."""
        return self.is_live and self.paused

    def advance(self, elapsed_s: float) -> None:
        """Lets that much time pass on the wall; at the end it starts again, or stops where it does not loop."""
        if self.paused:
            return
        self.time_s += elapsed_s * (1.0 if self.is_live else self.speed)
        if self.duration_s is not None and self.time_s > self.duration_s:
            self.time_s = self.time_s % self.duration_s if self.loop and self.duration_s > 0 else self.duration_s
            self.paused = not self.loop

    def seek(self, time_s: float) -> None:
        """Goes to a moment, kept inside the recording; nothing while live."""
        if self.duration_s is not None:
            self.time_s = min(max(time_s, 0.0), self.duration_s)

    def step(self, frames: int) -> None:
        """Stops, and goes that many frames on or back."""
        self.paused = True
        self.seek((round(self.time_s / self.frame_s) + frames) * self.frame_s)

    def to_mark(self) -> None:
        """Goes to the next mark, after the last to the first; nothing where there is none."""
        if self.marks:
            self.seek(min((m for m in self.marks if m > self.time_s + 1e-6), default=min(self.marks)))

    def faster(self, steps: int) -> None:
        """Goes up or down the list of speeds; nothing while live."""
        if not self.is_live:
            nearest = min(range(len(SPEEDS)), key=lambda i: abs(SPEEDS[i] - self.speed))
            self.speed = SPEEDS[min(max(nearest + steps, 0), len(SPEEDS) - 1)]

    def words(self) -> str:
        """`00:03.2 / 00:24.0  x0.5  paused`, or `live`."""
        state = "  paused" if self.paused else ""
        if self.duration_s is None:
            return "live" + state
        speed = "" if self.speed == 1.0 else f"  x{self.speed:g}"
        return f"{_clock(self.time_s)} / {_clock(self.duration_s)}{speed}{state}"


@dataclass
class Controls:
    """All that keys and mouse change. Kept by the window, read once a picture."""

    playback: Playback = field(default_factory=Playback)
    layers: Layers = field(default_factory=Layers)
    actions: Mapping[str, Action] = field(default_factory=dict)
    show_help: bool = False
    closing: bool = False
    yaw: float = 0.0
    pitch: float = 0.0
    zoom: float = 1.0
    pan: tuple[float, float] = (0.0, 0.0)

    def press(self, key: str) -> bool:
        """Does what a key is for (names as in `KEYS`); False where it is for nothing."""
        if key in self.actions and self.actions[key].now():
            self.actions[key].do()
        elif key in _PRESSES:
            _PRESSES[key](self)
        else:
            return False
        return True

    def turn(self, right: float, down: float) -> None:
        """The mouse dragged by that share of the picture's height: the camera circles the performer."""
        self.yaw -= 3.0 * right
        self.pitch += 3.0 * down

    def move(self, right: float, down: float) -> None:
        """Dragged with the other button: the picture follows the mouse."""
        self.pan = (self.pan[0] - right, self.pan[1] + down)

    def camera(self, given: Camera) -> Camera:
        """The source's camera as the person has turned it."""
        turned = given.orbited(self.yaw, self.pitch, self.zoom)
        self.pitch = turned.pitch - given.pitch
        metres = 2 * turned.distance * math.tan(turned.fov / 2)
        shift = (self.pan[0] * turned.axes[0] + self.pan[1] * turned.axes[1]) * metres
        target = [float(a + b) for a, b in zip(turned.target, shift, strict=True)]
        return replace(turned, target=(target[0], target[1], target[2]))

    def reset_view(self) -> None:
        """The camera as the source has it."""
        self.yaw, self.pitch, self.zoom, self.pan = 0.0, 0.0, 1.0, (0.0, 0.0)

    def help(self) -> tuple[str, ...]:
        """One line a key, a tab between key and meaning; lines without a tab are headings."""
        own = tuple((key, action.text) for key, action in self.actions.items() if action.text)
        groups = (
            ("Recording", () if self.playback.is_live else _RECORDING_KEYS),
            ("This session" if self.playback.is_live else "This replay", own),
            ("Shown", _LAYER_KEYS),
            ("Camera and window", _WINDOW_KEYS),
        )
        lines = []
        for heading, keys in groups:
            lines += [heading, *(f"{key}\t{text}" for key, text in keys)] if keys else []
        return tuple(lines)

    def _toggle(self, layer: str) -> None:
        self.layers = replace(self.layers, **{layer: not getattr(self.layers, layer)})

    def _paint(self, paints: int, bones: int) -> None:
        paint = PAINTS[(PAINTS.index(self.layers.paint) + paints) % len(PAINTS)]
        self.layers = replace(self.layers, paint=paint, bone=self.layers.bone + bones)

    def _pause(self) -> None:
        self.playback.paused = not self.playback.paused

    def _toggle_help(self) -> None:
        self.show_help = not self.show_help

    def _turn_by(self, yaw: float, pitch: float) -> None:
        self.yaw += yaw
        self.pitch += pitch

    def _zoom_by(self, factor: float) -> None:
        self.zoom = min(max(self.zoom * factor, 0.05), 50.0)

    def _close(self) -> None:
        self.closing = True


_RECORDING_KEYS = (
    ("Left", "a second back"),
    ("Right", "a second on"),
    (",", "a frame back"),
    (".", "a frame on"),
    ("Home", "to the start"),
    ("End", "to the end"),
    ("G", "to the next mark"),
    ("[", "slower"),
    ("]", "faster"),
)
_LAYER_KEYS = (
    ("1", "skin"),
    ("2", "skeleton"),
    ("3", "trackers"),
    ("4", "lattice"),
    ("5", "curves"),
    ("6", "ghosts of the nearest poses"),
    ("7", "uncertainty"),
    ("8", "figures"),
    ("9", "floor"),
    ("B", "paint the skin: bones, parts, weights ..."),
    ("N", "the next bone, painted by weights"),
)
_WINDOW_KEYS = (
    ("Space", "pause"),
    ("A D W S", "circle (or drag the mouse)"),
    ("+ -", "nearer, farther (or the wheel)"),
    ("0", "the camera as it was"),
    ("H", "this help"),
    ("Q", "close"),
)

_PRESSES: Mapping[str, Callable[[Controls], None]] = {
    "Space": Controls._pause,
    "Left": lambda c: c.playback.seek(c.playback.time_s - _SEEK_S),
    "Right": lambda c: c.playback.seek(c.playback.time_s + _SEEK_S),
    ",": lambda c: c.playback.step(-1),
    ".": lambda c: c.playback.step(1),
    "Home": lambda c: c.playback.seek(0.0),
    "End": lambda c: c.playback.seek(math.inf),
    "G": lambda c: c.playback.to_mark(),
    "[": lambda c: c.playback.faster(-1),
    "]": lambda c: c.playback.faster(1),
    "1": lambda c: c._toggle("skin"),
    "2": lambda c: c._toggle("skeleton"),
    "3": lambda c: c._toggle("trackers"),
    "4": lambda c: c._toggle("lattice"),
    "5": lambda c: c._toggle("curves"),
    "6": lambda c: c._toggle("ghosts"),
    "7": lambda c: c._toggle("uncertainty"),
    "8": lambda c: c._toggle("statistics"),
    "9": lambda c: c._toggle("floor"),
    "B": lambda c: c._paint(1, 0),
    "N": lambda c: c._paint(0, 1),
    "A": lambda c: c._turn_by(-_TURN, 0.0),
    "D": lambda c: c._turn_by(_TURN, 0.0),
    "W": lambda c: c._turn_by(0.0, _TURN),
    "S": lambda c: c._turn_by(0.0, -_TURN),
    "+": lambda c: c._zoom_by(1.1),
    "-": lambda c: c._zoom_by(1 / 1.1),
    "0": Controls.reset_view,
    "H": Controls._toggle_help,
    "Q": Controls._close,
    "Escape": Controls._close,
}


def still(before: Scene, now: Scene) -> Scene:
    """The picture of before with the words of now."""
    return replace(now, surfaces=before.surfaces, lines=before.lines, spheres=before.spheres, camera=before.camera)


def _clock(time_s: float) -> str:
    tenths = round(time_s * 10)
    return f"{tenths // 600:02d}:{tenths // 10 % 60:02d}.{tenths % 10}"
