"""Polhemus data records: a header, then the items of an output list, one after the other without separators.

The item numbers differ between the families; what an item looks like, in binary and in text, is told by an `Item`.
"""

import re
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from devices.axes import Quaternion, Vector
from devices.errors import SettingError, choice_error
from devices.protocols._phase_words import scaled, word, word_bytes
from devices.protocols._poses import (
    FORWARD_RIGHT_DOWN,
    IDENTITY,
    euler_from_quaternion,
    plausible_euler,
    plausible_position,
    quaternion_from_euler,
    unit_quaternion,
)
from devices.sample import TrackerSample

Field = Literal["literal", "position", "euler", "quaternion", "time_ms", "frame", "button", "distortion"]
Pose = tuple[Vector | None, Quaternion | None]


@dataclass(frozen=True, slots=True)
class Item:
    """One entry of an output list.

    codes: `struct` codes of its values in binary. decimals: digits after the point of each 7-column value in text.
    literal: for blanks and line ends, the very bytes. full_scale: where above 0, the values are 14-bit words (codes
    "H") of this full scale, in metres, degrees or 1; they exist in binary only.
    """

    field: Field
    codes: str = ""
    decimals: int = 2
    literal: bytes = b""
    full_scale: float = 0.0


COLUMN = 7
"""Width of a value in a text record."""


class RecordLayout:
    """One output list's record: its size, how to read it and how to write it.

    items: numbers of the list. table: what they mean for this family. header: `struct` codes (binary) before them.
    Raises SettingError for a number the table does not have, or has in binary only.
    """

    def __init__(self, items: Sequence[int], table: Mapping[int, Item], header: str, binary: bool = True) -> None:
        unknown = next((number for number in items if number not in table), None)
        if unknown is not None:
            raise choice_error("item of the output list", unknown, sorted(table))
        packed = next((number for number in items if table[number].full_scale and not binary), None)
        if packed is not None:
            raise SettingError(f"item {packed} of the output list has no text form: use binary = true")
        self.items = tuple(table[number] for number in items)
        self.binary = binary
        self.header = struct.Struct(f"<{header}")
        self.body = struct.Struct("<" + "".join(f"{len(i.literal)}x" if i.literal else i.codes for i in self.items))
        self.size = self.header.size + (self.body.size if binary else sum(_text_size(i) for i in self.items))
        self._at = self._value_places()
        self._packed = {item.field: item.full_scale for item in self.items if item.full_scale}
        self._literals = self._literal_places()
        self._text = re.compile(b"".join(_text_pattern(i) for i in self.items))

    def values(self, record: bytes, start: int = 0) -> tuple | None:
        """The numbers of the record at `start` (all of it must be there); None where its fixed parts do not fit."""
        if not self.binary:
            match = self._text.fullmatch(record, start + self.header.size, start + self.size)
            return tuple(map(float, match.groups())) if match else None
        for offset, literal in self._literals:
            if not record.startswith(literal, start + offset):
                return None
        return self.body.unpack_from(record, start + self.header.size)

    def value(self, values: tuple, field: Field) -> Any:
        """A one-number field's number, or None where the list has none of it."""
        place = self._at.get(field)
        return None if place is None else values[place]

    def pose(self, values: tuple, unit_m: float) -> Pose | None:
        """Position in metres and turn, in `RUB`; None where the numbers cannot be a pose.

        A quaternion of zeros is what a receiver without a signal gives: it has neither position nor orientation.
        """
        position = self._numbers(values, "position", 3)
        if position:
            unit = 1.0 if "position" in self._packed else unit_m
            position = (position[0] * unit, position[1] * unit, position[2] * unit)
            if not plausible_position(position):
                return None
        euler = self._numbers(values, "euler", 3)
        if euler and not plausible_euler(euler):
            return None
        turn = quaternion_from_euler(euler) if euler else None
        quaternion = self._numbers(values, "quaternion", 4)
        if quaternion:
            w, x, y, z = quaternion
            if not (w or x or y or z):
                return None, None
            turn = unit_quaternion((x, y, z, w))
            if turn is None:
                return None
        axes = FORWARD_RIGHT_DOWN
        return axes.to_rub(position) if position else None, turn and axes.quaternion_to_rub(turn)

    def encode(self, header: tuple, sample: TrackerSample, unit_m: float, numbers: Mapping[Field, int]) -> bytes:
        """A whole record of a sample that has a position; numbers: the one-number fields, 0 where not given."""
        axes = FORWARD_RIGHT_DOWN
        place = axes.from_rub(sample.position or (0.0, 0.0, 0.0))
        x, y, z, w = turn = axes.quaternion_from_rub(sample.orientation or IDENTITY)
        values: dict[Field, tuple[float, ...]] = {
            "position": place if "position" in self._packed else tuple(value / unit_m for value in place),
            "euler": euler_from_quaternion(turn),
            "quaternion": (w, x, y, z),
        }
        record = self.header.pack(*header)
        for item in self.items:
            record += item.literal or self._encoded(item, values.get(item.field, (numbers.get(item.field, 0),)))
        return record

    def _encoded(self, item: Item, values: tuple[float, ...]) -> bytes:
        if item.full_scale:
            packed = bytearray(word_bytes([scaled(value, item.full_scale) for value in values]))
            packed[0] |= 0x80
            return bytes(packed)
        if self.binary:
            return struct.pack(f"<{item.codes}", *values)
        return b"".join(f"{value:{COLUMN}.{item.decimals}f}".encode() for value in values)

    def _numbers(self, values: tuple, field: Field, count: int) -> Any:
        """The `count` numbers of a field, () where the list has none of it."""
        place = self._at.get(field)
        if place is None:
            return ()
        numbers = values[place : place + count]
        full_scale = self._packed.get(field)
        return tuple(word(n) * full_scale / 32768 for n in numbers) if full_scale else numbers

    def _value_places(self) -> dict[Field, int]:
        """Field -> index of its first number among a record's numbers."""
        places: dict[Field, int] = {}
        index = 0
        for item in self.items:
            if not item.literal:
                places[item.field] = index
                index += _count(item)
        return places

    def _literal_places(self) -> list[tuple[int, bytes]]:
        """(offset in a binary record, bytes that must stand there)."""
        places = []
        offset = self.header.size
        for item in self.items:
            if item.literal:
                places.append((offset, item.literal))
            offset += len(item.literal) or struct.calcsize(f"<{item.codes}")
        return places


def _count(item: Item) -> int:
    return len(struct.unpack(f"<{item.codes}", bytes(struct.calcsize(f"<{item.codes}"))))


def _text_size(item: Item) -> int:
    return len(item.literal) or COLUMN * _count(item)


def _text_pattern(item: Item) -> bytes:
    if item.literal:
        return re.escape(item.literal)
    return (rb" *(-?\d{1,4}\.\d{%d})" % item.decimals) * _count(item)
