"""CRC-16 with the reflected polynomial 0xA001 (0x8005): ARC where it starts at 0, MODBUS where it starts at 0xFFFF."""


def _table() -> tuple[int, ...]:
    rows = []
    for row in range(256):
        for _ in range(8):
            row = (row >> 1) ^ (0xA001 if row & 1 else 0)
        rows.append(row)
    return tuple(rows)


_TABLE = _table()


def crc16(data: bytes, start: int = 0) -> int:
    """CRC-16/ARC of the bytes; with start=0xFFFF CRC-16/MODBUS. Check value of b"123456789": 0xBB3D, 0x4B37."""
    crc = start
    for byte in data:
        crc = (crc >> 8) ^ _TABLE[(crc ^ byte) & 0xFF]
    return crc
