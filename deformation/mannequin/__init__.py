"""The mannequin: a closed, all-quad body of our own making for any skeleton."""

from deformation.mannequin.colours import mannequin_colours
from deformation.mannequin.mannequin import RESOLUTIONS, mannequin

__all__ = ["RESOLUTIONS", "mannequin", "mannequin_colours"]
