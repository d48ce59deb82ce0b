"""From a `Scene` to pixels on the processor alone: no GPU, no OpenGL, no display, and the same bytes every time.

A z-buffer over `samples` x `samples` points a pixel, three studio lights that turn with the camera, one shadow map,
screen-space ambient occlusion, and strokes and balls over it. All light is added in linear colour.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from capture.colour import linear, srgb_bytes
from capture.raster.floor import FloorLight, floor_light, paint_studio
from capture.raster.lettering import letter
from capture.raster.marks import draw_lines, draw_spheres
from capture.raster.shading import light_pixels, occlude, receive_key_light, resolve_samples, smooth_turns
from capture.raster.triangles import TILT, fill_triangles
from capture.scene import Camera, Floor, Scene, Spheres, Surface
from deformation.mesh import vertex_normals

_NEAREST_M = 0.05
_SHADOW_MAP = 1024

_LIGHTS = (
    ((-0.62, 0.80, 0.50), (1.12, 1.02, 0.90)),
    ((0.85, 0.15, 0.55), (0.12, 0.16, 0.23)),
    ((0.70, 0.50, -0.80), (0.75, 0.80, 0.90)),
)
"""Key, fill and rim light: where each stands in the camera's level axes (right, up, backward); its linear colour."""

_BACKDROP_ABOVE, _BACKDROP, _FLOOR, _GRID = (
    (0.76, 0.81, 0.87),
    (0.93, 0.94, 0.95),
    (0.87, 0.88, 0.90),
    (0.70, 0.73, 0.77),
)


@dataclass(frozen=True, eq=False)
class _View:
    """A camera over a picture of (rows, columns) pixels. focal: pixels."""

    camera: Camera
    rows: int
    columns: int

    @property
    def focal(self) -> float:
        return 0.5 * self.rows / math.tan(0.5 * self.camera.fov)

    def project(self, points: NDArray[np.float64], samples: int = 1) -> NDArray[np.float64]:
        """(N, 3) column, row (in `1 / samples` of a pixel) and 1 / depth; 0 for what is behind or too near."""
        seen = (points - self.camera.eye) @ self.camera.axes.T
        depth = -seen[:, 2]
        with np.errstate(invalid="ignore"):
            near = np.where(depth > _NEAREST_M, 1.0 / np.where(depth > _NEAREST_M, depth, 1.0), 0.0)
        column = samples * (0.5 * self.columns + self.focal * seen[:, 0] * near)
        row = samples * (0.5 * self.rows - self.focal * seen[:, 1] * near)
        return np.nan_to_num(np.column_stack([column, row, near]), posinf=0.0, neginf=0.0)


@dataclass(frozen=True, eq=False)
class _ShadowMap:
    """The key light's view. axes: (3, 3) world to light; nearness: (H, W) metres towards the light above `origin`."""

    axes: NDArray[np.float64]
    origin: NDArray[np.float64]
    texels_a_metre: float
    nearness: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class _Solid:
    """Surfaces as the kernels take them: arrays of one type, colours linear."""

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int32]
    normals: NDArray[np.float64]
    colours: NDArray[np.float64]


def render(scene: Scene, width: int = 960, height: int = 540, samples: int = 2) -> NDArray[np.uint8]:
    """Draws the scene: (height, width, 3) sRGB bytes. samples: per pixel side, for smooth edges."""
    view = _View(scene.camera, height, width)
    lights = _placed_lights(scene.camera)
    solid = _joined([s for s in scene.surfaces if s.opacity >= 1.0])
    image = np.empty((height, width, 3), np.float32)
    casting = solid if len(solid.vertices) else _joined([_cast(marks) for marks in scene.spheres])
    _paint_studio(image, view, scene.floor, casting, lights)
    shadow = _shadow_map(solid, lights[0, :3])
    nearness = _draw_surface(image, view, solid, lights, shadow, 1.0, samples)
    for ghost in (s for s in scene.surfaces if 0.0 < s.opacity < 1.0):
        _draw_surface(image, view, _joined([ghost]), lights, _NO_SHADOW, ghost.opacity, samples, behind=nearness)
    _draw_marks(image, view, scene, lights, nearness)
    return letter(srgb_bytes(image), scene, _BACKDROP)


def lit_colours(surface: Surface, camera: Camera) -> NDArray[np.float64]:
    """(V, 3) sRGB, 0 to 1: the same studio lights on each vertex, without shadows, for whoever draws it elsewhere."""
    solid = _prepared(surface)
    pixels = np.ones((1, len(solid.vertices), 10), np.float32)
    pixels[0, :, :9] = np.concatenate([solid.vertices, solid.normals, solid.colours], axis=1)
    open_share = np.ones(pixels.shape[:2], np.float32)
    image = np.zeros((*pixels.shape[:2], 3), np.float32)
    light_pixels(pixels, open_share, open_share, camera.eye, _placed_lights(camera), 1.0, image)
    return srgb_bytes(image)[0] / 255.0


_PALETTE = linear([_BACKDROP_ABOVE, _BACKDROP, _FLOOR, _GRID])
_OCTAHEDRON = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
_OCTAHEDRON_FACES = np.array([(x, y, z) for x in (0, 1) for y in (2, 3) for z in (4, 5)])
_NO_SHADOW = _ShadowMap(np.eye(3), np.zeros(3), 1.0, np.zeros((1, 1), np.float32))


def _placed_lights(camera: Camera) -> NDArray[np.float64]:
    """(3, 6) unit direction to each light, world, and its colour; they turn with the camera but stay level."""
    right = camera.axes[0]
    level = np.array([right, [0.0, 1.0, 0.0], np.cross(right, [0.0, 1.0, 0.0])])
    directions = np.array([place for place, _ in _LIGHTS]) @ level
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.column_stack([directions, [colour for _, colour in _LIGHTS]])


def _joined(surfaces: list[Surface]) -> _Solid:
    parts = [_prepared(surface) for surface in surfaces]
    starts = np.cumsum([0] + [len(part.vertices) for part in parts])
    return _Solid(
        np.concatenate([np.empty((0, 3)), *(part.vertices for part in parts)]),
        np.concatenate(
            [np.empty((0, 3), np.int32), *(p.triangles + np.int32(s) for p, s in zip(parts, starts, strict=False))]
        ),
        np.concatenate([np.empty((0, 3)), *(part.normals for part in parts)]),
        np.concatenate([np.empty((0, 3)), *(part.colours for part in parts)]),
    )


def _prepared(surface: Surface) -> _Solid:
    vertices = np.ascontiguousarray(surface.vertices, np.float64)
    triangles = np.ascontiguousarray(surface.triangles, np.int32)
    normals = vertex_normals(vertices, triangles) if surface.normals is None else surface.normals
    colours = _rows_of_colour(surface.colours, len(vertices))
    return _Solid(vertices, triangles, np.ascontiguousarray(normals, np.float64), colours)


def _cast(spheres: Spheres) -> Surface:
    """What balls throw on the floor: an octahedron each. Where there is no surface, they tell where the feet stand."""
    centres = spheres.centres[np.isfinite(spheres.centres).all(axis=1)]
    radii = np.broadcast_to(np.asarray(spheres.radii, np.float64), len(spheres.centres))
    radii = radii[np.isfinite(spheres.centres).all(axis=1)]
    vertices = centres[:, None] + radii[:, None, None] * _OCTAHEDRON
    triangles = 6 * np.arange(len(centres))[:, None, None] + _OCTAHEDRON_FACES
    return Surface(vertices.reshape(-1, 3), triangles.reshape(-1, 3), normals=vertices.reshape(-1, 3))


def _paint_studio(
    image: NDArray[np.float32], view: _View, floor: Floor | None, solid: _Solid, lights: NDArray[np.float64]
) -> None:
    ground = floor or Floor()
    unlit = FloorLight(np.ones((1, 1), np.float32), np.zeros(2), 1.0)
    light = floor_light(solid.vertices, solid.triangles, ground.height, lights[0, :3]) if floor else unlit
    fade_m = 2.4 * view.camera.distance + 2.0
    paint_studio(
        view.camera.eye,
        view.camera.axes,
        view.focal,
        ground.height,
        ground.spacing,
        fade_m,
        light.share,
        light.origin,
        light.texels_a_metre,
        _PALETTE,
        floor is not None,
        image,
    )


def _shadow_map(solid: _Solid, to_light: NDArray[np.float64]) -> _ShadowMap:
    if not len(solid.vertices):
        return _NO_SHADOW
    right = np.cross([0.0, 1.0, 0.0], to_light)
    right /= np.linalg.norm(right)
    axes = np.array([right, np.cross(to_light, right), to_light])
    seen = solid.vertices @ axes.T
    origin = seen.min(0) - 0.02
    scale = (_SHADOW_MAP - 2) / float((seen.max(0) - origin + 0.02)[:2].max())
    corners = (seen - origin) * (scale, scale, 1.0)
    nearness = np.zeros((_SHADOW_MAP, _SHADOW_MAP), np.float32)
    fill_triangles(np.ascontiguousarray(corners), solid.triangles, 0.0, nearness, np.full(nearness.shape, -1, np.int32))
    return _ShadowMap(axes, origin, scale, nearness)


def _draw_surface(
    image: NDArray[np.float32],
    view: _View,
    solid: _Solid,
    lights: NDArray[np.float64],
    shadow: _ShadowMap,
    opacity: float,
    samples: int,
    behind: NDArray[np.float32] | None = None,
) -> NDArray[np.float32]:
    """Lays a surface over the image; returns its nearness (H, W), 1 / metres. behind: (H, W) what may hide it."""
    shape = (view.rows * samples, view.columns * samples)
    nearness, owner = np.zeros(shape, np.float32), np.full(shape, -1, np.int32)
    if behind is not None:
        nearness[:] = behind.repeat(samples, axis=0).repeat(samples, axis=1)
    corners = view.project(solid.vertices, samples)
    tilt = TILT if samples % 2 == 0 else 0.0
    fill_triangles(corners, solid.triangles, tilt, nearness, owner)
    pixels = np.zeros((view.rows, view.columns, 10), np.float32)
    pixel_nearness = np.zeros((view.rows, view.columns), np.float32)
    resolve_samples(
        nearness,
        owner,
        corners,
        solid.triangles,
        solid.vertices,
        solid.normals,
        solid.colours,
        samples,
        tilt,
        pixels,
        pixel_nearness,
    )
    openness, lit = (np.ones((view.rows, view.columns), np.float32) for _ in range(2))
    if opacity >= 1.0:
        raw = openness.copy(), openness.copy()
        occlude(pixels, view.camera.eye, view.camera.axes, view.focal, raw[0])
        receive_key_light(pixels, shadow.nearness, shadow.axes, shadow.origin, shadow.texels_a_metre, raw[1])
        smooth_turns(raw[0], pixels, openness)
        smooth_turns(raw[1], pixels, lit)
    light_pixels(pixels, openness, lit, view.camera.eye, lights, opacity, image)
    return pixel_nearness


def _draw_marks(
    image: NDArray[np.float32], view: _View, scene: Scene, lights: NDArray[np.float64], nearness: NDArray[np.float32]
) -> None:
    for lines in scene.lines:
        points = view.project(np.asarray(lines.points, np.float64))
        segments = np.array(lines.segments, np.int32, order="C")
        colours = _rows_of_colour(lines.colours, len(segments))
        width = lines.width * view.rows / 540
        draw_lines(points, segments, colours, width, lines.opacity, lines.through, nearness, image)
    light = np.array([view.camera.axes @ lights[0, :3], 0.95 * lights[0, 3:], [0.42, 0.44, 0.48]])
    for spheres in scene.spheres:
        centres = view.project(np.asarray(spheres.centres, np.float64))
        radii = np.array(np.broadcast_to(np.asarray(spheres.radii, np.float64), len(centres)))
        colours = _rows_of_colour(spheres.colours, len(centres))
        order = np.argsort(centres[:, 2], kind="stable")
        draw_spheres(
            centres, radii, order, colours, spheres.opacity, spheres.through, view.focal, nearness, light, image
        )


def _rows_of_colour(colours: ArrayLike, rows: int) -> NDArray[np.float64]:
    """(rows, 3) linear, an array of its own."""
    return np.array(np.broadcast_to(linear(colours), (rows, 3)), order="C")
