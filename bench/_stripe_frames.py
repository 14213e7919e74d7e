"""Drawn frames of a laser line that crosses every column, of a few kinds."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from bench._drawn_stripes import DrawnLine
from bench._stripe_peers import Picture

SEED = 11

_BASE = DrawnLine(width=2.0, amplitude=200.0, noise=2.0, slope_deg=5.0)
KINDS = {
    "w 1": replace(_BASE, width=1.0),
    "w 2": _BASE,
    "w 4": replace(_BASE, width=4.0),
    "35°": replace(_BASE, slope_deg=35.0),
    "faint": replace(_BASE, amplitude=60.0, noise=5.0),
    "faint w 1 35°": replace(_BASE, width=1.0, amplitude=60.0, noise=5.0, slope_deg=35.0),
    "saturated": replace(_BASE, amplitude=500.0),
    "background": replace(_BASE, amplitude=60.0),
}
_BACKGROUND = {"background": 30.0}


@dataclass(frozen=True)
class Frame:
    """A drawn picture and its line."""

    kind: str
    line: DrawnLine
    picture: Picture


def drawn_frames(shape: tuple[int, int], count: int, kinds: Iterable[str] = KINDS) -> list[Frame]:
    """So many frames of each kind, the line at another sub-pixel offset in each."""
    rng = np.random.default_rng(SEED)
    frames = []
    for kind in kinds:
        for offset in rng.uniform(-4.0, 4.0, count):
            line = replace(KINDS[kind], shape=shape, offset=float(offset))
            frames.append(Frame(kind, line, _recorded(line, _BACKGROUND.get(kind, 0.0), rng)))
    return frames


def _recorded(line: DrawnLine, background: float, rng: np.random.Generator) -> Picture:
    """The line over a wide hill of light beside it, as high as `background`, grey levels."""
    height, width = line.shape
    v, u = (np.arange(n)[:, None] / n for n in (height, width))
    hill = background * np.exp(-8.0 * (v - 0.3) ** 2) * np.exp(-8.0 * (u.T - 0.4) ** 2)
    noisy = line.picture + hill + rng.normal(0.0, line.noise, line.shape)
    return np.clip(np.rint(noisy), 0.0, line.full).astype(np.uint8)
