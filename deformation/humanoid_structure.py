"""Which joint is which bone of a person, where the tables of names leave gaps: from the tree and from where joints are.

A person's tree has one joint, the hips, under which two chains run down to the feet and one up to the head and to two
arms. Along a limb the two longest successive bones are its upper and lower part.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from reconstruction.joint_names import humanoid_names

_SPINE = ("spine", "chest", "upper_chest")
_LIMBS = {
    "arm": ("shoulder", "upper_arm", "lower_arm", "hand"),
    "leg": (None, "upper_leg", "lower_leg", "foot", "toes"),
}


def humanoid_bones(
    names: Sequence[str],
    parents: NDArray[np.int32],
    positions: NDArray[np.float64],
    known: dict[str, int] | None = None,
) -> dict[str, int]:
    """Joint by humanoid bone: what the file says (`known`), then what the tables of names say, then the structure.

    positions: (J, 3) metres in the world, upright; left is +X or -X, which the names or the feet's direction decide.
    """
    found = {**humanoid_names(names), **(known or {})}
    tree = _Tree(parents, positions)
    limbs = {f"{side}_{limb}" for side in ("left", "right") for limb in ("arm", "leg")}
    guessed = tree.limbs(found) if any(not _has_limb(found, limb) for limb in limbs) else {}
    for bone, joint in guessed.items():
        found.setdefault(bone, joint)
    return tree.centre(found)


def _has_limb(found: dict[str, int], limb: str) -> bool:
    side, _, kind = limb.partition("_")
    return all(f"{side}_{bone}" in found for bone in _LIMBS[kind][1:4])


class _Tree:
    def __init__(self, parents: NDArray[np.int32], positions: NDArray[np.float64]) -> None:
        self.parents, self.positions = parents, positions

    def path(self, joint: int) -> list[int]:
        """From the root to a joint."""
        path = [joint]
        while self.parents[path[-1]] >= 0:
            path.append(int(self.parents[path[-1]]))
        return path[::-1]

    def common(self, a: int, b: int) -> int:
        """The lowest joint above both."""
        return [x for x, y in zip(self.path(a), self.path(b), strict=False) if x == y][-1]

    def limbs(self, found: dict[str, int]) -> dict[str, int]:
        """Bones of the four limbs, from the outermost leaves; none at all where this is no person."""
        leaves = [j for j in range(len(self.parents)) if j not in set(self.parents.tolist())]
        if len(leaves) < 5:
            return {}
        at = self.positions
        middle = float(np.median(at[:, 0]))
        height = float(np.ptp(at[:, 1]))
        left = self._left_sign(found)
        guessed: dict[str, int] = {}
        for side, sign in (("left", left), ("right", -left)):
            own = [j for j in leaves if sign * (at[j, 0] - middle) > 0.01 * height]
            low = [j for j in own if at[j, 1] < at[:, 1].min() + 0.15 * height]
            high = [j for j in own if at[j, 1] > at[:, 1].min() + 0.3 * height]
            if low and high:
                foot = max(low, key=lambda j: (len(self.path(j)), -float(at[j, 1])))
                hand = max(high, key=lambda j: sign * float(at[j, 0]))
                guessed |= self._limb(side, "leg", foot) | self._limb(side, "arm", hand)
        if not all(_has_limb(guessed, f"{side}_{limb}") for side in ("left", "right") for limb in ("arm", "leg")):
            return {}
        return guessed

    def _left_sign(self, found: dict[str, int]) -> float:
        """+1 where the left side is at +X."""
        pairs = [
            (j, found[f"right_{b[5:]}"]) for b, j in found.items() if b[:5] == "left_" and f"right_{b[5:]}" in found
        ]
        offset = sum(float(self.positions[a, 0] - self.positions[b, 0]) for a, b in pairs)
        return -1.0 if offset < 0 else 1.0

    def _limb(self, side: str, kind: str, leaf: int) -> dict[str, int]:
        """The limb that ends at a leaf: its two longest successive bones, and what stands before and after."""
        path = self.path(leaf)
        lengths = np.linalg.norm(np.diff(self.positions[path], axis=0), axis=1)
        if len(lengths) < 3:
            return {}
        upper = int(np.argmax(np.minimum(lengths[:-1], lengths[1:])))
        bones = {}
        for step, bone in enumerate(_LIMBS[kind], start=upper - 1):
            if bone is not None and 0 < step < len(path):
                bones[f"{side}_{bone}"] = path[step]
        return bones

    def centre(self, found: dict[str, int]) -> dict[str, int]:
        """Hips where both legs meet, then the spine up to where the arms leave it, neck and head after that."""
        legs, arms = (
            [found.get(f"{side}_{bone}") for side in ("left", "right")] for bone in ("upper_leg", "upper_arm")
        )
        if None in legs or None in arms:
            return found
        hips, fork = self.common(*legs), self.common(*arms)  # type: ignore[arg-type]
        found = {**found, "hips": self._lowest_of_place(hips, found.get("hips"))}
        for side in ("left", "right"):
            if found.get(f"{side}_shoulder") in (fork, found[f"{side}_upper_arm"]):
                del found[f"{side}_shoulder"]
        path = self.path(fork)
        above = path[path.index(found["hips"]) + 1 :] if found["hips"] in path else []
        named = [found[bone] for bone in _SPINE if bone in found]
        if not named or not set(named) <= set(above):
            spread = _even(above, len(_SPINE))
            found = {b: j for b, j in found.items() if b not in _SPINE} | dict(zip(_SPINE, spread, strict=False))
        if "head" not in found:
            found |= self._head(fork, {found[f"{side}_upper_arm"] for side in ("left", "right")})
        if "head" in found and "neck" not in found:
            upper = self.path(found["head"])
            between = upper[upper.index(fork) + 1 : -1] if fork in upper else []
            found |= {"neck": between[0]} if between else {}
        return found

    def _head(self, fork: int, arms: set[int]) -> dict[str, int]:
        """The end of the highest chain that leaves the fork of the arms, or the joint before it on a long one."""
        paths = [self.path(joint) for joint in range(len(self.parents))]
        above = [p for p in paths if fork in p[:-1] and not arms & set(p)]
        if not above:
            return {}
        chain = max(above, key=lambda p: float(self.positions[p[-1], 1]))
        chain = chain[chain.index(fork) + 1 :]
        return {"head": chain[-2] if len(chain) > 2 else chain[-1]}

    def _lowest_of_place(self, hips: int, named: int | None) -> int:
        """The joint that the tables call hips where it is on the way to the legs' fork and in its place."""
        if named is not None and named in self.path(hips):
            near = np.linalg.norm(self.positions[named] - self.positions[hips]) < 0.08 * np.ptp(self.positions[:, 1])
            return named if near else hips
        return hips


def _even(joints: list[int], count: int) -> list[int]:
    """At most `count` of the joints, evenly picked, the first and the last among them."""
    if len(joints) <= count:
        return joints
    return [joints[round(step)] for step in np.linspace(0, len(joints) - 1, count)]
