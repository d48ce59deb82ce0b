"""Poses from a few tracked points: skeletons, motions, the database and the MAP solver."""
