import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from capture.raster import contact_sheet, reference, render, save_png, shading
from capture.raster.marks import draw_lines
from capture.raster.triangles import fill_triangles
from capture.scene import Camera, Floor, Lines, Scene, Spheres, Surface

FRONT = Camera(target=(0.0, 0.0, 0.0), distance=3.0, yaw=0.0, pitch=0.0)
SQUARE = np.array([[-0.3, -0.3, 0], [0.3, -0.3, 0], [0.3, 0.3, 0], [-0.3, 0.3, 0]])
SQUARE_FACES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def bare(**parts) -> Scene:
    return Scene(camera=FRONT, floor=None, **parts)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.25]))
def test_the_kernel_fills_what_the_reference_fills(seed, tilt):
    random = np.random.default_rng(seed)
    corners = np.column_stack([random.uniform(-5, 30, (12, 2)), random.uniform(-0.2, 1, 12)])
    triangles = random.integers(0, 12, (9, 3)).astype(np.int32)
    pictures = []
    for fill in (fill_triangles, reference.fill_triangles):
        nearness, owner = np.zeros((20, 24), np.float32), np.full((20, 24), -1, np.int32)
        fill(corners, triangles, tilt, nearness, owner)
        pictures.append((nearness, owner))
    assert np.allclose(pictures[0][0], pictures[1][0], atol=1e-6)
    assert (pictures[0][1] == pictures[1][1]).mean() > 0.995


def test_triangles_side_by_side_leave_no_gap():
    corners = np.array([[1.0, 1, 1], [9, 2, 1], [8, 9, 1], [2, 8, 1]])
    nearness, owner = np.zeros((10, 10), np.float32), np.full((10, 10), -1, np.int32)
    fill_triangles(corners, SQUARE_FACES, 0.0, nearness, owner)
    assert (owner[3:7, 3:7] >= 0).all()


def test_a_picture_is_the_same_every_time():
    scene = Scene(surfaces=(Surface(SQUARE - (0, -0.5, 0), SQUARE_FACES),), title="same", status=("one", "two"))
    assert np.array_equal(render(scene, 160, 90), render(scene, 160, 90))


def test_the_nearer_surface_is_seen_whichever_comes_first():
    red = Surface(SQUARE, SQUARE_FACES, colours=(0.9, 0.1, 0.1))
    blue = Surface(SQUARE - (0, 0, 0.5), SQUARE_FACES, colours=(0.1, 0.1, 0.9))
    for surfaces in ((red, blue), (blue, red)):
        middle = render(bare(surfaces=surfaces), 64, 64)[32, 32].astype(int)
        assert middle[0] > middle[2] + 50


def test_pixels_land_where_the_camera_law_says():
    picture = render(bare(spheres=(Spheres(np.array([[0.2, 0.1, 0.0]]), 0.01, (1.0, 0.0, 0.0)),)), 200, 200)
    focal = 100 / np.tan(FRONT.fov / 2)
    redness = picture[..., 0].astype(float) - picture[..., 1]
    rows, columns = np.nonzero(redness > 60)
    assert columns.mean() + 0.5 == pytest.approx(100 + focal * 0.2 / 3, abs=0.6)
    assert rows.mean() + 0.5 == pytest.approx(100 - focal * 0.1 / 3, abs=0.6)


def test_a_mark_behind_a_surface_is_hidden_unless_it_shines_through():
    surface = Surface(SQUARE, SQUARE_FACES, colours=(0.5, 0.5, 0.5))
    plain = render(bare(surfaces=(surface,)), 64, 64)
    for through, changed in ((0.0, False), (1.0, True)):
        ball = Spheres(np.array([[0.0, 0, -0.4]]), 0.05, (1.0, 0, 0), through=through)
        stroke = Lines(np.array([[-0.1, 0, -0.4], [0.1, 0.05, -0.4]]), np.array([[0, 1]]), (0, 0, 1), through=through)
        assert (not np.array_equal(render(bare(surfaces=(surface,), spheres=(ball,)), 64, 64), plain)) == changed
        assert (not np.array_equal(render(bare(surfaces=(surface,), lines=(stroke,)), 64, 64), plain)) == changed


def test_a_ghost_lets_what_is_behind_it_through_and_stays_behind_what_is_before_it():
    red = Surface(SQUARE, SQUARE_FACES, colours=(0.9, 0.1, 0.1))
    ghost_before = Surface(SQUARE - (0, 0, -0.3), SQUARE_FACES, colours=(0.1, 0.1, 0.9), opacity=0.5)
    ghost_behind = Surface(SQUARE - (0, 0, 0.3), SQUARE_FACES, colours=(0.1, 0.1, 0.9), opacity=0.5)
    alone = render(bare(surfaces=(red,)), 64, 64)[32, 32].astype(int)
    before = render(bare(surfaces=(red, ghost_before)), 64, 64)[32, 32].astype(int)
    assert alone[2] + 5 < before[2] < 200
    assert before[0] < alone[0]
    assert np.array_equal(render(bare(surfaces=(red, ghost_behind)), 64, 64)[32, 32], alone)


def test_something_above_the_floor_darkens_it():
    camera = Camera(target=(0.0, 0.0, 0.0), distance=3.0, yaw=0.0, pitch=0.9)
    lying = Surface(SQUARE[:, [0, 2, 1]] * [0.5, 1, -0.5] + [0, 0.4, 0], SQUARE_FACES)
    empty = render(Scene(camera=camera, floor=Floor(spacing=50.0)), 96, 96)
    shaded = render(Scene(surfaces=(lying,), camera=camera, floor=Floor(spacing=50.0)), 96, 96)
    surface_only = render(Scene(surfaces=(lying,), camera=camera, floor=None), 96, 96)
    background_only = render(Scene(camera=camera, floor=None), 96, 96)
    on_floor = (surface_only == background_only).all(axis=2)
    darker = (shaded.astype(int) - empty).sum(axis=2)[on_floor]
    assert darker.min() < -40
    assert darker.max() <= 0


def test_edges_are_smooth():
    slanting = SQUARE @ np.array([[np.cos(0.1), -np.sin(0.1), 0], [np.sin(0.1), np.cos(0.1), 0], [0, 0, 1]])
    picture = render(bare(surfaces=(Surface(slanting, SQUARE_FACES, colours=(0.1, 0.1, 0.1)),)), 96, 96)
    row = picture[48, :, 1].astype(int)
    between = (row > row.min() + 15) & (row < row.max() - 15)
    assert between.any()


def test_points_that_are_nan_or_behind_the_eye_are_left_out():
    background = render(bare(), 48, 48)
    lost = Spheres(np.array([[np.nan, 0, 0], [0, 0, 9.0]]), 0.1, through=1.0)
    stroke = Lines(np.array([[0.0, 0, 9], [np.nan, 0, 0]]), np.array([[0, 1]]), through=1.0)
    assert np.array_equal(render(bare(spheres=(lost,), lines=(stroke,)), 48, 48), background)


@pytest.mark.parametrize("surface", [Surface(np.empty((0, 3)), np.empty((0, 3), np.int32))])
def test_an_empty_surface_is_nothing(surface):
    assert np.array_equal(render(bare(surfaces=(surface,)), 32, 32), render(bare(), 32, 32))


def test_read_only_arrays_are_taken():
    vertices, faces, colours = SQUARE.copy(), SQUARE_FACES.copy(), np.full((4, 3), 0.5)
    for array in (vertices, faces, colours):
        array.flags.writeable = False
    marks = (Lines(vertices, faces[:, :2], colours[:2]),), (Spheres(vertices, 0.1, colours),)
    scene = bare(surfaces=(Surface(vertices, faces, vertices, colours),), lines=marks[0], spheres=marks[1])
    assert render(scene, 32, 32).shape == (32, 32, 3)


def test_png_holds_the_very_pixels(tmp_path):
    from PIL import Image

    picture = render(bare(surfaces=(Surface(SQUARE, SQUARE_FACES),)), 40, 30)
    save_png(picture, tmp_path / "a.png")
    assert np.array_equal(np.asarray(Image.open(tmp_path / "a.png")), picture)
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]


def test_a_contact_sheet_keeps_every_picture():
    pictures = [np.full((4, 6, 3), value, np.uint8) for value in (10, 20, 30)]
    sheet = contact_sheet(pictures, columns=2, gap=1)
    assert sheet.shape == (9, 13, 3)
    assert (sheet[:4, 7:] == 20).all()
    assert (sheet[5:, :6] == 30).all()
    assert (sheet[5:, 7:] == 255).all()


def test_words_stand_in_their_corners():
    plain = render(bare(), 320, 180)
    title = render(bare(title="title"), 320, 180) != plain
    status = render(bare(status=("one", "two")), 320, 180) != plain
    figures = render(bare(figures=("stage\tp50\tp99", "solve\t1.2\t3.4")), 320, 180) != plain
    for changed, quarter in ((title, (0, 0)), (status, (1, 0)), (figures, (0, 1))):
        rows, columns, _ = np.nonzero(changed)
        assert rows.size
        assert ((rows >= 90) == quarter[0]).all()
        assert ((columns >= 160) == quarter[1]).all()


def surface_pixels(seed: int, shape: tuple[int, int] = (13, 17)) -> np.ndarray:
    """A bumpy wall of pixels as `resolve_samples` gives them, with holes."""
    random = np.random.default_rng(seed)
    row, column = np.indices(shape)
    depth = 0.1 * np.sin(row / 3.0 + seed) + 0.05 * np.cos(column / 2.0) + 0.2 * (column > 8)
    position = np.stack([0.02 * (column - 8), 0.02 * (6 - row), depth], axis=-1)
    normal = np.stack([random.normal(0, 0.3, shape), random.normal(0, 0.3, shape), np.ones(shape)], axis=-1)
    colour = random.uniform(0, 1, (*shape, 3))
    coverage = random.choice([0.0, 0.25, 1.0, 1.0, 1.0], shape)[..., None]
    pixels = np.concatenate([position, normal, colour, coverage], axis=-1).astype(np.float32)
    pixels[pixels[..., 9] == 0] = 0
    return pixels


LOOK = (FRONT.eye, FRONT.axes, 600.0)


@pytest.mark.parametrize("seed", range(4))
def test_occlusion_is_as_the_reference(seed):
    pixels, results = surface_pixels(seed), []
    for occlude in (shading.occlude, reference.occlude):
        results.append(np.ones(pixels.shape[:2], np.float32))
        occlude(pixels, *LOOK, results[-1])
    assert np.allclose(*results, atol=1e-4)
    assert results[0].min() < 0.9


@pytest.mark.parametrize("seed", range(4))
def test_smoothing_is_as_the_reference(seed):
    pixels, results = surface_pixels(seed), []
    values = np.random.default_rng(seed).uniform(0, 1, pixels.shape[:2]).astype(np.float32)
    for smooth in (shading.smooth_turns, reference.smooth_turns):
        results.append(np.ones(pixels.shape[:2], np.float32))
        smooth(values, pixels, results[-1])
    assert np.allclose(*results, atol=1e-5)


@pytest.mark.parametrize("seed", range(4))
def test_the_soft_shadow_is_as_the_reference(seed):
    pixels, results = surface_pixels(seed), []
    map_rows, map_columns = np.indices((40, 40))
    shadow = np.where((map_rows + map_columns) % 17 < 8, 1.5, 0.0).astype(np.float32)
    for receive in (shading.receive_key_light, reference.receive_key_light):
        results.append(np.ones(pixels.shape[:2], np.float32))
        receive(pixels, shadow, np.eye(3), np.array([-0.2, -0.2, -1.0]), 100.0, results[-1])
    assert np.allclose(*results, atol=1e-3)
    assert 0.0 <= results[0].min() < 0.6


@pytest.mark.parametrize("opacity", [1.0, 0.4])
def test_light_is_as_the_reference(opacity):
    pixels, results = surface_pixels(1), []
    share = np.random.default_rng(3).uniform(0, 1, (2, *pixels.shape[:2])).astype(np.float32)
    directions = np.array([[-0.5, 0.7, 0.5], [0.8, 0.2, 0.5], [0.6, 0.5, -0.6]])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    lights = np.column_stack([directions, [[1.1, 1.0, 0.9], [0.1, 0.2, 0.2], [0.7, 0.8, 0.9]]])
    for light in (shading.light_pixels, reference.light_pixels):
        results.append(np.full((*pixels.shape[:2], 3), 0.5, np.float32))
        light(pixels, share[0], share[1], FRONT.eye, lights, opacity, results[-1])
    assert np.allclose(*results, atol=1e-4)
    assert np.ptp(results[0]) > 0.2


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([0.6, 1.0, 3.5]))
def test_strokes_are_as_the_reference(seed, width):
    random = np.random.default_rng(seed)
    points = np.column_stack([random.uniform(-10, 40, (6, 2)), random.uniform(-0.1, 1, 6)])
    segments = random.integers(0, 6, (5, 2)).astype(np.int32)
    nearness = random.uniform(0, 0.8, (24, 30)).astype(np.float32)
    results = []
    for draw in (draw_lines, reference.draw_lines):
        results.append(np.full((24, 30, 3), 0.3, np.float32))
        draw(points, segments, np.full((5, 3), 0.9), width, 0.8, 0.2, nearness, results[-1])
    assert np.allclose(*results, atol=1e-4)
