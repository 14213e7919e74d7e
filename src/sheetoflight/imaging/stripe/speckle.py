"""The floor that speckle sets to a line's centre, whatever the camera's noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array

# Of the exact π^¼ = 1.33 of a whole row's centre of gravity; the weighted fit, and a centre of
# gravity in a window, lose the difference (tests/imaging/stripe/test_speckle.py).
_FACTOR = 1.5
# Coherence area of a round pupil, 4 s²/π, over its coherence length l = 32 s/(3 π²).
_LONG_SPECKLE = 3.0 * np.pi / 8.0
_BLEND = 1.4
# l²/(4π), for speckles s = 1: how much of a narrow line one speckle covers.
_NARROW_LINE = 0.093
_NM_PER_UM = 1000.0


@dataclass(frozen=True)
class Speckle:
    """What decides the speckle of a laser line in the picture.

    Parameters
    ----------
    contrast : float
        Standard deviation of the light over its mean: 1 for a laser on a rough surface, 0.7 where
        the surface depolarises, less with broadband light or a moved line.
    wavelength_nm : float
    aperture : float
        Working f-number of the lens: ``sin u′ = 1/(2 N)``.
    pixel_um : float
        Pixel pitch of the sensor, µm.

    Raises
    ------
    InputError
        If a value is not positive, or the contrast is over 1.
    """

    contrast: float = 1.0
    wavelength_nm: float = 660.0
    aperture: float = 8.0
    pixel_um: float = 3.45

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value > 0):
                raise InputError(f"{name} of the speckle is {value}", "give a positive number")
        if self.contrast > 1.0:
            raise InputError(
                f"the speckle's contrast is {self.contrast}", "a laser's is 1 at the most"
            )

    @property
    def size_px(self) -> float:
        """Speckle size ``λ/(2 sin u′) = λ N``, px."""
        return self.wavelength_nm / _NM_PER_UM * self.aperture / self.pixel_um

    def std(self, width: Array) -> Array:
        """Standard uncertainty of centres ``(N,)``, px, of lines of standard deviation `width` px.

        ``1.5 C √(W/p′) λ/(2π sin u′) (1 + 0.093 s²/W²)^(−¾)`` with W the standard deviation of the
        profile, s the speckle size λ/(2 sin u′), and p′ the height over which a row of pixels
        averages: ``p′^1.4 = p^1.4 + (1.18 s)^1.4``, the pixel's pitch p where speckles are small.
        The last factor is for lines not much wider than a speckle. For the Gaussian fit and the
        centre of gravity; at s = p it reads 1.1 C √(W/p) λ/(2π sin u′), after R. G. Dorsch,
        G. Häusler, J. M. Herrmann, "Laser triangulation: fundamental uncertainty in distance
        measurement", Applied Optics 33(7), 1994. Good to 15 % for speckles of 0.5 to 2 px.
        A derivative filter (fir) errs 1.4 times as much. Neighbours less than s apart err alike.
        """
        size = self.size_px
        height = (1.0 + (_LONG_SPECKLE * size) ** _BLEND) ** (1.0 / _BLEND)
        narrow = (1.0 + _NARROW_LINE * (size / width) ** 2) ** -0.75
        limit = self.contrast * 2.0 * size / (2.0 * np.pi)
        return _FACTOR * limit * np.sqrt(width / height) * narrow
