"""Which way a device's axes point, in three letters, and the turn into the Y-up axes that samples have.

The letters say where x, y and z point: R/L right or left, U/D up or down, F/B forward or back. Samples are `RUB` (x
right, y up, z back towards the user), so `RUB` is the identity; a FASTRAK is `FRD`, ROS is `FLU`.
"""

from dataclasses import dataclass
from itertools import permutations, product

from devices.errors import choice_error

_DIRECTION = {"R": (0, 1), "L": (0, -1), "U": (1, 1), "D": (1, -1), "B": (2, 1), "F": (2, -1)}
"""Letter -> (axis of RUB, sign)."""

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


def _parity(letters: str) -> int:
    axes = [_DIRECTION[letter][0] for letter in letters]
    inversions = sum(axes[i] > axes[j] for i in range(3) for j in range(i + 1, 3))
    signs = [_DIRECTION[letter][1] for letter in letters]
    return (-1) ** inversions * signs[0] * signs[1] * signs[2]


RIGHT_HANDED = tuple(
    letters
    for pairs in permutations(("RL", "UD", "BF"))
    for letters in map("".join, product(*pairs))
    if _parity(letters) == 1
)
"""The 24 right-handed frames."""


@dataclass(frozen=True, slots=True, init=False)
class Axes:
    """The turn between a device's frame and `RUB`; it relabels axes, so it is exact.

    A quaternion's vector part turns like a vector (R' = C R C^-1), its scalar part stays.
    Raises SettingError for letters that do not name a right-handed frame.
    """

    letters: str
    _take: tuple[int, int, int]
    _sign: tuple[int, int, int]
    _give: tuple[int, int, int]
    _give_sign: tuple[int, int, int]

    def __init__(self, letters: str) -> None:
        if letters not in RIGHT_HANDED:
            raise choice_error("axes", letters, RIGHT_HANDED)
        give = tuple(_DIRECTION[letter][0] for letter in letters)
        give_sign = tuple(_DIRECTION[letter][1] for letter in letters)
        take = tuple(give.index(axis) for axis in range(3))
        for field, value in (
            ("letters", letters),
            ("_take", take),
            ("_sign", tuple(give_sign[i] for i in take)),
            ("_give", give),
            ("_give_sign", give_sign),
        ):
            object.__setattr__(self, field, value)

    def to_rub(self, v: Vector) -> Vector:
        """A vector (3,) in the device's axes, in `RUB`."""
        (a, b, c), (s, t, u) = self._take, self._sign
        return (s * v[a], t * v[b], u * v[c])

    def from_rub(self, v: Vector) -> Vector:
        """A vector (3,) in `RUB`, in the device's axes."""
        (a, b, c), (s, t, u) = self._give, self._give_sign
        return (s * v[a], t * v[b], u * v[c])

    def quaternion_to_rub(self, q: Quaternion) -> Quaternion:
        """A quaternion (x, y, z, w) of the device's frame, in `RUB`."""
        return (*self.to_rub((q[0], q[1], q[2])), q[3])

    def quaternion_from_rub(self, q: Quaternion) -> Quaternion:
        """A quaternion (x, y, z, w) in `RUB`, in the device's frame."""
        return (*self.from_rub((q[0], q[1], q[2])), q[3])
