"""14-bit values in two 7-bit bytes, low byte first: Ascension's words and InterSense's packed items.

Bit 7 of a byte is free for the phasing bit, which marks where a record begins. Flock of Birds manual, "Output data".
"""

from collections.abc import Sequence


def words(data: bytes) -> list[int]:
    """The values of pairs of bytes, as int16 whose two low bits are 0; bit 7 of every byte is ignored."""
    pairs = zip(data[::2], data[1::2], strict=True)
    return [_signed(((low & 0x7F) << 2) | ((high & 0x7F) << 9)) for low, high in pairs]


def word_bytes(values: Sequence[int]) -> bytes:
    """Each int16 as two bytes with bit 7 clear; the two low bits are lost."""
    return bytes(byte for value in values for byte in ((value >> 2) & 0x7F, (value >> 9) & 0x7F))


def scaled(value: float, full_scale: float) -> int:
    """A value as the nearest word, -32768 to 32764 in steps of 4, saturating at the full scale."""
    return max(-32768, min(32764, 4 * round(value / full_scale * 8192)))


def _signed(value: int) -> int:
    return value - 65536 if value & 0x8000 else value
