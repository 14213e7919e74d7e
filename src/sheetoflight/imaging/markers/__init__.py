"""Finding the collinear target in a picture, to a fraction of a pixel.

::

    grey -> candidates (saddles + rings, or blobs) -> identify -> laser band -> fit -> sighting
"""

from sheetoflight.imaging.markers.order import order_by_fixed_end
from sheetoflight.imaging.markers.search import find_target
from sheetoflight.imaging.markers.sighting import TargetSearch, TargetSighting

__all__ = ["TargetSearch", "TargetSighting", "find_target", "order_by_fixed_end"]
