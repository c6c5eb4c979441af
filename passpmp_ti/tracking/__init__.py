"""From returns that may move to objects, and from objects to Gaussian tracks (filterpy)."""

from passpmp_ti.tracking.forecast import Forecast
from passpmp_ti.tracking.pursuit import follow
from passpmp_ti.tracking.sighting import Sighting
from passpmp_ti.tracking.tracks import Tracks

__all__ = ["Forecast", "Sighting", "Tracks", "follow"]
