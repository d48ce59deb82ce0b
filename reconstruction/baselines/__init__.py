"""Other people's methods behind the same seam (`Predictor`), start, likelihood and solver as our own, to compare."""

from collections.abc import Callable, Sequence
from functools import partial

from reconstruction.baselines.damped_ik import DampedIkPredictor
from reconstruction.baselines.local_pca import LocalPcaPredictor
from reconstruction.baselines.local_pcr import LocalPcrPredictor
from reconstruction.baselines.style_ik import StyleIkPredictor
from reconstruction.baselines.tracker_poses import TrackerPosePredictor
from reconstruction.database import MotionDatabase
from reconstruction.prediction import Predictor

BASELINES: dict[str, Callable[[MotionDatabase, float, Sequence[str]], Predictor]] = {
    "gplvm": StyleIkPredictor,
    "lpca": LocalPcaPredictor,
    "lpcr": LocalPcrPredictor,
    "nearest": TrackerPosePredictor,
    "mean-16": partial(TrackerPosePredictor, count=16),
    "mean-16-ik": partial(TrackerPosePredictor, count=16, deviation=0.1),
    "damped-ik": DampedIkPredictor,
}
"""By name; each is made from a database, the performer's size over the database's, and the tracker roles there are."""

__all__ = ["BASELINES"]
