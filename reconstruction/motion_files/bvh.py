"""Biovision hierarchy (BVH) files, as the many programs that write them do.

The format has no standard; the description that programs follow is M. Meredith and S. Maddock, "Motion Capture File
Formats Explained", University of Sheffield CS-01-11 (2001). A joint turns by its rotation channels in the order they
stand, each about the axis that the ones before have turned (intrinsic), and its position channels replace its offset.
"""

import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from devices.errors import FileError
from devices.frame import frozen
from reconstruction.motion import Motion
from reconstruction.motion_operations import continuous_hemispheres
from reconstruction.skeleton import Skeleton
from replay_logs.atomic_file import written_beside

_CHANNEL = re.compile(r"([XYZ])(position|rotation)", re.IGNORECASE)


@dataclass
class _Joint:
    """A joint as the hierarchy describes it. channels: (axis 0-2, is rotation) in the order of the file."""

    name: str
    parent: int
    line: int
    offset: tuple[float, float, float] | None = None
    channels: list[tuple[int, bool]] = field(default_factory=list)


def read_bvh(path: str | Path, unit_m: float = 0.01) -> Motion:
    """The motion of a BVH file; `unit_m` is what one unit of length in the file is in metres.

    End sites become joints named `<parent>_end`. Position channels of joints other than the root give the joint's
    offset (their median over time: bones are rigid here). A root that only carries a moving child (Bandai Namco's
    original files) is merged into that child. Quaternions are continuous over time in their hemispheres.

    Raises FileError naming the file and the line of what is missing or broken.
    """
    path = Path(path)
    lines = _text_lines(path)
    start = next((i for i, line in enumerate(lines) if line.strip().upper() == "MOTION"), None)
    if start is None:
        raise FileError(f"{path}: no MOTION section; the file is cut off or not a BVH file")
    joints = _hierarchy(path, lines[:start])
    frames, frame_time, first = _header(path, lines, start + 1)
    values = _values(path, lines, first, frames, sum(len(joint.channels) for joint in joints))
    fps = round(1 / frame_time) if abs(1 / frame_time - round(1 / frame_time)) < 2e-4 / frame_time else 1 / frame_time
    return _motion(joints, values, unit_m, float(fps), path.stem)


def _text_lines(path: Path) -> list[str]:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise FileError(f"{path}: {error.strerror or error}") from error
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    lines = text.split("\n") if "\n" in text else text.split("\r")
    while lines and not lines[-1].strip():
        lines.pop()
    if not lines:
        raise FileError(f"{path}: the file is empty")
    if lines[0].strip().upper() != "HIERARCHY":
        raise FileError(f"{path}:1: starts with {lines[0].strip()[:40]!r}; a BVH file starts with HIERARCHY")
    return lines


def _hierarchy(path: Path, lines: Sequence[str]) -> list[_Joint]:
    """The joints, in the order of the file, from the lines above MOTION."""
    joints: list[_Joint] = []
    open_joints: list[int] = []
    for number, line in enumerate(lines[1:], 2):
        for statement in line.replace("{", "\n{\n").replace("}", "\n}\n").split("\n"):
            words = statement.split()
            if words:
                _read_statement(f"{path}:{number}", number, words, statement.strip(), joints, open_joints)
    if open_joints:
        raise FileError(f"{path}: {len(open_joints)} brackets stay open before MOTION; each {{ needs its }}")
    if not joints:
        raise FileError(f"{path}: no ROOT joint before MOTION")
    for joint in joints:
        if joint.offset is None:
            raise FileError(f"{path}:{joint.line}: joint {joint.name!r} has no OFFSET")
    return joints


def _read_statement(
    where: str, number: int, words: list[str], text: str, joints: list[_Joint], open_joints: list[int]
) -> None:
    """Adds what one statement says to the joints; `open_joints` are the joints whose brackets are open."""
    keyword = words[0].upper()
    if keyword in ("ROOT", "JOINT", "END"):
        _open_joint(where, number, keyword, text, joints, open_joints)
    elif keyword == "{":
        if not joints or not open_joints or open_joints[-1] != len(joints) - 1:
            raise FileError(f"{where}: a bracket opens without a ROOT, JOINT or End Site before it")
    elif not open_joints:
        raise FileError(f"{where}: {text[:40]!r} stands outside of any joint")
    elif keyword == "}":
        open_joints.pop()
    elif keyword == "OFFSET":
        joints[open_joints[-1]].offset = _three_numbers(where, words[1:])
    elif keyword == "CHANNELS":
        joints[open_joints[-1]].channels = _channels(where, words[1:])
    else:
        raise FileError(f"{where}: unknown word {words[0]!r}; use ROOT, JOINT, End Site, OFFSET or CHANNELS")


def _open_joint(where: str, number: int, keyword: str, text: str, joints: list[_Joint], open_joints: list[int]) -> None:
    if keyword == "ROOT" and joints:
        raise FileError(f"{where}: a second ROOT; a motion has one root")
    if keyword != "ROOT" and not open_joints:
        raise FileError(f"{where}: {text[:40]!r} stands outside of the ROOT joint")
    parent = open_joints[-1] if open_joints else -1
    taken = {joint.name for joint in joints}
    if keyword == "END":
        base = joints[parent].name
        name = f"{base}_end" if f"{base}_end" not in taken else f"{base}_{len(joints)}_end"
    else:
        name = text[len(keyword) :].strip() or "joint"
        if name in taken:
            raise FileError(f"{where}: a second joint named {name!r}; every joint needs a name of its own")
    open_joints.append(len(joints))
    joints.append(_Joint(name, parent, number))


def _three_numbers(where: str, words: list[str]) -> tuple[float, float, float]:
    try:
        x, y, z = (float(word) for word in words)
    except ValueError:
        raise FileError(f"{where}: OFFSET needs three numbers, not {' '.join(words)[:60]!r}") from None
    if not np.isfinite((x, y, z)).all():
        raise FileError(f"{where}: OFFSET holds {' '.join(words)[:60]!r}, which is not finite")
    return x, y, z


def _channels(where: str, words: list[str]) -> list[tuple[int, bool]]:
    matches = [_CHANNEL.fullmatch(word) for word in words[1:]]
    if not words or not words[0].isdigit() or int(words[0]) != len(matches) or None in matches:
        raise FileError(f"{where}: CHANNELS needs a count and as many of Xposition ... Zrotation")
    channels = [("XYZ".index(m[1].upper()), m[2].lower() == "rotation") for m in matches if m]
    if len(set(channels)) != len(channels):
        raise FileError(f"{where}: CHANNELS names a channel twice")
    return channels


def _header(path: Path, lines: Sequence[str], start: int) -> tuple[int, float, int]:
    """Number of frames, seconds a frame, and the index of the first line of values."""
    frames, frame_time, index = None, None, start
    while index < len(lines) and (frames is None or frame_time is None):
        text = lines[index].strip()
        value = text.rpartition(":")[2].split()[-1:] or [""]
        try:
            if re.match(r"frames\b", text, re.IGNORECASE):
                frames = int(value[0])
            elif re.match(r"frame\s*time\b", text, re.IGNORECASE):
                frame_time = float(value[0])
            elif text:
                break
        except ValueError:
            raise FileError(f"{path}:{index + 1}: a number is missing in {text[:60]!r}") from None
        index += 1
    if frames is None or frame_time is None:
        raise FileError(f"{path}:{min(index, len(lines) - 1) + 1}: MOTION needs 'Frames: N' and 'Frame Time: S' lines")
    if not (np.isfinite(frame_time) and frame_time > 0):
        raise FileError(f"{path}: Frame Time is {frame_time:g} s; it must be above zero")
    return frames, frame_time, index


def _values(path: Path, lines: Sequence[str], first: int, frames: int, width: int) -> NDArray[np.float64]:
    """(T, width) the channel values, one frame a line."""
    rows = [(number, line) for number, line in enumerate(lines[first:], first + 1) if line.strip()]
    for position, (number, line) in enumerate(rows):
        found = len(line.split())
        if found != width:
            cut = "; the file is cut off in mid-line" if position == len(rows) - 1 and found < width else ""
            raise FileError(f"{path}:{number}: {found} values where the channels ask for {width}{cut}")
    if len(rows) != frames:
        raise FileError(f"{path}: says 'Frames: {frames}' but holds {len(rows)} frames")
    if not rows:
        raise FileError(f"{path}: holds no frames")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)
            values = np.fromstring("\n".join(line for _, line in rows), sep=" ").reshape(frames, width)
    except (ValueError, DeprecationWarning):
        values = np.array([_row_of_numbers(path, number, line) for number, line in rows]).reshape(frames, width)
    bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if len(bad):
        raise FileError(f"{path}:{rows[bad[0]][0]}: a value is NaN or infinite; every value must be a finite number")
    return values


def _row_of_numbers(path: Path, number: int, line: str) -> list[float]:
    try:
        return [float(word) for word in line.split()]
    except ValueError as error:
        raise FileError(f"{path}:{number}: {error}") from None


def _motion(joints: list[_Joint], values: NDArray[np.float64], unit_m: float, fps: float, name: str) -> Motion:
    """The motion from the joints of the hierarchy and the channel values (T, channels)."""
    frames = len(values)
    offsets = np.array([joint.offset for joint in joints], dtype=float)
    positions = np.broadcast_to(offsets, (frames, *offsets.shape)).copy()
    rotations = np.zeros((frames, len(joints), 4))
    rotations[..., 3] = 1
    column = 0
    for j, joint in enumerate(joints):
        turns = [(axis, column + k) for k, (axis, turn) in enumerate(joint.channels) if turn]
        for k, (axis, turn) in enumerate(joint.channels):
            if not turn:
                positions[:, j, axis] = values[:, column + k]
        if turns:
            order = "".join("XYZ"[axis] for axis, _ in turns)
            angles = values[:, [c for _, c in turns]]
            rotations[:, j] = Rotation.from_euler(order, angles, degrees=True).as_quat()
        column += len(joint.channels)
    names, parents = [joint.name for joint in joints], np.array([joint.parent for joint in joints], np.int32)
    positions *= unit_m
    if _root_only_carries(joints, positions):
        names, parents, positions, rotations = _without_root(names, parents, positions, rotations)
    offsets = np.median(positions, axis=0)
    offsets[0] = offsets[0] if joints[0].channels == [] else np.asarray(joints[0].offset) * unit_m
    skeleton = Skeleton(tuple(names), frozen(parents), frozen(offsets))
    roots = np.ascontiguousarray(positions[:, 0])
    return Motion(skeleton, frozen(roots), frozen(continuous_hemispheres(rotations)), fps, name)


def _root_only_carries(joints: list[_Joint], positions: NDArray[np.float64]) -> bool:
    """Whether the root has one child, and that child travels: the child is the body's real root."""
    children = [j for j, joint in enumerate(joints) if joint.parent == 0]
    return len(children) == 1 and bool(np.ptp(positions[:, children[0]], axis=0).max() > 0.05)


def _without_root(
    names: list[str], parents: NDArray[np.int32], positions: NDArray[np.float64], rotations: NDArray[np.float64]
) -> tuple[list[str], NDArray[np.int32], NDArray[np.float64], NDArray[np.float64]]:
    """The same motion with the root's transform taken into its only child."""
    root = Rotation.from_quat(rotations[:, 0])
    positions[:, 1] = positions[:, 0] + root.apply(positions[:, 1])
    rotations[:, 1] = (root * Rotation.from_quat(rotations[:, 1])).as_quat()
    return names[1:], (parents[1:] - 1).astype(np.int32), positions[:, 1:], rotations[:, 1:]


def write_bvh(motion: Motion, path: str | Path, unit_m: float = 0.01, order: str = "ZXY") -> None:
    """Writes the motion as BVH, beside `path` and renamed into place.

    unit_m: metres that one unit of length in the file stands for; order: the Euler angles' order for every joint.
    Joint names stay as they are; leaves named `<parent>_end` become End Sites. The root's offset is zero: its
    channels hold its world position. Angles are unwrapped over time, so that they may be interpolated.
    """
    path = Path(path)
    turning = [j for j in range(len(motion.skeleton)) if not _is_end_site(motion.skeleton, j)]
    order_in_file = _depth_first(motion.skeleton)
    turning = [j for j in order_in_file if j in set(turning)]
    angles = np.degrees(continuous_euler(motion.rotations[:, turning], order))
    values = np.concatenate([motion.root_positions / unit_m, angles.reshape(len(motion), -1)], axis=1)
    row = " ".join(["%.6f"] * values.shape[1])
    text = [
        "HIERARCHY",
        *_hierarchy_lines(motion.skeleton, unit_m, order),
        "MOTION",
        f"Frames: {len(motion)}",
        f"Frame Time: {1 / motion.fps:.10g}",
        *(row % tuple(frame) for frame in values),
    ]
    with written_beside(path) as part:
        part.write_text("\n".join(text) + "\n", encoding="utf-8", newline="\n")


def _is_end_site(skeleton: Skeleton, joint: int) -> bool:
    parent = int(skeleton.parents[joint])
    return parent >= 0 and not skeleton.children[joint] and skeleton.names[joint] == f"{skeleton.names[parent]}_end"


def _depth_first(skeleton: Skeleton) -> list[int]:
    """The joints in the order in which a BVH hierarchy names them."""
    order, stack = [], [0]
    while stack:
        joint = stack.pop()
        order.append(joint)
        stack.extend(reversed(skeleton.children[joint]))
    return order


def _hierarchy_lines(skeleton: Skeleton, unit_m: float, order: str) -> list[str]:
    turns = " ".join(f"{axis}rotation" for axis in order)

    def lines_of(joint: int, depth: int) -> list[str]:
        indent, inner = "  " * depth, "  " * (depth + 1)
        offset = skeleton.offsets[joint] / unit_m if depth else np.zeros(3)
        end_site = _is_end_site(skeleton, joint)
        head = "End Site" if end_site else f"{'JOINT' if depth else 'ROOT'} {skeleton.names[joint]}"
        channels = f"CHANNELS 3 {turns}" if depth else f"CHANNELS 6 Xposition Yposition Zposition {turns}"
        return [
            f"{indent}{head}",
            f"{indent}{{",
            f"{inner}OFFSET {offset[0]:.6f} {offset[1]:.6f} {offset[2]:.6f}",
            *([] if end_site else [f"{inner}{channels}"]),
            *(line for child in skeleton.children[joint] for line in lines_of(child, depth + 1)),
            f"{indent}}}",
        ]

    return lines_of(0, 0)


def continuous_euler(rotations: NDArray[np.float64], order: str) -> NDArray[np.float64]:
    """Euler angles (T, J, 3) radians, intrinsic in `order`, of quaternions (T, J, 4), without jumps over time.

    Every rotation has two triples, (a, b, c) and (a + pi, pi - b, c + pi), each up to whole turns: the one nearest to
    the frame before is taken.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Gimbal lock", UserWarning)
        angles = Rotation.from_quat(rotations.reshape(-1, 4)).as_euler(order).reshape(*rotations.shape[:-1], 3)
    other = angles * (1, -1, 1) + np.pi
    turn = 2 * np.pi
    for t in range(1, len(angles)):
        before = angles[t - 1]
        near = angles[t] + turn * np.round((before - angles[t]) / turn)
        far = other[t] + turn * np.round((before - other[t]) / turn)
        flip = np.abs(far - before).sum(-1) < np.abs(near - before).sum(-1)
        angles[t] = np.where(flip[:, None], far, near)
    return angles
