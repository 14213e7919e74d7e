"""Cameras and light planes in the files of other tools: one module a format, one table of them.

::

    file -> text -> document (YAML, XML, JSON) -> opencv | ros | kalibr ┐
                 -> named parameters           -> halcon               ├-> Exchanged
         -> MATLAB variables                   -> bouguet              ┘
                                               -> bouguet_corners -> corner_grid -> Corners
"""

from sheetoflight.io.exchange.bouguet_corners import read_bouguet_corners
from sheetoflight.io.exchange.corner_grid import Corners, read_corners, write_corners
from sheetoflight.io.exchange.exchanged import Exchanged
from sheetoflight.io.exchange.formats import (
    EXCHANGE_FORMATS,
    exchange_format,
    is_calibration,
    read_exchange,
    write_exchange,
)

__all__ = [
    "EXCHANGE_FORMATS",
    "Corners",
    "Exchanged",
    "exchange_format",
    "is_calibration",
    "read_bouguet_corners",
    "read_corners",
    "read_exchange",
    "write_corners",
    "write_exchange",
]
