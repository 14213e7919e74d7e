"""Finding the spot where the sheet of light crosses the collinear target.

::

    sighting -> axis -> band along it (paper, light) -> search -> fit -> spot on the axis
"""

from sheetoflight.imaging.crossing.outcome import SpotSearch, SpotSighting
from sheetoflight.imaging.crossing.spot import find_spot

__all__ = ["SpotSearch", "SpotSighting", "find_spot"]
