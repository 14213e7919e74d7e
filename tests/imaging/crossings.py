"""Pictures of a target that a laser line crosses, drawn without package code.

The target's strip lies in its own plane, and the sheet of light crosses that plane in a straight
line; so the spot on the axis is a point of the strip, seen through the same homography.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np

from tests.imaging.drawing import homography, mapped, strip_albedo

MARKERS = np.array([0.0, 200.0, 400.0])
SHAPE = (270, 400)


@dataclass(frozen=True)
class Crossing:
    """A target and the line across it.

    ``spot_mm`` along the axis; ``slant`` the line's angle from the right angle in the strip's
    plane, rad; ``sigma_mm`` and ``peak`` (grey levels on paper) of its profile; ``behind`` the
    line's shift on the background in px, where it goes on; ``size`` the markers' diameter in mm,
    half the strip's height where ``half_height`` is absent.
    """

    matrix: np.ndarray
    spot_mm: float = 130.0
    slant: float = 0.0
    sigma_mm: float = 1.2
    peak: float = 150.0
    behind: float | None = 25.0
    size: float = 24.0
    half_height: float | None = None
    kind: str = "quadrant"
    paper: float = 90.0
    ink: float = 8.0
    wall: float = 30.0
    blur: float = 0.7
    noise: float = 2.0
    markers: np.ndarray = field(default_factory=MARKERS.copy)
    others: tuple[tuple[float, float], ...] = ()
    """Further lines: place in mm, peak."""
    shape: tuple[int, int] = SHAPE

    @property
    def spot(self) -> np.ndarray:
        """True image point of the spot ``(2,)``."""
        return mapped(self.matrix, np.array([[self.spot_mm, 0.0]]))[0]

    @property
    def along(self) -> np.ndarray:
        """Unit direction of the axis in the picture ``(2,)``."""
        ends = mapped(self.matrix, np.column_stack([self.markers[[0, -1]], [0.0, 0.0]]))
        return (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])

    def drawn(self, laser: bool = True, seed: int = 0, samples: int = 4) -> np.ndarray:
        """The picture ``(H, W)`` uint8."""
        rng = np.random.default_rng([seed, int(laser)])
        light = self._light(laser, samples)
        noisy = light + rng.normal(0.0, self.noise, light.shape)
        return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)

    def pair(self, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Laser off and on."""
        return self.drawn(False, seed), self.drawn(True, seed)

    def _light(self, laser: bool, samples: int) -> np.ndarray:
        height, width = self.shape
        fine = (np.arange(samples) + 0.5) / samples - 0.5
        u = (np.arange(width)[:, None] + fine).ravel().astype(np.float32)
        v = (np.arange(height)[:, None] + fine).ravel().astype(np.float32)
        grid = np.stack(np.meshgrid(u, v), axis=-1)
        # Rows and columns of samples are shifted against each other: no edge runs along them.
        shift = np.mod(np.arange(max(grid.shape[:2])) * 0.6180339887, 1.0) - 0.5
        grid[..., 0] += shift[: grid.shape[0], None] / samples
        grid[..., 1] += shift[None, : grid.shape[1]] / samples
        xy = self._on_strip(grid)
        albedo = strip_albedo(xy, self.markers, self.size, self.kind, self.ink, self.paper)
        if self.half_height is not None:
            albedo[np.abs(xy[..., 1]) > self.half_height] = np.nan
        value = np.where(np.isnan(albedo), self.wall, albedo).astype(np.float32)
        if laser:
            value = value + value / self.paper * self._laser(grid, np.isnan(albedo))
        if self.blur:
            value = cv2.GaussianBlur(value, (0, 0), self.blur * samples)
        return value.reshape(height, samples, width, samples).mean((1, 3))

    def _on_strip(self, grid: np.ndarray) -> np.ndarray:
        inverse = np.linalg.inv(self.matrix)
        w = grid @ inverse[:, :2].T + inverse[:, 2]
        return w[..., :2] / w[..., 2:]

    def _laser(self, grid: np.ndarray, off_strip: np.ndarray) -> np.ndarray:
        """The line's light on paper; behind the strip it goes on at another place, or not."""
        light = np.zeros(grid.shape[:2])
        for place, peak in ((self.spot_mm, self.peak), *self.others):
            on = self._profile(self._on_strip(grid), place)
            if self.behind is None:
                on[off_strip] = 0.0
            else:
                moved = self._on_strip(grid - np.float32(self.behind) * self.along)
                on = np.where(off_strip, self._profile(moved, place), on)
            light += peak * on
        return light

    def _profile(self, xy: np.ndarray, place: float) -> np.ndarray:
        t = (xy[..., 0] - place) * np.cos(self.slant) - xy[..., 1] * np.sin(self.slant)
        return np.exp(-0.5 * (t / self.sigma_mm) ** 2)


def view(
    radius: float = 9.0, tilt: float = 0.2, spin: float = 0.1, roll: float = 0.3,
    centre: tuple[float, float] = (45.0, 60.0),
) -> np.ndarray:  # fmt: skip
    """The homography of a target whose marker 0 (of 24 mm) appears with a radius in px."""
    return homography(radius / 12.0 * 1000.0, 1000.0, centre, tilt, spin, roll)
