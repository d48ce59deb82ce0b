"""The mannequin: a closed, all-quad body of our own making for any skeleton."""

from deformation.mannequin.mannequin import RESOLUTIONS, mannequin

__all__ = ["RESOLUTIONS", "mannequin"]
