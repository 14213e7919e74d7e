"""The floor that speckle sets to a line's centre, whatever the camera's noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array

_FACTOR = 1.1
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

    def std(self, width: Array) -> Array:
        """Standard uncertainty of centres ``(N,)``, px, of lines of standard deviation `width` px.

        ``1.1 C √(W/p) λ/(2π sin u′)`` for each row of pixels of pitch p: after R. G. Dorsch,
        G. Häusler, J. M. Herrmann, "Laser triangulation: fundamental uncertainty in distance
        measurement", Applied Optics 33(7), 1994; docs/stripe.md shows how it was checked.
        """
        size_px = self.wavelength_nm / _NM_PER_UM * 2.0 * self.aperture / self.pixel_um
        return _FACTOR * self.contrast * np.sqrt(width) * size_px / (2.0 * np.pi)
