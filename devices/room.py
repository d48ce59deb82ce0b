"""Where a device stands in the room: one rigid transform from its own Y-up axes to the world."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from devices.axes import Quaternion, Vector


@dataclass(frozen=True)
class RoomTransform:
    """`T_world_device`: p_world = R p + translation.

    rotation: unit quaternion (x, y, z, w); translation: (3,) metres.
    """

    rotation: Quaternion = (0.0, 0.0, 0.0, 1.0)
    translation: Vector = (0.0, 0.0, 0.0)

    @classmethod
    def turned(cls, yaw_deg: float, translation: Vector = (0.0, 0.0, 0.0)) -> "RoomTransform":
        """Turned about the upright axis by `yaw_deg` (counter-clockwise seen from above), then moved."""
        half = math.radians(yaw_deg) / 2
        return cls((0.0, math.sin(half), 0.0, math.cos(half)), translation)

    @cached_property
    def is_identity(self) -> bool:
        """Whether it changes nothing."""
        return self == RoomTransform()

    @cached_property
    def matrix(self) -> NDArray[np.float64]:
        """(3, 3) `R_world_device`."""
        return Rotation.from_quat(self.rotation).as_matrix()

    @cached_property
    def _rows(self) -> tuple[Vector, Vector, Vector]:
        return tuple(map(tuple, self.matrix.tolist()))  # type: ignore[return-value]

    def point(self, p: Vector) -> Vector:
        """A point (3,) of the device's axes in the world, metres."""
        (a, b, c), (tx, ty, tz) = self._rows, self.translation
        return (
            a[0] * p[0] + a[1] * p[1] + a[2] * p[2] + tx,
            b[0] * p[0] + b[1] * p[1] + b[2] * p[2] + ty,
            c[0] * p[0] + c[1] * p[1] + c[2] * p[2] + tz,
        )

    def orientation(self, q: Quaternion) -> Quaternion:
        """An orientation (x, y, z, w) of the device's axes in the world."""
        ax, ay, az, aw = self.rotation
        bx, by, bz, bw = q
        return (
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        )
