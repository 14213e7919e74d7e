"""The kinds of noise, by number: sizes of them stand in arrays in this order."""

from __future__ import annotations

COMPONENTS = ("pixel", "placement", "marker", "corner", "stripe", "line")
PIXEL, PLACEMENT, MARKER, CORNER, STRIPE, LINE = range(len(COMPONENTS))
