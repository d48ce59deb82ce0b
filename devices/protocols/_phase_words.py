"""14-bit values in two 7-bit bytes, low byte first: Ascension's words and InterSense's packed items.

Bit 7 of a byte is free for the phasing bit, which marks where a record begins. Flock of Birds manual, "Output data".
"""

import struct
from collections.abc import Sequence


def word(raw: int) -> int:
    """The value of two bytes read as a little-endian number: an int16 whose two low bits are 0; bits 7 are ignored."""
    value = (raw & 0x007F) << 2 | (raw & 0x7F00) << 1
    return value - 65536 if value & 0x8000 else value


def words(data: bytes) -> list[int]:
    """The value of each pair of bytes."""
    return [word(raw) for raw in struct.unpack(f"<{len(data) // 2}H", data)]


def word_bytes(values: Sequence[int]) -> bytes:
    """Each int16 as two bytes with bit 7 clear; the two low bits are lost."""
    return bytes(byte for value in values for byte in ((value >> 2) & 0x7F, (value >> 9) & 0x7F))


def scaled(value: float, full_scale: float) -> int:
    """A value as the nearest word, -32768 to 32764 in steps of 4, saturating at the full scale."""
    return max(-32768, min(32764, 4 * round(value / full_scale * 8192)))
