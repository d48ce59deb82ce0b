"""A person's joints as the paper has them: seam curves, 20-degree down-sampling and a template (its section 5).

The centres of the seam curves of arms and legs are joints 1 to 4; a limb's others lie where its centre line turns by 20
degrees or more, else at the template's share of its length. Joints 5 and 6 between these pairs are their midpoints
(fig. 4e), or make the triangle with them that the template's do (fig. 4h). Torso, neck and head lie by length along the
middle between and above them. `auto_rig_human` is what `sixpoint rig` goes by; this is for comparing.
"""

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from deformation.auto_rig_extremities import Extremities
from deformation.auto_rig_human import Joints, seams, trunk_middle
from deformation.curve_skeleton import CentreLine, downsampled, line_through
from reconstruction.kinematics import world_transforms
from reconstruction.standard_body import standard_skeleton

FORMS = ("midpoint", "triangle")

_NEAR = 0.12
"""A bend is the template's joint if it lies so near to its place, as a share of the limb."""

_SLICES = 24


@cache
def template_joints() -> Joints:
    """(3,) metres by humanoid bone and `_end`: the template skeleton, upright and facing +Z."""
    skeleton = standard_skeleton()
    still = np.tile([0.0, 0.0, 0.0, 1.0], (len(skeleton), 1))
    places = world_transforms(skeleton, np.zeros(3), still)[:, :3, 3]
    joints = {bone: places[joint] for bone, joint in skeleton.humanoid.items()}
    for bone in ("head", "left_hand", "right_hand", "left_toes", "right_toes"):
        end = f"{skeleton.names[skeleton.humanoid[bone]]}_end"
        joints[f"{bone}_end"] = places[skeleton.names.index(end)]
    return joints


def matched_triangle(
    template: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    a: NDArray[np.float64],
    b: NDArray[np.float64],
) -> NDArray[np.float64]:
    """(3,) the third corner over a and b (3,) of a triangle similar to the template's.

    Its sides' ratios give it up to a turn about a - b (the paper's third equation follows from the other two); it is
    turned as the template's is.
    """
    p, q, r = template
    along, across = q - p, b - a
    turn = Rotation.align_vectors(across[None], along[None])[0].as_matrix()
    return a + turn @ (r - p) * float(np.linalg.norm(across) / np.linalg.norm(along))


def by_length(line: CentreLine, shares: Sequence[float]) -> list[NDArray[np.float64]]:
    """(3,) each: the points at shares of a line's length, L59 / L56 = L5''9'' / L5''6''."""
    return [line.at(share * line.length) for share in shares]


def shares_of(chain: Sequence[NDArray[np.float64]]) -> list[float]:
    """Where the inner joints of a template's chain (3,) each are along it, 0 to 1."""
    lengths = np.linalg.norm(np.diff(np.array(chain), axis=0), axis=1)
    return (np.cumsum(lengths)[:-1] / lengths.sum()).tolist()


def matched_joints(body: Extremities, line_of: Callable[[str, float], CentreLine], form: str = "triangle") -> Joints:
    """Joint places (3,) metres by name, every joint of `rig_templates.HUMAN_TREE`.

    line_of: as for `auto_rig_human.human_joints`; form: one of FORMS. Raises SixpointError as that does.
    """
    at, template = seams(body), template_joints()
    joints: Joints = {}
    for side in ("left", "right"):
        for tip, seam, chain in (
            ("hand", f"{side}_hand", ("hand_end", "hand", "lower_arm", "upper_arm")),
            ("foot", "crotch", ("toes_end", "toes", "foot", "lower_leg", "upper_leg")),
        ):
            name = f"{side}_{tip}"
            reach = float(body.fields[name][_nearest(body, at[seam])])
            joints |= _limb(line_of(name, reach), [f"{side}_{joint}" for joint in chain], template)
    pairs = {"neck": ("right_upper_arm", "left_upper_arm"), "hips": ("right_upper_leg", "left_upper_leg")}
    for middle, (a, b) in pairs.items():
        if form == "midpoint":
            joints[middle] = (joints[a] + joints[b]) / 2
        else:
            joints[middle] = matched_triangle((template[a], template[b], template[middle]), joints[a], joints[b])
    return joints | _axis(body, joints, template)


def _limb(line: CentreLine, chain: list[str], template: Joints) -> Joints:
    """The joints of a chain from its tip to its seam: bends where they are near the template's places."""
    bends = [float(line.arcs[vertex]) for vertex in downsampled(line)[1:-1]]
    joints = {chain[0]: line.points[0], chain[-1]: line.points[-1]}
    for name, share in zip(chain[1:-1], shares_of([template[joint] for joint in chain]), strict=True):
        usual = share * line.length
        bend = min(bends, key=lambda arc: abs(arc - usual), default=usual)
        joints[name] = line.at(bend if abs(bend - usual) < _NEAR * line.length else usual)
    return joints


def _axis(body: Extremities, joints: Joints, template: Joints) -> Joints:
    """Spine, head and collar bones by length along the trunk's middle, to the crown and out to the shoulders."""
    low, high, crown = joints["hips"], joints["neck"], body.place("head")
    heights = np.linspace(low[1], high[1], _SLICES + 2)[1:-1]
    middle = np.array([low, *(trunk_middle(body, float(height)) for height in heights), high])
    torso = ("spine", "chest", "upper_chest")
    shares = shares_of([template[name] for name in ("hips", *torso, "neck")])
    found = dict(zip(torso, by_length(line_through(middle, np.zeros(len(middle))), shares), strict=True))
    (head,) = shares_of([template[name] for name in ("neck", "head", "head_end")])
    found |= {"head": high + head * (crown - high), "head_end": crown}
    for side in ("left", "right"):
        chain = [template[name] for name in ("neck", f"{side}_shoulder", f"{side}_upper_arm")]
        found[f"{side}_shoulder"] = high + shares_of(chain)[0] * (joints[f"{side}_upper_arm"] - high)
    return found


def _nearest(body: Extremities, place: NDArray[np.float64]) -> int:
    return int(np.argmin(np.linalg.norm(body.graph.vertices - place, axis=1)))
