"""boresight: image sequences in, tracks one can trust out.

Positions are (x, y) = (column, row) in pixels, the centre of the top-left pixel is (0, 0); frames count from 0; times are seconds; states
are `[x, vx, y, vy]` in px and px/s, with their covariance.
"""

from ._boresight import __version__
from ._config import Config
from ._errors import BoresightError, BoresightWarning
from ._track import track
from ._tracks import Tracks

__all__ = ["BoresightError", "BoresightWarning", "Config", "Tracks", "__version__", "track"]
