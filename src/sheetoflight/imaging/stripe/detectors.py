"""The table of detectors: what finds the centre in the light across the line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from sheetoflight.imaging.stripe.centres import Located, Track
from sheetoflight.imaging.stripe.centroid import centroid_centres
from sheetoflight.imaging.stripe.fir import blais_rioux_centres, fir_centres
from sheetoflight.imaging.stripe.gaussian import gaussian_centres
from sheetoflight.imaging.stripe.light import LineLight
from sheetoflight.imaging.stripe.parabola import parabola_centres
from sheetoflight.imaging.stripe.steger import steger_centres
from sheetoflight.imaging.stripe.thin import thin_centres


@dataclass(frozen=True)
class Detector:
    """A way to find the line's centre.

    Parameters
    ----------
    centres : callable
        Centres along a track.
    does : str
        What it does, in a few words.
    """

    centres: Callable[[LineLight, Track], Located]
    does: str


DETECTORS: dict[str, Detector] = {
    "thin": Detector(thin_centres, "binarise and thin, whole pixels: the paper's"),
    "centroid": Detector(centroid_centres, "centre of gravity in a window, background removed"),
    "fir": Detector(fir_centres, "zero of a derivative filter as wide as the line"),
    "blais-rioux": Detector(blais_rioux_centres, "zero of the 4- or 8-tap filter"),
    "parabola": Detector(parabola_centres, "weighted parabola through the logarithm"),
    "gaussian": Detector(gaussian_centres, "least squares of a Gaussian integrated over pixels"),
    "steger": Detector(steger_centres, "ridge of the smoothed light, in any direction"),
}
"""Every detector by the name that users give; ``auto`` chooses among them."""
