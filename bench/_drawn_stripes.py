"""Pictures of straight laser lines with known centres, and the Cramér–Rao bound of their pixels.

The light is integrated over each pixel's square by its own closed form, which no detector uses:
the square seen from a line at angle θ is a box of width |cos θ| convolved with one of |sin θ|,
so the integral is a second difference of the Gaussian's second antiderivative.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from sheetoflight.geometry.directions import Array

DARK_LEVEL = 20.0
_FLAT = 1e-6
_VISIBLE_WIDTHS = 2.0


@dataclass(frozen=True)
class DrawnLine:
    """A straight line through a picture.

    Parameters
    ----------
    width : float
        Standard deviation of its profile, px, before the pixels.
    amplitude : float
        Height of its profile, grey levels, before the pixels.
    noise : float
        Standard deviation of the normal noise, grey levels.
    slope_deg : float
        Angle between the line and the picture's rows.
    shape : (int, int)
        Rows and columns.
    offset : float
        Distance of the line from the picture's middle, px.
    full : float
        Where the sensor is full, grey levels.
    """

    width: float
    amplitude: float
    noise: float
    slope_deg: float = 0.0
    shape: tuple[int, int] = (160, 240)
    offset: float = 0.0
    full: float = 255.0

    @property
    def across(self) -> Array:
        """Unit vector across the line."""
        angle = np.radians(self.slope_deg)
        return np.array([-np.sin(angle), np.cos(angle)])

    def distances(self, uv: Array) -> Array:
        """Signed distances of image points ``(N, 2)`` from the line, px."""
        height, width = self.shape
        middle = np.array([(width - 1) / 2.0, (height - 1) / 2.0])
        return (uv - middle) @ self.across - self.offset

    @property
    def by_rows(self) -> bool:
        """Whether it crosses more rows than columns."""
        return bool(np.abs(self.across[0]) > np.abs(self.across[1]))

    @property
    def crossed(self) -> NDArray[np.int64]:
        """The rows (columns, where it runs along the rows) that it crosses inside the picture."""
        axis = 0 if self.by_rows else 1
        middle = (np.array(self.shape[::-1]) - 1.0) / 2.0
        steps = np.arange(self.shape[axis]) - middle[1 - axis]
        along, across = self.across[1 - axis], self.across[axis]
        place = (self.offset - steps * along) / across
        return np.flatnonzero(np.abs(place) <= middle[axis] + 0.5)

    def clipped(self, share: float) -> DrawnLine:
        """The same line so bright that the sensor is full over a share of its visible width,
        ± 2 standard deviations."""
        over = np.exp(0.5 * (_VISIBLE_WIDTHS * share) ** 2)
        return replace(self, amplitude=float(over) * (self.full - DARK_LEVEL))

    @property
    def light(self) -> Array:
        """Noise-free light ``(H, W)`` over the dark level, grey levels."""
        rows, columns = np.indices(self.shape)
        uv = np.stack([columns.ravel(), rows.ravel()], axis=-1).astype(float)
        t = self.distances(uv).reshape(self.shape)
        return self.amplitude * _pixel_mean(t, self.width, np.abs(self.across))

    @property
    def picture(self) -> Array:
        """Noise-free picture ``(H, W)``, grey levels."""
        return self.light + DARK_LEVEL

    def recorded(self, rng: np.random.Generator) -> NDArray[np.uint8]:
        """An 8-bit picture with noise."""
        noisy = self.picture + rng.normal(0.0, self.noise, self.shape)
        return np.clip(np.rint(noisy), 0, min(self.full, 255.0)).astype(np.uint8)

    @property
    def formula_bound(self) -> float:
        """``1.062 √w σ/A`` (docs/stripe.md) for one row or column, across the line, px."""
        turned = max(np.abs(self.across))
        return float(1.062 * np.sqrt(self.width * turned) * self.noise / self.amplitude)

    @property
    def pixel_bound(self) -> float:
        """The bound of the pixels of one row or column, all but the centre known, px.

        The mean over the sub-pixel phases of the information on the centre's distance; rounding to
        whole grey levels adds 1/12 to the noise's variance.
        """
        projected = np.abs(self.across)
        step = projected.max()
        phases = np.linspace(-0.5, 0.5, 40, endpoint=False)[:, None]
        t = (np.arange(-60, 61) + phases) * step
        eps = 1e-4
        slope = (
            _pixel_mean(t + eps, self.width, projected)
            - _pixel_mean(t - eps, self.width, projected)
        ) / (2.0 * eps)
        information = np.sum((self.amplitude * slope) ** 2, axis=1).mean()
        return float(np.sqrt((self.noise**2 + 1.0 / 12.0) / information))


def _pixel_mean(t: Array, w: float, projected: Array) -> Array:
    """Mean of ``exp(−t²/2w²)`` over the pixels whose centres lie at distances `t`."""
    small, large = sorted(float(p) for p in projected)
    if small < _FLAT:
        return (_first(t + large / 2, w) - _first(t - large / 2, w)) / large
    inner, outer = (large - small) / 2.0, (large + small) / 2.0
    total = _second(t + outer, w) - _second(t + inner, w)
    return (total - _second(t - inner, w) + _second(t - outer, w)) / (large * small)


def _first(t: Array, w: float) -> Array:
    """Antiderivative of ``exp(−t²/2w²)``."""
    return w * np.sqrt(2.0 * np.pi) * ndtr(t / w)


def _second(t: Array, w: float) -> Array:
    """Antiderivative of `_first`."""
    return t * _first(t, w) + w * w * np.exp(-0.5 * (t / w) ** 2)
