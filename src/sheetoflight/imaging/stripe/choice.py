"""Which detector suits a picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.imaging.stripe.centres import Centres
from sheetoflight.imaging.stripe.light import LineLight

# Below this ratio of height to noise a row alone does not hold its centre: the fit's error has
# long tails. Rows together still do.
_LEAST_ROW_SNR = 2.9

_ORDINALS = ("first", "second", "third")


@dataclass(frozen=True)
class Choice:
    """A detector's name, and why it was chosen."""

    detector: str
    reason: str


def chosen_detector(light: LineLight, runs: list[Centres]) -> Choice:
    """The detector for lines that were found, by width, saturation and noise.

    Least squares of a pixel-integrated Gaussian reach the bound of each row, leave saturated
    samples open, and serve lines of 0.5 px as well as of 10. Only where a row's own light hardly
    rises from the noise are neighbouring rows asked too, by smoothing along the line.
    """
    if not runs:
        return Choice("gaussian", "no line found")
    width = float(np.median(np.concatenate([run.width for run in runs])))
    matched = [
        run.amplitude / np.sqrt(run.dark_variance + run.variance_per_level * run.amplitude / 2.0)
        for run in runs
    ]
    snr = float(np.median(np.concatenate(matched)))
    full = _full_share(light, runs)
    seen = (
        "" if light.channel is None else f"pure colour of the {_ORDINALS[light.channel]} channel, "
    )
    seen += f"width {width:.1f} px, peak/noise {snr:.0f}, {100.0 * full:.0f} % of centres saturated"
    if snr * np.sqrt(max(width, 0.5)) < _LEAST_ROW_SNR * np.sqrt(2.0):
        return Choice("steger", f"{seen}: single rows drown in noise, so it smooths along the line")
    return Choice("gaussian", f"{seen}: reaches the bound of each row, saturated samples left open")


def _full_share(light: LineLight, runs: list[Centres]) -> float:
    """Part of the centres at which the sensor is full."""
    uv = np.rint(np.concatenate([run.uv for run in runs])).astype(np.int64)
    height, width = light.full.shape
    columns, rows = np.clip(uv[:, 0], 0, width - 1), np.clip(uv[:, 1], 0, height - 1)
    return float(light.full[rows, columns].mean())
