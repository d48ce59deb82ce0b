import numpy as np

from reconstruction.gathering import gather


def test_the_gathering_kernel_agrees_with_coordinates_of_the_motion(database):
    rows = np.sort(database.windows)[[0, 40, 300, 700]].astype(np.int64)
    for row, seen in zip(rows, gather(rows, 2, np.asarray(database.poses), np.asarray(database.headings)), strict=True):
        clip = database.clip_of(int(row))
        motion, frame = database.motion(clip), database.headings[row - 1].astype(np.float64)
        at = slice(int(row) - 2 - clip.first, int(row) - 1 - clip.first)
        plain = database.space.coordinates(motion.root_positions[at], motion.rotations[at], frame)
        np.testing.assert_allclose(seen, plain[0], atol=1e-5)
