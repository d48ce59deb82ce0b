"""sRGB and linear light, IEC 61966-2-1."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def linear(colours: ArrayLike) -> NDArray[np.float64]:
    """Linear light of sRGB values, both 0 to 1."""
    values = np.asarray(colours, np.float64)
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def srgb_bytes(light: NDArray[np.floating]) -> NDArray[np.uint8]:
    """sRGB bytes of linear light; what is brighter than 1 is white."""
    return _TABLE[(np.clip(light, 0.0, 1.0) * (len(_TABLE) - 1) + 0.5).astype(np.uint16)]


def _table(entries: int = 8192) -> NDArray[np.uint8]:
    light = np.linspace(0.0, 1.0, entries)
    curve = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.round(255 * curve).astype(np.uint8)


_TABLE = _table()
