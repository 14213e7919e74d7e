"""A wall as untidy as a workshop's: shapes that must not be taken for markers."""

from __future__ import annotations

import math

import numpy as np

from sheetoflight.simulation.paint import Block, Checker, Disc, Paint

_DARK, _BRIGHT = 0.04, 0.9
_SIZES_MM = (8.0, 45.0)


def clutter(
    half_length: float, half_width: float, count: int, rng: np.random.Generator
) -> tuple[Paint, ...]:
    """Random patches, discs, chequers and lines of text within ``±half_length × ±half_width``.

    Parameters
    ----------
    half_length, half_width : float
        Where they may lie on the wall, mm from its middle.
    count : int
        Number of things; a line of text is one thing of many bars.
    rng : numpy.random.Generator

    Returns
    -------
    tuple of Paint
    """
    paint: list[Paint] = []
    for _ in range(count):
        a, b = (float(rng.uniform(-half, half)) for half in (half_length, half_width))
        paint.extend(_thing(a, b, rng))
    return tuple(paint)


def _thing(a: float, b: float, rng: np.random.Generator) -> list[Paint]:
    size = float(rng.uniform(*_SIZES_MM))
    reflectance = float(rng.choice([_DARK, _BRIGHT, rng.uniform(_DARK, _BRIGHT)]))
    match rng.integers(4):
        case 0:
            width, turn = size * rng.uniform(0.3, 1.0), rng.uniform(0.0, math.pi)
            return [Block(a, b, size, float(width), reflectance, float(turn))]
        case 1:
            return [Disc(a, b, size / 2, reflectance)]
        case 2:
            pitch, fields = size / 2, int(rng.integers(2, 6))
            return [Checker(a, b, (pitch, pitch), (fields, fields), reflectance)]
        case _:
            return _text(a, b, size / 4, reflectance, rng)


def _text(
    a: float, b: float, height: float, reflectance: float, rng: np.random.Generator
) -> list[Paint]:
    """A line of bars of random width, as text looks from afar."""
    bars: list[Paint] = []
    for _ in range(int(rng.integers(6, 14))):
        half = height * float(rng.uniform(0.08, 0.3))
        a += half
        bars.append(Block(a, b, half, height / 2 * float(rng.uniform(0.6, 1.0)), reflectance))
        a += half + height * 0.25
    return bars
