"""The mannequin of a performer, made once: its shape takes seconds, and a session must not wait for them each time."""

import contextlib
import hashlib
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import platformdirs
from numpy.typing import NDArray

from deformation.mesh import Mesh, all_quads
from devices.frame import frozen
from reconstruction.motion import Pose
from reconstruction.skeleton import Skeleton
from replay_logs.atomic_file import written_beside

_KEPT = 24
"""So many are kept, of about a megabyte and a half each at most."""
_MADE_BY = ("deformation.mannequin", "deformation.bind_pose", "deformation.mesh", "reconstruction.standard_body")


@dataclass(frozen=True, eq=False)
class Mannequin:
    """mesh: its body; bind: (J, 4, 4) `T_world_joint` of the skeleton in it; colours: (V, 3) sRGB."""

    mesh: Mesh
    bind: NDArray[np.float64]
    colours: NDArray[np.float64]


def cached_mannequin(
    skeleton: Skeleton, resolution: str, reference: Pose | None = None, folder: Path | None = None
) -> Mannequin:
    """`deformation.mannequin.mannequin` with its colours, from the user's cache where it was made before.

    folder: instead of the user's cache. Another skeleton, pose or version of what makes it is another file; one that
    cannot be read is made anew, and where none can be written nothing is kept.
    """
    folder = folder or platformdirs.user_cache_path("sixpoint", appauthor=False) / "mannequins"
    path = folder / f"{_key(skeleton, resolution, reference)}.npz"
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as held:
            mesh = all_quads(held["vertices"], held["quads"])
            return Mannequin(mesh, frozen(held["bind"]), frozen(held["colours"]))
    except (OSError, KeyError, ValueError, EOFError, zipfile.BadZipFile):
        pass
    made = _made(skeleton, resolution, reference)
    with contextlib.suppress(OSError):
        _keep(path, made)
    return made


def _made(skeleton: Skeleton, resolution: str, reference: Pose | None) -> Mannequin:
    from deformation.mannequin import mannequin, mannequin_colours

    mesh, bind = mannequin(skeleton, resolution, reference)
    return Mannequin(mesh, bind, mannequin_colours(mesh))


def _keep(path: Path, made: Mannequin) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    arrays = {"vertices": made.mesh.vertices, "quads": made.mesh.quads, "bind": made.bind, "colours": made.colours}
    with written_beside(path) as part, part.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays)
    by_age = sorted(path.parent.glob("*.npz"), key=lambda held: held.stat().st_mtime, reverse=True)
    for old in by_age[_KEPT:]:
        old.unlink(missing_ok=True)


def _key(skeleton: Skeleton, resolution: str, reference: Pose | None) -> str:
    """The same for the same mannequin: of the skeleton, the pose, and the sources that make it."""
    digest = hashlib.sha256(f"{resolution} {skeleton.names} {np.__version__}".encode())
    for array in (skeleton.parents, skeleton.offsets):
        digest.update(np.ascontiguousarray(array).tobytes())
    if reference is not None:
        digest.update(np.concatenate([np.ravel(reference.root_position), np.ravel(reference.rotations)]).tobytes())
    for source in _sources():
        digest.update(source.read_bytes())
    return digest.hexdigest()[:32]


def _sources() -> Iterator[Path]:
    for name in _MADE_BY:
        spec = find_spec(name)
        origin = Path((spec and spec.origin) or __file__)
        yield from sorted(origin.parent.glob("*.py")) if origin.name == "__init__.py" else [origin]
