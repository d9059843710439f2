"""boresight: image sequences in, tracks one can trust out.

Positions are (x, y) = (column, row) in pixels, the centre of the top-left pixel is (0, 0); frames count from 0; times are seconds; states
are `[x, vx, y, vy]` in px and px/s, with their covariance.
"""

from . import filters, models
from ._boresight import States, TrackState, __version__
from ._config import Config
from ._errors import BoresightError, BoresightWarning
from ._evaluate import Evaluation, evaluate
from ._particles import batch, link, locate
from ._simulate import Simulation, scenes, simulate
from ._track import track
from ._tracker import Tracker
from ._tracks import Tracks

__all__ = [
    "BoresightError",
    "BoresightWarning",
    "Config",
    "Evaluation",
    "Simulation",
    "States",
    "TrackState",
    "Tracker",
    "Tracks",
    "__version__",
    "batch",
    "evaluate",
    "filters",
    "link",
    "locate",
    "models",
    "scenes",
    "simulate",
    "track",
]
