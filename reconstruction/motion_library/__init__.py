"""Motions of our own making, from published biomechanics: what the demo and the tests stand on."""

from reconstruction.motion_library.library import LIBRARY_VERSION, demo_motion, generate_library

__all__ = ["LIBRARY_VERSION", "demo_motion", "generate_library"]
