"""The kinds of noise, by number: sizes of them stand in arrays in this order."""

from __future__ import annotations

COMPONENTS = ("pixel", "placement", "marker", "corner", "stripe", "line", "shape")
PIXEL, PLACEMENT, MARKER, CORNER, STRIPE, LINE, SHAPE = range(len(COMPONENTS))
