"""The window: draws the scenes of a `FrameSource` with Open3D. The only file that imports Open3D's visualisation.

It uses the classic visualizer, which needs no more than OpenGL 3.3 and runs on software drawing too. That one knows one
light, no transparency and no words, so lights are computed here (`capture.raster`: the window and the pictures look
alike), what shines through a surface is drawn nearer to the eye along the same ray, and words are a textured card.
"""

import os
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.raster import PlacedCard, lit_colours, placed_cards
from capture.scene import Camera, Floor, Lines, Scene, Spheres, Surface, Timeline
from capture.viewing import HELD_KEYS, Action, Controls, FrameSource, Layers, Playback, still
from capture.window_process import show_apart
from devices.errors import SixpointError

_BACKGROUND = (0.885, 0.90, 0.92)
_GRID = (0.72, 0.75, 0.79)
_SHADOW = (0.74, 0.76, 0.79)
_TO_LIGHT = (-0.45, 1.0, 0.5)
_NEAR_M, _FAR_M = 0.02, 200.0
_PULL = 0.1
"""What shines through a surface is drawn at this share of its distance, so in front of everything it belongs to."""
_CARD_M = 0.04
"""How far before the eye the cards with words stand."""
_WORDS_HZ = 8.0

_NO_DISPLAY = "no display to open a window on: set DISPLAY, or use --out to get pictures instead"
_DEBIAN_PACKAGES = {
    "libusb-1.0": "libusb-1.0-0",
    "libGL.so": "libgl1",
    "libEGL": "libegl1",
    "libgomp": "libgomp1",
    "libX11": "libx11-6",
    "libstdc++": "libstdc++6",
}


def has_display() -> bool:
    """Whether there is a screen to open a window on."""
    if sys.platform.startswith("linux"):
        return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    return True


def show(
    source: FrameSource,
    *,
    title: str = "sixpoint",
    width: int = 1280,
    height: int = 720,
    layers: Layers | None = None,
    actions: Mapping[str, Action] | None = None,
    until: Callable[[], bool] | None = None,
    pictures: int | None = None,
) -> None:
    """Opens a window over a source and returns when it is closed.

    A live source is drawn by a process of its own (`capture.window_process`), so that the solver keeps its pace.
    layers: what is shown at first; actions: keys of the session's own (upper case letters), shown in the help;
    until: closes by itself once this is true; pictures: or after so many, for tests. Raises SixpointError where no
    window can be opened.
    """
    draw = show_here
    if source.duration_s is None:
        if not has_display():
            raise SixpointError(_NO_DISPLAY)
        draw = show_apart
    draw(
        source,
        title=title,
        width=width,
        height=height,
        layers=layers,
        actions=actions or {},
        until=until,
        pictures=pictures,
    )


def show_here(
    source: FrameSource,
    *,
    title: str,
    width: int,
    height: int,
    layers: Layers | None,
    actions: Mapping[str, Action],
    until: Callable[[], bool] | None,
    pictures: int | None,
) -> None:
    """`show` in this very process."""
    marks: tuple[float, ...] = getattr(source, "marks", ())
    controls = Controls(
        Playback(source.duration_s, source.frame_s, marks), layers=layers or Layers(), actions=dict(actions)
    )
    with _Window(title, width, height, controls) as window:
        before, drawn = time.perf_counter(), 0
        scene: Scene | None = None
        while window.is_open and drawn != pictures and not (until and until()):
            now = time.perf_counter()
            controls.playback.advance(now - before)
            before = now
            seen = source.scene(controls.playback.time_s, controls.layers)
            scene = seen if scene is None or not controls.playback.frozen else still(scene, seen)
            window.draw(controlled(scene, controls))
            drawn += 1
            time.sleep(max(1 / 60 - (time.perf_counter() - now), 0.0))


def snapshot(scene: Scene, width: int = 960, height: int = 540) -> NDArray[np.uint8]:
    """What the window shows of one scene, (height, width, 3) sRGB bytes. Needs a display; see `capture.raster`."""
    with _Window("sixpoint", width, height, Controls()) as window:
        window.draw(scene)
        return window.pixels()


def controlled(scene: Scene, controls: Controls) -> Scene:
    """The scene from where the person looks, with the clock and, where they are asked for, the keys."""
    playback = controls.playback
    status = (*scene.status, playback.words() + "   H: keys")
    timeline = scene.timeline
    if playback.duration_s:
        timeline = Timeline(playback.time_s / playback.duration_s, timeline.marks if timeline else ())
    return replace(
        scene,
        camera=controls.camera(scene.camera),
        status=status,
        timeline=timeline,
        floor=scene.floor if controls.layers.floor else None,
        keys=controls.help() if controls.show_help else (),
        figures=() if controls.show_help else scene.figures,
        panel=None if controls.show_help else scene.panel,
    )


def _open3d() -> ModuleType:
    """Open3D, or one line on what is missing."""
    if sys.platform.startswith("linux"):
        os.environ.setdefault("XDG_RUNTIME_DIR", tempfile.gettempdir())  # or Open3D's window library complains
    try:
        import open3d
    except (ImportError, OSError) as error:
        raise SixpointError(f"the window needs Open3D, and it does not load: {_remedy(str(error))}") from error
    return open3d


def _remedy(message: str) -> str:
    for library, package in _DEBIAN_PACKAGES.items():
        if library in message:
            return f"{library} is missing; on Debian: apt-get install {package}"
    return message.splitlines()[0] if message else "unknown reason"


class _Window:
    """One open window: geometry slots that are updated in place, the camera, keys and mouse."""

    def __init__(self, title: str, width: int, height: int, controls: Controls) -> None:
        if not has_display():
            raise SixpointError(_NO_DISPLAY)
        self._o3d = _open3d()
        self._size = (width, height)
        self._controls = controls
        self._parts: dict[tuple[str, int], _Part] = {}
        self._words: tuple[object, float] = (None, -1.0)
        self._cards: list[PlacedCard] = []
        self._mouse: tuple[float, float, int | None, bool] = (0.0, 0.0, None, False)
        self._vis = self._o3d.visualization.VisualizerWithKeyCallback()
        if not self._vis.create_window(title, width, height):
            raise SixpointError("no window could be opened: the display gives no OpenGL 3.3; use --out to get pictures")
        self._listen()
        option = self._vis.get_render_option()
        option.background_color = np.array(_BACKGROUND)
        option.light_on = False
        option.mesh_show_back_face = True
        option.mesh_color_option = self._o3d.visualization.MeshColorOption.Color
        option.point_size = 2.0
        view = self._vis.get_view_control()
        view.set_constant_z_near(_NEAR_M)
        view.set_constant_z_far(_FAR_M)
        self.is_open = True

    def __enter__(self) -> "_Window":
        return self

    def __exit__(self, *_: object) -> None:
        self.is_open = False
        self._vis.destroy_window()

    def draw(self, scene: Scene) -> None:
        """Shows a scene and takes in keys and mouse since the last."""
        parts = _parts(scene, self._size[1])
        parts.update(self._word_parts(scene))
        for slot in self._parts.keys() - parts.keys():
            self._vis.remove_geometry(self._parts.pop(slot).shown, reset_bounding_box=False)
        for slot, part in parts.items():
            self._put(slot, part)
        self._look_from(scene.camera)
        self.is_open = bool(self._vis.poll_events()) and not self._controls.closing
        self._vis.update_renderer()

    def pixels(self) -> NDArray[np.uint8]:
        """(H, W, 3) what the window shows now."""
        values = np.asarray(self._vis.capture_screen_float_buffer(True))
        return np.round(values * 255).astype(np.uint8)

    def _put(self, slot: tuple[str, int], part: "_Part") -> None:
        old = self._parts.get(slot)
        fits = old is not None and old.same_build(part)
        part.shown = old.shown if old is not None and fits else part.build(self._o3d)
        part.fill(self._o3d)
        if fits:
            self._vis.update_geometry(part.shown)
        else:
            if old is not None:
                self._vis.remove_geometry(old.shown, reset_bounding_box=False)
            self._vis.add_geometry(part.shown, reset_bounding_box=not self._parts)
        self._parts[slot] = part

    def _look_from(self, camera: Camera) -> None:
        view = self._vis.get_view_control()
        parameters = view.convert_to_pinhole_camera_parameters()
        width, height = parameters.intrinsic.width, parameters.intrinsic.height
        self._size = (width, height)  # a person may have changed the window's
        focal = 0.5 * height / np.tan(0.5 * camera.fov)
        parameters.intrinsic = self._o3d.camera.PinholeCameraIntrinsic(
            width, height, focal, focal, width / 2 - 0.5, height / 2 - 0.5
        )
        # Open3D's camera looks along +Z with Y down.
        rotation = np.diag([1.0, -1.0, -1.0]) @ camera.axes
        extrinsic = np.eye(4)
        extrinsic[:3, :3], extrinsic[:3, 3] = rotation, -rotation @ camera.eye
        parameters.extrinsic = extrinsic
        view.convert_from_pinhole_camera_parameters(parameters, allow_arbitrary=True)

    def _word_parts(self, scene: Scene) -> dict[tuple[str, int], "_Part"]:
        words = (scene.title, scene.badges, scene.status, scene.figures, scene.legend, scene.panel, scene.banner)
        wanted = (self._size, *words, scene.timeline, scene.keys)
        known, when = self._words
        now = time.perf_counter()
        if wanted != known and now - when > 1 / _WORDS_HZ:
            self._cards = placed_cards(scene, *self._size, _BACKGROUND)
            self._words = (wanted, now)
        return {
            ("card", index): _card_part(placed, scene.camera, self._size, index)
            for index, placed in enumerate(self._cards)
        }

    def _listen(self) -> None:
        for code, name in _key_codes().items():
            self._vis.register_key_action_callback(code, self._key_listener(name))
        self._vis.register_mouse_button_callback(self._on_button)
        self._vis.register_mouse_move_callback(self._on_move)
        self._vis.register_mouse_scroll_callback(self._on_scroll)

    def _key_listener(self, name: str) -> Any:
        def pressed(_vis: object, action: int, _modifiers: int) -> bool:
            if action == 1 or (action == 2 and name in HELD_KEYS):  # pressed, or repeated while held
                self._controls.press(name)
            return False

        return pressed

    def _on_button(self, _vis: object, button: int, action: int, modifiers: int) -> bool:
        x, y, _, _ = self._mouse
        self._mouse = (x, y, button if action else None, bool(modifiers & 1))
        return False

    def _on_move(self, _vis: object, x: float, y: float) -> bool:
        before_x, before_y, button, shift = self._mouse
        right, down = (x - before_x) / self._size[1], (y - before_y) / self._size[1]
        self._mouse = (x, y, button, shift)
        if button == 0 and not shift:
            self._controls.turn(right, down)
        elif button is not None:
            self._controls.move(right, down)
        return False

    def _on_scroll(self, _vis: object, _x: float, y: float) -> bool:
        self._controls.press("+" if y > 0 else "-")
        return False


@dataclass
class _Part:
    """One geometry of Open3D's: what it is made of now, and the object that the window holds."""

    points: NDArray[np.float64]
    colours: NDArray[np.float64] | None
    faces: NDArray[np.int32] | None = None
    segments: NDArray[np.int32] | None = None
    texture: NDArray[np.uint8] | None = None
    shown: Any = None

    def same_build(self, other: "_Part") -> bool:
        """Whether the other differs only in where its points are and what colours they have."""
        return (
            self.points.shape == other.points.shape
            and _same(self.faces, other.faces)
            and _same(self.segments, other.segments)
            and self.texture is other.texture
        )

    def build(self, o3d: ModuleType) -> Any:
        if self.segments is not None:
            geometry = o3d.geometry.LineSet()
            geometry.lines = o3d.utility.Vector2iVector(np.array(self.segments, np.int32))
            return geometry
        if self.faces is None:
            return o3d.geometry.PointCloud()
        geometry = o3d.geometry.TriangleMesh()
        geometry.triangles = o3d.utility.Vector3iVector(np.array(self.faces, np.int32))
        if self.texture is not None:
            geometry.triangle_uvs = o3d.utility.Vector2dVector(_CARD_UVS.copy())
            geometry.triangle_material_ids = o3d.utility.IntVector(np.zeros(2, np.int32))
            geometry.textures = [o3d.geometry.Image(np.ascontiguousarray(self.texture))]
        return geometry

    def fill(self, o3d: ModuleType) -> None:
        points = o3d.utility.Vector3dVector(np.array(self.points))
        colours = None if self.colours is None else o3d.utility.Vector3dVector(np.array(self.colours))
        if self.faces is None:
            self.shown.points, self.shown.colors = points, colours
            return
        self.shown.vertices = points
        if colours is not None:
            self.shown.vertex_colors = colours


def _same(a: NDArray[np.int32] | None, b: NDArray[np.int32] | None) -> bool:
    if a is None or b is None:
        return a is b
    return a is b or np.array_equal(a, b)


def _parts(scene: Scene, height: int) -> dict[tuple[str, int], _Part]:
    """Everything but words, by what it is and its number among its kind. height: of the window, pixels."""
    parts: dict[tuple[str, int], _Part] = {}
    camera = scene.camera
    for index, surface in enumerate(scene.surfaces):
        if not len(surface.vertices):
            continue
        if surface.opacity < 1.0:
            colours = _mixed(np.broadcast_to(surface.colours, surface.vertices.shape), surface.opacity)
            parts["ghost", index] = _Part(surface.vertices, colours)
            continue
        faces = np.asarray(surface.triangles, np.int32)
        parts["surface", index] = _Part(surface.vertices, lit_colours(surface, camera), faces)
        if scene.floor is not None:
            parts["shadow", index] = _shadow_part(surface, faces, scene.floor)
    for index, lines in enumerate(scene.lines):
        if len(lines.segments):
            parts["lines", index] = _lines_part(lines, camera, height)
    for index, spheres in enumerate(scene.spheres):
        if np.isfinite(spheres.centres).all(axis=1).any():
            parts["spheres", index] = _spheres_part(spheres, camera)
    if scene.floor is not None:
        parts["floor", 0] = _floor_part(scene.floor, camera)
    return parts


def _mixed(colours: NDArray[np.float64], opacity: float) -> NDArray[np.float64]:
    """What a colour looks like at that opacity over the background."""
    return opacity * np.asarray(colours) + (1 - opacity) * np.array(_BACKGROUND)


def _pulled(points: NDArray[np.float64], camera: Camera, through: float) -> NDArray[np.float64]:
    return camera.eye + _PULL * (points - camera.eye) if through > 0 else points


def _shadow_part(surface: Surface, faces: NDArray[np.int32], floor: Floor) -> _Part:
    """The surface laid flat along the light: one dark colour just above the floor."""
    above = np.maximum(surface.vertices[:, 1] - floor.height, 0.0)
    flat = surface.vertices - above[:, None] * np.array(_TO_LIGHT)
    flat[:, 1] = floor.height + 0.001
    return _Part(flat, np.broadcast_to(_SHADOW, flat.shape), faces)


def _lines_part(lines: Lines, camera: Camera, height: int) -> _Part:
    """Hair lines as they are; wider ones as ribbons that face the eye."""
    points = np.asarray(lines.points, np.float64)
    colours = np.broadcast_to(np.asarray(lines.colours, np.float64), (len(lines.segments), 3))
    colours = _mixed(colours, lines.opacity)
    if lines.width < 2.0:
        segments = np.asarray(lines.segments, np.int32)
        return _Part(_pulled(points, camera, lines.through), colours, segments=segments)
    starts, ends = points[lines.segments[:, 0]], points[lines.segments[:, 1]]
    sideways = np.cross(ends - starts, camera.eye - starts)
    sideways /= np.linalg.norm(sideways, axis=1, keepdims=True) + 1e-12
    depth = np.linalg.norm(camera.eye - starts, axis=1, keepdims=True)
    sideways *= lines.width / 540 * np.tan(0.5 * camera.fov) * depth
    corners = np.stack([starts - sideways, starts + sideways, ends + sideways, ends - sideways], axis=1)
    faces = (4 * np.arange(len(starts))[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    return _Part(
        _pulled(corners.reshape(-1, 3), camera, lines.through), colours.repeat(4, axis=0), faces.astype(np.int32)
    )


def _spheres_part(spheres: Spheres, camera: Camera) -> _Part:
    shown = np.flatnonzero(np.isfinite(spheres.centres).all(axis=1))
    count = len(spheres.centres)
    centres = np.asarray(spheres.centres, np.float64)[shown]
    radii = np.broadcast_to(np.asarray(spheres.radii, np.float64), count)[shown]
    colours = np.broadcast_to(np.asarray(spheres.colours, np.float64), (count, 3))[shown]
    vertices = (centres[:, None] + radii[:, None, None] * _BALL).reshape(-1, 3)
    faces = (len(_BALL) * np.arange(len(centres))[:, None, None] + _BALL_FACES).reshape(-1, 3).astype(np.int32)
    normals = np.tile(_BALL, (len(centres), 1))
    surface = Surface(vertices, faces, normals, colours.repeat(len(_BALL), axis=0))
    lit = _mixed(lit_colours(surface, camera), spheres.opacity)
    return _Part(_pulled(vertices, camera, spheres.through), lit, faces)


def _floor_part(floor: Floor, camera: Camera, reach_m: float = 9.0) -> _Part:
    """Grid lines around the camera's target that fade into the background."""
    count = int(reach_m / floor.spacing)
    steps = np.arange(-count, count + 1) * floor.spacing
    middle_x = round(camera.target[0] / (2 * floor.spacing)) * 2 * floor.spacing
    middle_z = round(camera.target[2] / (2 * floor.spacing)) * 2 * floor.spacing
    x, z = np.meshgrid(steps + middle_x, steps + middle_z, indexing="ij")
    points = np.column_stack([x.ravel(), np.full(x.size, floor.height), z.ravel()]).astype(np.float64)
    number = np.arange(x.size, dtype=np.int32).reshape(x.shape)
    along_x = np.column_stack([number[:-1].ravel(), number[1:].ravel()])
    along_z = np.column_stack([number[:, :-1].ravel(), number[:, 1:].ravel()])
    segments = np.concatenate([along_x, along_z])
    away = np.hypot(*(points[segments].mean(axis=1)[:, (0, 2)] - (middle_x, middle_z)).T)
    shown = np.clip(1.2 - away / reach_m, 0.0, 1.0)[:, None]
    return _Part(points, shown * np.array(_GRID) + (1 - shown) * np.array(_BACKGROUND), segments=segments)


def _card_part(placed: PlacedCard, camera: Camera, size: tuple[int, int], number: int) -> _Part:
    """A picture of words, held upright before the eye, a later one before an earlier one."""
    (width, height), (rows, columns) = size, placed.card.shape[:2]
    left, top = placed.left - width / 2, height / 2 - placed.top
    flat = np.array([[left, top - rows], [left + columns, top - rows], [left + columns, top], [left, top]])
    before_m = _CARD_M * (1 - 0.005 * number)
    metres = 2 * before_m * np.tan(0.5 * camera.fov) / height
    corners = camera.eye + flat * metres @ camera.axes[:2] - before_m * camera.axes[2]
    return _Part(corners, None, _CARD_FACES, texture=placed.card)


def _ball(rings: int = 8, around: int = 14) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """A unit sphere: (V, 3) and (F, 3)."""
    polar, turn = np.meshgrid(np.linspace(0, np.pi, rings + 1), np.arange(around) * 2 * np.pi / around, indexing="ij")
    points = np.stack([np.sin(polar) * np.sin(turn), np.cos(polar), np.sin(polar) * np.cos(turn)], axis=-1)
    number = np.arange(points[..., 0].size).reshape(polar.shape)
    a, b = number[:-1], number[1:]
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return points.reshape(-1, 3), faces.astype(np.int32)


def _key_codes() -> dict[int, str]:
    """Key names by GLFW's codes; every letter and digit, so that none does what Open3D alone would do."""
    named = {
        32: "Space",
        256: "Escape",
        262: "Right",
        263: "Left",
        264: "Down",
        265: "Up",
        258: "Tab",
        257: "Enter",
        259: "Backspace",
        268: "Home",
        269: "End",
        334: "+",
        333: "-",
        61: "+",
    }
    return named | {ord(c): c for c in "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789,.-[]"}


_BALL, _BALL_FACES = _ball()
_CARD_FACES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
_CARD_UVS = np.array([[0.0, 1], [1, 1], [1, 0], [0, 1], [1, 0], [0, 0]])
