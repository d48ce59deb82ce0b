"""One picture, described without saying who draws it: surfaces, lines, spheres, a floor, a camera and some words.

The window (`capture.viewer`) and the headless renderer (`capture.raster`) draw the same `Scene`. World axes are those
of the whole system: metres, Y up, the performer faces +Z. Colours are sRGB, 0 to 1.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from capture.standings import Standing
from devices.frame import TrackerFrame, TrackerState
from reconstruction.skeleton import Skeleton

Colour = tuple[float, float, float]

CLAY: Colour = (0.80, 0.66, 0.54)
"""The plain colour of a character that has none of its own."""
BONE: Colour = (0.98, 0.80, 0.30)
GHOST: Colour = (0.45, 0.62, 0.85)
LATTICE: Colour = (0.16, 0.52, 0.66)

STANDING_COLOURS: Mapping[Standing, Colour] = {
    Standing.MEASURED: (0.16, 0.70, 0.42),
    Standing.EXTRAPOLATED: (0.98, 0.66, 0.14),
    Standing.PRIOR: (0.56, 0.36, 0.86),
    Standing.HELD: (0.36, 0.47, 0.62),
    Standing.LOST: (0.85, 0.22, 0.20),
    Standing.ABSENT: (0.72, 0.74, 0.77),
}
"""What colour a tracker has for each of its standings."""


@dataclass(frozen=True)
class Camera:
    """A camera that circles its target.

    target: metres, world; distance: metres from it to the eye.
    yaw: radians about +Y; 0 looks at the performer's face, positive walks towards the performer's left.
    pitch: radians; positive looks down from above.
    fov: radians, vertical opening angle.
    """

    target: tuple[float, float, float] = (0.0, 0.95, 0.0)
    distance: float = 4.2
    yaw: float = 0.45
    pitch: float = 0.14
    fov: float = 0.52

    @property
    def axes(self) -> NDArray[np.float64]:
        """`R_camera_world` (3, 3): rows are the camera's right, up and backward directions in the world."""
        cos_pitch, sin_pitch = math.cos(self.pitch), math.sin(self.pitch)
        cos_yaw, sin_yaw = math.cos(self.yaw), math.sin(self.yaw)
        return np.array(
            [
                [cos_yaw, 0.0, -sin_yaw],
                [-sin_yaw * sin_pitch, cos_pitch, -cos_yaw * sin_pitch],
                [sin_yaw * cos_pitch, sin_pitch, cos_yaw * cos_pitch],
            ]
        )

    @property
    def eye(self) -> NDArray[np.float64]:
        """(3,) metres, world."""
        return np.array(self.target) + self.distance * self.axes[2]

    def orbited(self, yaw: float = 0.0, pitch: float = 0.0, zoom: float = 1.0) -> "Camera":
        """Turned by radians about its target and brought `zoom` times nearer; never over the poles."""
        limit = math.radians(89)
        pitch = min(max(self.pitch + pitch, -limit), limit)
        return replace(self, yaw=self.yaw + yaw, pitch=pitch, distance=self.distance / zoom)

    def framed(self, points: NDArray[np.float64], aspect: float = 16 / 9, margin: float = 1.12) -> "Camera":
        """Moved along its own directions until `points` (N, 3) just fit a picture `aspect` times as wide as high."""
        points = points[np.isfinite(points).all(axis=1)]
        if not len(points):
            return self
        right, up, backward = (points @ self.axes.T).T
        tan_y = math.tan(self.fov / 2) / margin
        tan_x = tan_y * aspect
        centre_x, centre_y = (right.max() + right.min()) / 2, (up.max() + up.min()) / 2
        reach = np.maximum(np.abs(right - centre_x) / tan_x, np.abs(up - centre_y) / tan_y)
        centre_z = (backward.max() + backward.min()) / 2
        distance = float((reach + backward).max() - centre_z)
        target = np.array([centre_x, centre_y, centre_z]) @ self.axes
        return replace(self, target=(float(target[0]), float(target[1]), float(target[2])), distance=max(distance, 0.1))


@dataclass(frozen=True, eq=False)
class Surface:
    """A triangle mesh.

    vertices: (V, 3) metres, world; triangles: (F, 3) counter-clockwise seen from outside.
    normals: (V, 3) unit, or None: then the renderer makes area-weighted ones.
    colours: (3,) for the whole surface or (V, 3).
    opacity: 1 is solid; less is a ghost that casts no shadow.
    """

    vertices: NDArray[np.float64]
    triangles: NDArray[np.integer]
    normals: NDArray[np.float64] | None = None
    colours: ArrayLike = CLAY
    opacity: float = 1.0


@dataclass(frozen=True, eq=False)
class Lines:
    """Straight strokes.

    points: (N, 3) metres, world; segments: (S, 2) indices of their ends.
    colours: (3,) or (S, 3); width: pixels of a picture 540 high.
    opacity: of the part in sight; through: of the part that a surface hides (0 hides it, 1 draws it over everything).
    """

    points: NDArray[np.float64]
    segments: NDArray[np.integer]
    colours: ArrayLike = LATTICE
    width: float = 1.5
    opacity: float = 1.0
    through: float = 0.0


@dataclass(frozen=True, eq=False)
class Spheres:
    """Shaded balls.

    centres: (N, 3) metres, world, rows of NaN are left out; radii: metres, () or (N,); the rest as in `Lines`.
    """

    centres: NDArray[np.float64]
    radii: ArrayLike = 0.03
    colours: ArrayLike = BONE
    opacity: float = 1.0
    through: float = 0.0


@dataclass(frozen=True)
class Floor:
    """The studio floor in the plane y = `height`; its grid has a line every `spacing` metres, every second stronger."""

    height: float = 0.0
    spacing: float = 0.5


@dataclass(frozen=True)
class Badge:
    """A coloured dot with a few words beside it."""

    colour: Colour
    text: str


@dataclass(frozen=True)
class PanelRow:
    """One setting in a panel. share: where it is in its range, 0 to 1, or None for a switch."""

    name: str
    value: str
    share: float | None = None


@dataclass(frozen=True)
class Panel:
    """Settings that can be changed now. chosen: the row that keys change; foot: what it does, line by line."""

    rows: tuple[PanelRow, ...]
    chosen: int = 0
    foot: tuple[str, ...] = ()


@dataclass(frozen=True)
class Banner:
    """What the person before the window is told to do.

    count: seconds left, say, to be read from across the room; share: how much of it is done, 0 to 1, as a bar.
    """

    text: str
    below: tuple[str, ...] = ()
    count: str = ""
    share: float | None = None


@dataclass(frozen=True)
class Timeline:
    """Where in a recording the picture is: share of its length, 0 to 1; marks: the same of noted moments."""

    share: float
    marks: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Scene:
    """All that one picture shows.

    title: top left, badges under it; status: lines at the bottom left; legend: at the bottom right; banner, panel: on
    the left. figures: a table at the top right, tabs between its columns, its first row the
    heading. keys: over everything, a tab between key and meaning, lines without one are headings.
    """

    surfaces: tuple[Surface, ...] = ()
    lines: tuple[Lines, ...] = ()
    spheres: tuple[Spheres, ...] = ()
    camera: Camera = field(default_factory=Camera)
    floor: Floor | None = field(default_factory=Floor)
    title: str = ""
    badges: tuple[Badge, ...] = ()
    status: tuple[str, ...] = ()
    figures: tuple[str, ...] = ()
    legend: tuple[Badge, ...] = ()
    panel: Panel | None = None
    banner: Banner | None = None
    timeline: Timeline | None = None
    keys: tuple[str, ...] = ()

    def points(self) -> NDArray[np.float64]:
        """(N, 3) every point it holds, for framing."""
        parts = [s.vertices for s in self.surfaces] + [x.points for x in self.lines] + [s.centres for s in self.spheres]
        return np.concatenate([np.empty((0, 3)), *parts])

    def framed(self, aspect: float = 16 / 9, margin: float = 1.12) -> "Scene":
        """The same with its camera moved to hold everything."""
        return replace(self, camera=self.camera.framed(self.points(), aspect, margin))


def tracker_spheres(
    frame: TrackerFrame,
    radius: float = 0.03,
    now: NDArray[np.integer] | None = None,
    places: NDArray[np.float64] | None = None,
) -> Spheres:
    """The trackers of one frame in the colours of their standings.

    now: (6,) of `Standing`; from the frame alone where None. places: (6, 3) metres where the pose has them: those
    without a position stand there, a little smaller. Left out are those with neither, and those that nobody wears.
    """
    if now is None:
        now = np.array([_STANDING_OF[TrackerState(int(state))] for state in frame.states])
    centres, radii = frame.positions, np.full(len(now), radius)
    if places is not None:
        guessed = ~frame.measured & (now != Standing.ABSENT)
        centres = np.where(guessed[:, None], places, centres)
        radii = np.where(guessed, 0.8 * radius, radii)
    colours = np.array([STANDING_COLOURS[Standing(int(standing))] for standing in now])
    return Spheres(centres, radii, colours, through=0.4)


_STANDING_OF = {
    TrackerState.MISSING: Standing.LOST,
    TrackerState.MEASURED: Standing.MEASURED,
    TrackerState.EXTRAPOLATED: Standing.EXTRAPOLATED,
}


def skeleton_marks(
    skeleton: Skeleton, joints: NDArray[np.float64], colour: Colour = BONE, opacity: float = 1.0
) -> tuple[Lines, Spheres]:
    """Bones as lines and joints as balls, seen through the skin. joints: (J, 3) metres, world."""
    children = np.flatnonzero(skeleton.parents >= 0)
    bones = np.column_stack([skeleton.parents[children], children]).astype(np.int32)
    turning = joints[~skeleton.is_end]
    return (
        Lines(joints, bones, colour, width=3.0, opacity=opacity, through=0.6 * opacity),
        Spheres(turning, 0.016, colour, opacity=opacity, through=0.6 * opacity),
    )


def ghost_marks(skeleton: Skeleton, joints: NDArray[np.float64], opacity: float = 0.35) -> Lines:
    """Other poses as faint stick figures. joints: (K, J, 3) metres, world."""
    children = np.flatnonzero(skeleton.parents >= 0)
    bones = np.column_stack([skeleton.parents[children], children])
    starts = len(skeleton) * np.arange(len(joints))
    segments = (starts[:, None, None] + bones).reshape(-1, 2).astype(np.int32)
    return Lines(joints.reshape(-1, 3), segments, GHOST, width=2.0, opacity=opacity, through=opacity / 2)


def side_by_side(left: Scene, right: Scene, apart_m: float = 1.2) -> Scene:
    """Two scenes in one picture, `apart_m` metres between their middles, seen as the left one is.

    Words are the left one's; whoever calls knows how the two belong together.
    """
    aside = apart_m / 2 * left.camera.axes[0]
    a, b = _moved(left, -aside), _moved(right, aside)
    return replace(
        left,
        surfaces=a.surfaces + b.surfaces,
        lines=a.lines + b.lines,
        spheres=a.spheres + b.spheres,
        camera=replace(left.camera, distance=1.4 * left.camera.distance),
    )


def beside_banner(scene: Scene) -> Scene:
    """The scene a little to the right, so that who follows the banner sees themselves beside it."""
    camera = scene.camera
    target = np.array(camera.target) - 0.18 * camera.distance * camera.axes[0]
    return replace(scene, camera=replace(camera, target=(float(target[0]), float(target[1]), float(target[2]))))


def _moved(scene: Scene, by: NDArray[np.float64]) -> Scene:
    return replace(
        scene,
        surfaces=tuple(replace(s, vertices=s.vertices + by) for s in scene.surfaces),
        lines=tuple(replace(x, points=x.points + by) for x in scene.lines),
        spheres=tuple(replace(s, centres=s.centres + by) for s in scene.spheres),
    )
