"""Operations on whole motions: another frame rate, the mirror image, parts, sequences, other proportions."""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from devices.errors import SettingError
from devices.frame import frozen
from reconstruction.interpolation import slerp
from reconstruction.kinematics import world_joints
from reconstruction.motion import Motion
from reconstruction.skeleton import Skeleton


def continuous_hemispheres(rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same rotations (T, ..., 4) with each quaternion's sign such that it is nearest to the frame before."""
    same_side = np.einsum("t...k,t...k->t...", rotations[1:], rotations[:-1]) >= 0
    signs = np.cumprod(np.where(same_side, 1.0, -1.0), axis=0)
    return np.concatenate([rotations[:1], rotations[1:] * signs[..., None]])


def resampled(motion: Motion, fps: float) -> Motion:
    """The motion at another frame rate: positions straight, rotations by slerp between the two frames around.

    Frames stand at 0, 1/fps, 2/fps ... up to the motion's duration, the last only where it falls on one.
    """
    if not (np.isfinite(fps) and fps > 0):
        raise SettingError(f"{fps} frames a second: it must be above zero")
    if abs(fps - motion.fps) < 1e-6 * fps or len(motion) < 2:
        return replace(motion, fps=float(fps))
    at = np.arange(0, motion.duration_s + 1e-9, 1 / fps) * motion.fps
    positions, rotations = sampled(motion, at)
    return replace(motion, root_positions=frozen(positions), rotations=frozen(rotations), fps=float(fps))


def sampled(motion: Motion, at: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Root positions (N, 3) and rotations (N, J, 4) at fractional frames (N,), which are held to the motion's ends."""
    at = np.clip(at, 0, len(motion) - 1)
    first = np.minimum(at.astype(np.int64), max(len(motion) - 2, 0))
    second = np.minimum(first + 1, len(motion) - 1)
    h = at - first
    positions = (1 - h)[:, None] * motion.root_positions[first] + h[:, None] * motion.root_positions[second]
    rotations = slerp(motion.rotations[first], motion.rotations[second], h[:, None])
    return positions, continuous_hemispheres(rotations)


def cropped(motion: Motion, start: int, stop: int) -> Motion:
    """Frames start to stop (not included). Raises SettingError where that leaves none."""
    if not 0 <= start < stop <= len(motion):
        raise SettingError(f"frames {start} to {stop} of {motion.name!r}, which has {len(motion)}")
    return replace(motion, root_positions=motion.root_positions[start:stop], rotations=motion.rotations[start:stop])


def concatenated(motions: Sequence[Motion], name: str | None = None) -> Motion:
    """One motion after the other as they stand, all on the skeleton and at the frame rate of the first."""
    first = motions[0]
    for motion in motions[1:]:
        require_same_joints(first.skeleton, motion.skeleton, motion.name)
        if not same_rate(motion, first):
            raise SettingError(f"{motion.name!r} has {motion.fps:g} frames a second, {first.name!r} {first.fps:g}")
    return replace(
        first,
        root_positions=frozen(np.concatenate([m.root_positions for m in motions])),
        rotations=frozen(continuous_hemispheres(np.concatenate([m.rotations for m in motions]))),
        name=name or first.name,
    )


def same_rate(a: Motion, b: Motion) -> bool:
    """Whether two motions have the same frame rate, rounding aside."""
    return abs(a.fps - b.fps) < 1e-6 * a.fps


def require_same_joints(expected: Skeleton, given: Skeleton, name: str) -> None:
    """Raises SettingError naming the joints by which two skeletons differ; the joints' order does not matter."""
    missing, extra = set(expected.names) - set(given.names), set(given.names) - set(expected.names)
    parts = [
        f"{word} {', '.join(sorted(names)[:6])}{' ...' if len(names) > 6 else ''}"
        for word, names in (("lacks", missing), ("has besides", extra))
        if names
    ]
    if not parts and _parent_names(expected) != _parent_names(given):
        moved = [n for n, p in _parent_names(given).items() if _parent_names(expected)[n] != p]
        parts = [f"hangs elsewhere {', '.join(moved[:6])}"]
    if parts:
        raise SettingError(f"{name!r} is on another skeleton: it {' and '.join(parts)}")


def _parent_names(skeleton: Skeleton) -> dict[str, str | None]:
    return {n: skeleton.names[p] if p >= 0 else None for n, p in zip(skeleton.names, skeleton.parents, strict=True)}


def retargeted(motion: Motion, skeleton: Skeleton) -> Motion:
    """The motion on a body of other proportions whose joints have the same names and rest frames.

    Rotations stay; the path is scaled by the ratio of the leg lengths, so that strides fit the legs, and the height is
    shifted so that the lowest point of the feet is as high above the floor as it was. Raises SettingError naming the
    joints where the skeletons differ.
    """
    require_same_joints(skeleton, motion.skeleton, motion.name)
    if motion.skeleton.same_tree(skeleton) and np.array_equal(motion.skeleton.offsets, skeleton.offsets):
        return replace(motion, skeleton=skeleton)
    order = [motion.skeleton.names.index(name) for name in skeleton.names]
    positions = motion.root_positions * (leg_length(skeleton) / leg_length(motion.skeleton))
    moved = Motion(skeleton, positions, frozen(motion.rotations[:, order]), motion.fps, motion.name)
    positions[:, 1] += _floor_height(motion) - _floor_height(moved)
    frozen(positions)
    return moved


def leg_length(skeleton: Skeleton) -> float:
    """Metres from hip to ankle along the bones, the mean of both legs; the joints' total where it has no legs."""
    bones = [f"{side}_{bone}" for side in ("left", "right") for bone in ("lower_leg", "foot")]
    lengths = np.linalg.norm(skeleton.offsets, axis=1)
    if any(bone not in skeleton.humanoid for bone in bones):
        return float(lengths[1:].sum())
    return float(sum(lengths[skeleton.humanoid[bone]] for bone in bones) / 2)


def _floor_height(motion: Motion) -> float:
    """Metres: the height that the body's lowest joint stands on, its 5th percentile over time."""
    joints, _ = world_joints(motion.skeleton, motion.root_positions, motion.rotations)
    return float(np.percentile(joints[..., 1].min(axis=-1), 5))


_MIRROR_X = np.diag([-1.0, 1.0, 1.0])
_REFLECTIONS = np.array([np.diag(signs) for signs in ((-1, 1, 1), (1, 1, -1), (1, -1, 1), (-1, -1, -1))], float)
"""How the axes of a joint on one side may relate to those of its counterpart on the other."""


def mirrored(motion: Motion) -> Motion:
    """The mirror image in the plane x = 0: what the left side did, the right side does.

    The image is taken in the world: `W'_j = S W_s(j) F_j`, with S the mirror, s(j) the joint's counterpart on the other
    side, and F_j the reflection that relates the two joints' own axes, found from the skeleton and the motion; so
    skeletons whose left and right axes are not mirror images (Bandai Namco's) work too. On a skeleton whose halves are
    alike, joint positions are mirrored exactly. Mirroring twice gives the motion back.
    """
    skeleton = motion.skeleton
    counterpart = mirror_joints(skeleton)
    local = Rotation.from_quat(motion.rotations.reshape(-1, 4)).as_matrix().reshape(*motion.rotations.shape[:2], 3, 3)
    reflections = _reflections(skeleton, counterpart, local)
    parent_reflection = np.where(
        (skeleton.parents < 0)[:, None, None], _MIRROR_X, reflections[np.maximum(skeleton.parents, 0)]
    )
    image = parent_reflection @ local[:, counterpart] @ reflections
    rotations = Rotation.from_matrix(image.reshape(-1, 3, 3)).as_quat().reshape(motion.rotations.shape)
    return replace(
        motion,
        root_positions=frozen(motion.root_positions * (-1, 1, 1)),
        rotations=frozen(continuous_hemispheres(rotations)),
        name=f"{motion.name}_mirrored",
    )


def mirror_joints(skeleton: Skeleton) -> NDArray[np.int64]:
    """(J,) index of each joint's counterpart on the other side by its name, itself for joints in the middle.

    Raises SettingError where counterparts do not hang on counterparts.
    """
    counterpart = np.array([_counterpart(name, skeleton.names) for name in skeleton.names])
    parents = skeleton.parents
    for joint in range(1, len(skeleton)):
        if counterpart[parents[joint]] != parents[counterpart[joint]]:
            raise SettingError(
                f"cannot mirror: joints {skeleton.names[joint]!r} and {skeleton.names[counterpart[joint]]!r}"
                " do not hang on counterparts"
            )
    return counterpart


_SIDE_MARKS = (("Left", "Right"), ("left", "right"), ("LEFT", "RIGHT"))
_SIDE_LETTERS = (re.compile(r"(?<=[._\- ])[LRlr](?=$|[._\- ])"), re.compile(r"(?:^|(?<=:))[LRlr](?=[A-Za-z_])"))
_OTHER_LETTER = {"L": "R", "R": "L", "l": "r", "r": "l"}


def _counterpart(name: str, names: Sequence[str]) -> int:
    """Index of the joint on the other side: `LeftArm` and `RightArm`, `Hand_L` and `Hand_R`, `lfemur` and `rfemur`."""
    for left, right in _SIDE_MARKS:
        for mark, other in ((left, right), (right, left)):
            if mark in name and name.replace(mark, other) in names:
                return names.index(name.replace(mark, other))
    for letter in _SIDE_LETTERS:
        swapped = letter.sub(lambda match: _OTHER_LETTER[match[0]], name)
        if swapped != name and swapped in names:
            return names.index(swapped)
    return names.index(name)


def _reflections(skeleton: Skeleton, counterpart: NDArray[np.int64], local: NDArray[np.float64]) -> NDArray[np.float64]:
    """(J, 3, 3) F_j of `mirrored`: the one that maps the counterpart's bones onto the joint's own.

    Bones along an axis leave two that do; of these the one is right whose image of the counterpart's mean rotation
    is near the joint's own mean: the others are half a turn away.
    """
    mean = Rotation.from_matrix(local[:: max(1, len(local) // 64)].reshape(-1, 3, 3)).as_matrix()
    mean = mean.reshape(-1, len(skeleton), 3, 3).mean(axis=0)
    chosen = np.empty((len(skeleton), 3, 3))
    for joint, parent in enumerate(skeleton.parents):
        other = counterpart[joint]
        if other < joint:
            chosen[joint] = chosen[other]
            continue
        bones = np.array([skeleton.offsets[c] for c in _bone_ends(skeleton, other)]).reshape(-1, 3)
        own = np.array([skeleton.offsets[counterpart[c]] for c in _bone_ends(skeleton, other)]).reshape(-1, 3)
        misfit = np.linalg.norm(_REFLECTIONS @ bones.T - own.T, axis=1).sum(axis=1) / max(np.abs(bones).sum(), 1e-9)
        if parent >= 0:
            images = chosen[parent] @ mean[other] @ _REFLECTIONS
            misfit += 0.1 * (3 - np.einsum("fab,ab->f", images, mean[joint]))
        chosen[joint] = _REFLECTIONS[np.argmin(misfit)]
    return chosen


def _bone_ends(skeleton: Skeleton, joint: int) -> list[int]:
    """The joints at the far ends of a joint's bones; children without an offset are looked through."""
    ends = []
    for child in skeleton.children[joint]:
        ends += [child] if np.linalg.norm(skeleton.offsets[child]) > 1e-6 else _bone_ends(skeleton, child)
    return ends
