"""RIG.json: a found skeleton as a file, to be looked at, corrected by hand, and read with its mesh.

One object: `format` "sixpoint-rig 1"; `units` "m"; `up` "Y"; `template`; `notes`; and `bones`, each with `name`
(a humanoid bone where it is one), `parent` (null for the root), `head` and `tail` (x, y, z). Places are those of the
mesh file. Lying beside its mesh as `NAME.rig.json` it is the skeleton of `NAME.obj` wherever a character is read.
"""

import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deformation.auto_rig import AutoRig
from devices.errors import FileError
from reconstruction.skeleton import Skeleton
from replay_logs.atomic_file import written_beside

FORMAT = "sixpoint-rig 1"


def write_rig(
    found: AutoRig, path: str | Path, unit_m: float = 1.0, shift_m: NDArray[np.float64] | None = None
) -> None:
    """Writes RIG.json beside and renames it into place.

    unit_m, shift_m: the mesh was placed as vertex * unit_m + shift_m (3,); joints are written back to the file's own.
    Raises OSError.
    """
    path = Path(path)
    own = (found.rig.bind[:, :3, 3] - (np.zeros(3) if shift_m is None else shift_m)) / unit_m
    content = {
        "format": FORMAT,
        "units": "m" if unit_m == 1.0 else f"{unit_m:g} m",
        "up": "Y",
        "template": found.template,
        "notes": list(found.notes),
        "bones": _bones(found.rig.skeleton, own),
    }
    with written_beside(path) as part:
        part.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def read_joints(path: str | Path) -> dict[str, NDArray[np.float64]]:
    """Joint places (3,) by name from a RIG.json or a part of one; only `name` and `head` are needed.

    Raises FileError naming the file and what is wrong.
    """
    path = Path(path)
    try:
        bones = json.loads(path.read_text(encoding="utf-8"))["bones"]
        places = {str(bone["name"]): np.array(bone["head"], float).reshape(3) for bone in bones}
    except OSError as error:
        raise FileError(f"{path}: {error.strerror}") from None
    except (KeyError, TypeError, ValueError, UnicodeDecodeError) as error:
        raise FileError(f"{path}: not a list of bones with name and head ({error})") from None
    wrong = [name for name, place in places.items() if not np.isfinite(place).all()]
    if wrong:
        raise FileError(f"{path}: the head of {wrong[0]!r} is not three numbers")
    return places


def _bones(skeleton: Skeleton, positions: NDArray[np.float64]) -> list[dict]:
    bones = []
    for joint, name in enumerate(skeleton.names):
        children = skeleton.children[joint]
        tail = positions[children[0]] if children else positions[joint]
        parent = int(skeleton.parents[joint])
        bones.append(
            {
                "name": name,
                "parent": None if parent < 0 else skeleton.names[parent],
                "head": [round(float(x), 6) for x in positions[joint]],
                "tail": [round(float(x), 6) for x in tail],
            }
        )
    return bones
