"""A skeleton: named joints in a tree, their rest offsets and limits."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from devices.errors import SixpointError
from reconstruction.joint_names import HUMANOID_OF_ROLE, humanoid_names


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A tree of joints.

    names: (J,) joint names as the file has them; end sites are joints named `<parent>_end`.
    parents: (J,) int, -1 for the root; a parent stands before its children.
    offsets: (J, 3) metres, from the parent in the parent's frame while all local rotations are the identity.
    limits: (J, 3, 2) radians, lower and upper bounds of each joint's rotation vector, or None where none are known.
    """

    names: tuple[str, ...]
    parents: NDArray[np.int32]
    offsets: NDArray[np.float64]
    limits: NDArray[np.float64] | None = field(default=None)

    def __len__(self) -> int:
        return len(self.names)

    @cached_property
    def is_end(self) -> NDArray[np.bool_]:
        """(J,) True for end sites: they only mark where a bone ends and never turn."""
        return np.array([name.endswith("_end") for name in self.names])

    @cached_property
    def children(self) -> tuple[tuple[int, ...], ...]:
        """(J,) the children of each joint."""
        return tuple(tuple(int(c) for c in np.flatnonzero(self.parents == j)) for j in range(len(self)))

    @cached_property
    def humanoid(self) -> dict[str, int]:
        """Joint index by humanoid bone name (`left_lower_arm`, as VRM names them), for the bones it has."""
        return humanoid_names(self.names)

    def role_joint(self, role: str) -> int:
        """The joint that a tracker role sits on. Raises SixpointError where the skeleton has none."""
        bone = HUMANOID_OF_ROLE[role]
        if bone not in self.humanoid:
            raise SixpointError(
                f"no joint for tracker role {role!r} ({bone}): the skeleton has {', '.join(self.names)}"
            )
        return self.humanoid[bone]

    def same_tree(self, other: "Skeleton") -> bool:
        """Whether both have the same joints and parents (their offsets may differ)."""
        return self.names == other.names and bool(np.array_equal(self.parents, other.parents))
