"""How the frame's inner loops are compiled: once into a cache, without Python's lock and its checks for zero."""

import numba

kernel = numba.njit(cache=True, nogil=True, error_model="numpy")
