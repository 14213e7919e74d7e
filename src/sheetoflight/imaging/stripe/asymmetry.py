"""What different surroundings on a line's two sides do to the ridge of its smoothed light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.centres import Track
from sheetoflight.imaging.stripe.light import Picture

# Where the surroundings are read, in widths of line and smoothing together.
_NEAR, _FAR = np.linspace(2.5, 3.5, 5), np.linspace(5.0, 6.0, 5)
_ROWS = 61
_CLEAR = 5.0  # standard deviations
_MOST_ASYMMETRY = 0.8
# Half width of a bar over the standard deviation of the Gaussian that fits it best: where
# erf(x/√2)²/x is largest.
_BAR_HALF_WIDTHS = 1.400


@dataclass(frozen=True)
class Surroundings:
    """How the light differs from one side of a line to the other, along the direction across it.

    Parameters
    ----------
    step : (N,) array
        Sudden difference, grey levels.
    slope : (N,) array
        Steady growth, grey levels per px.
    """

    step: Array
    slope: Array

    def pull(self, track: Track, curvature: Array, scale: float) -> Array:
        """How far the ridge is moved ``(N,)``, px.

        A slope is the first derivative that the line's own must cancel: slope over curvature. A
        bar of half width w with the levels 0 and a beside it, as parts of its height, is moved
        by ``−(σ²/2w) ln(1 − a)`` towards the brighter side (Steger 1998 on asymmetrical bars).
        """
        # The height counts from the mean of both sides, the bar's from the darker one.
        height = track.amplitude + np.abs(self.step) / 2.0
        a = np.clip(np.abs(self.step) / height, 0.0, _MOST_ASYMMETRY)
        half_width = _BAR_HALF_WIDTHS * track.width
        by_step = -(scale**2) / (2.0 * half_width) * np.log(1.0 - a) * np.sign(self.step)
        with np.errstate(divide="ignore", invalid="ignore"):
            by_slope = np.nan_to_num(-self.slope / curvature, posinf=0.0, neginf=0.0)
        return by_step + np.clip(by_slope, -track.width, track.width)


def surroundings(
    picture: Picture, track: Track, uv: Array, across: Array, scale: float
) -> Surroundings:
    """The surroundings of ridge points ``(N, 2)`` with unit directions across them ``(N, 2)``.

    Read near to the line and twice as far from it: a slope doubles on the way, a step does not.
    Medians of many rows; what is not clear in their noise is taken as none.
    """
    reach = np.hypot(track.width, scale)
    size = min(_ROWS, len(uv))
    # The direction across may turn by 180° between neighbours; the sides keep the picture's order.
    turned = np.where(across[:, 0 if track.by_rows else 1] < 0.0, -1.0, 1.0)

    def difference(distances: Array) -> Array:
        sides = [
            _median_inside(picture, uv[:, None] + (s * reach[:, None] * distances)[..., None] * n)
            for s, n in ((-1.0, across[:, None]), (1.0, across[:, None]))
        ]
        found = np.nan_to_num(sides[1] - sides[0]) * turned
        return median_filter(found, size, mode="nearest") * turned

    near, far = difference(_NEAR), difference(_FAR)
    noise = float(track.law.std(np.zeros(1))[0]) * np.sqrt(np.pi / len(_NEAR) / size)
    places = 2.0 * reach * np.array([[_NEAR.mean()], [_FAR.mean()]])
    slope = (far - near) / (places[1] - places[0])
    slope = np.where(np.abs(far - near) > _CLEAR * np.sqrt(2.0) * noise, slope, 0.0)
    step = near - slope * places[0]
    least = np.where(slope == 0.0, 1.0, 3.0) * _CLEAR * noise
    return Surroundings(np.where(np.abs(step) > least, step, 0.0), slope)


def _median_inside(picture: Picture, uv: Array) -> Array:
    """Medians ``(N,)`` of the nearest pixels' light at points ``(N, M, 2)``, NaN where one of the
    points lies outside the picture."""
    height, width = picture.shape
    columns, rows = np.rint(uv[..., 0]).astype(np.int64), np.rint(uv[..., 1]).astype(np.int64)
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    light = picture[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)].astype(float)
    return np.where(inside.all(axis=1), np.median(light, axis=1), np.nan)
