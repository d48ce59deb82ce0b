"""Example shapes that come in as joints bend, over another deformation's result (paper section 6, by pose, not time).

An example says how the skin should look where a joint is turned. What it adds to the plainly deformed mesh is kept in
the bind pose, as pose space deformation has it (Lewis et al. 2000), and turned with the skin wherever that goes. On its
way in and out it lags as beams do along the mesh's curves.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from deformation.beam import BeamSettings, BeamSkin
from deformation.inbetween_skin import skin_curves
from deformation.isocurves import IsoCurves
from deformation.kernel import kernel
from deformation.mesh import Mesh
from devices.errors import SettingError

LEAST_TURN = np.radians(1.0)
"""An example whose joint is turned by less drives nothing."""

_SAME_AXIS = np.cos(np.radians(30))
"""Examples of a joint that turn it about axes nearer to each other lie on one scale of angles."""

_SHOWN_M = 1e-5
"""Vertices that no example moves by more are left alone."""

_STALL_S = 0.1
"""After a frame longer than this the shapes start again at rest."""


@dataclass(frozen=True, eq=False)
class ExampleShape:
    """How a character should look where a joint is turned so far.

    joint: its number. turn: (3,) rotation vector in radians against its parent, from the bind pose and in the world's
    axes there. offsets: (V, 3) metres to add in the bind pose; no offsets at no turn is understood.
    """

    joint: int
    turn: NDArray[np.float64]
    offsets: NDArray[np.float64]

    @property
    def angle(self) -> float:
        """Radians."""
        return float(np.linalg.norm(self.turn))


class PoseDrivenShapes:
    """The example shapes of one character, frame by frame.

    parents: (J,); vertex_joints: (V, K) and vertex_weights: (V, K): how the skin turns with the joints.
    Raises SettingError where an example turns its joint by less than a degree, or two about one axis by as much.
    """

    def __init__(
        self,
        mesh: Mesh,
        parents: NDArray[np.int32],
        vertex_joints: NDArray[np.int32],
        vertex_weights: NDArray[np.float64],
        examples: Sequence[ExampleShape],
        settings: BeamSettings | None = None,
    ) -> None:
        self._scales = _scales(examples)
        self._parents = np.asarray(parents)
        reached = np.max([np.linalg.norm(e.offsets, axis=1) for e in examples], axis=0) > _SHOWN_M
        curves, shown = _reached_curves(mesh, reached)
        reached[curves.vertices] = True
        self._rows = np.flatnonzero(reached).astype(np.int32)
        self._joints, self._weights = vertex_joints[self._rows], np.ascontiguousarray(vertex_weights[self._rows])
        self._shown = np.ascontiguousarray(shown[self._rows])
        inner = _renumbered(curves, self._rows)
        self._skin = BeamSkin(inner, mesh.vertices[self._rows], 1 / 60, settings)
        self._cut = {id(e): np.ascontiguousarray(e.offsets[self._rows]) for e in examples}
        size = len(self._rows)
        self._target, self._last = np.zeros((size, 3)), np.zeros((size, 3))
        self._velocity, self._moved = np.zeros((size, 3)), np.zeros((size, 3))
        self._started = False

    def reset(self) -> None:
        """Forgets all motion: the next frame starts at rest on its shapes."""
        self._started = False

    def weights(self, motion: NDArray[np.float64]) -> list[tuple[ExampleShape, float]]:
        """Each example that is in, and how far, 0 to 1. motion: as for `add`."""
        found = []
        for joint, axis, examples in self._scales:
            knots = [0.0, *(example.angle for example in examples)]
            angle = angle_about(relative_turn(motion, self._parents, joint), axis)
            place = float(np.interp(angle, knots, range(len(knots))))
            for number, example in enumerate(examples, start=1):
                weight = max(0.0, 1.0 - abs(place - number))
                if weight > 0:
                    found.append((example, weight))
        return found

    def add(self, vertices: NDArray[np.float64], motion: NDArray[np.float64], dt_s: float) -> None:
        """Adds the shapes to the deformed vertices (V, 3) metres, in place, dt_s seconds after the frame before.

        motion: (J, 3, 4) what each joint does to points of the bind pose, as `skinning.joint_motion` gives it.
        """
        self._target[:] = 0.0
        for example, weight in self.weights(motion):
            self._target += weight * self._cut[id(example)]
        if not self._started or dt_s > _STALL_S:
            self._skin.rest()
            self._last[:] = self._moved[:] = self._target
            self._started = True
        elif dt_s > 0:
            np.subtract(self._target, self._last, out=self._velocity)
            self._velocity /= dt_s
            self._skin.step(self._target, self._velocity, self._moved, dt_s)
            self._last[:] = self._target
        _add(vertices, self._rows, self._joints, self._weights, motion, self._target, self._moved, self._shown)


def relative_turn(motion: NDArray[np.float64], parents: NDArray[np.int32], joint: int) -> NDArray[np.float64]:
    """(3, 3) a joint's turn against its parent since the bind pose, in the world's axes there; motion: (J, 3, 4)."""
    parent = int(parents[joint])
    turn = motion[joint, :, :3]
    return turn if parent < 0 else motion[parent, :, :3].T @ turn


def angle_about(turn: NDArray[np.float64], axis: NDArray[np.float64]) -> float:
    """Radians, -pi to pi: the part of a rotation (3, 3) that is about a unit axis (3,)."""
    x, y, z, w = Rotation.from_matrix(turn).as_quat()
    angle = 2 * np.arctan2(axis @ (x, y, z), w)
    return float((angle + np.pi) % (2 * np.pi) - np.pi)


def blended_turns(
    motion: NDArray[np.float64], joints: NDArray[np.int32], weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N, 3, 3) what the joints (N, K) by weights (N, K) do to directions: the plain reference."""
    return np.einsum("nk,nkij->nij", weights, motion[joints][..., :3])


def _scales(examples: Sequence[ExampleShape]) -> list[tuple[int, NDArray[np.float64], list[ExampleShape]]]:
    """Joint, axis (3,) and examples by rising angle."""
    scales: list[tuple[int, NDArray[np.float64], list[ExampleShape]]] = []
    for example in sorted(examples, key=lambda e: e.angle):
        if not example.angle >= LEAST_TURN:
            raise SettingError(
                f"an example turns joint {example.joint} by {np.degrees(example.angle):.3g} degrees: "
                "it must be bent by one or more"
            )
        axis = example.turn / example.angle
        near = [s for s in scales if s[0] == example.joint and s[1] @ axis > _SAME_AXIS]
        if not near:
            scales.append((example.joint, axis, [example]))
            continue
        if near[0][2][-1].angle > example.angle - 1e-9:
            raise SettingError(
                f"two examples turn joint {example.joint} by {np.degrees(example.angle):.3g} degrees: give each once"
            )
        near[0][2].append(example)
    return scales


def _reached_curves(mesh: Mesh, reached: NDArray[np.bool_]) -> tuple[IsoCurves, NDArray[np.float64]]:
    """The curves with a vertex that an example moves, and (V,) how much of its lag each vertex shows."""
    curves, shown = skin_curves(mesh)
    touched = np.add.reduceat(reached[curves.vertices].astype(int), curves.starts[:-1]) > 0
    return curves.only(np.flatnonzero(touched).astype(np.int32)), shown


def _renumbered(curves: IsoCurves, rows: NDArray[np.int32]) -> IsoCurves:
    """The curves over a part (N,) of the vertices, which holds all of theirs."""
    return IsoCurves(
        np.searchsorted(rows, curves.vertices).astype(np.int32), curves.starts, curves.closed, curves.edges
    )


@kernel
def _add(vertices, rows, joints, weights, motion, target, moved, shown):
    """Adds what is shown of the lag to the target, and that, turned with the skin, to the vertices."""
    for n in range(len(rows)):
        x = target[n, 0] + shown[n] * (moved[n, 0] - target[n, 0])
        y = target[n, 1] + shown[n] * (moved[n, 1] - target[n, 1])
        z = target[n, 2] + shown[n] * (moved[n, 2] - target[n, 2])
        for k in range(joints.shape[1]):
            w = weights[n, k]
            if w > 0.0:
                t = motion[joints[n, k]]
                for i in range(3):
                    vertices[rows[n], i] += w * (t[i, 0] * x + t[i, 1] * y + t[i, 2] * z)
