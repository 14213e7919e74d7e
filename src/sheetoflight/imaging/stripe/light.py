"""The laser's light in a picture: background removed, channels combined, noise known."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from sheetoflight.errors import InputError

Picture = NDArray[np.float32]

# Response of this mask to white noise of standard deviation 1 is 6; to a plane or a quadric it
# is 0 (Immerkær, "Fast noise variance estimation", CVIU 64(2), 1996).
_NOISE_MASK = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32) / 6.0
# Mean of the lower 60 % of the absolute values of normal noise of standard deviation 1:
# 2 (φ(0) − φ(0.8416)) / 0.6. As robust as the median needs to be here, and not bound to the few
# values that the response to whole grey levels takes.
_CALM_PART, _CALM_MEAN = 0.6, 0.3966
_NOISE_SAMPLES = 200_000
_QUANTISATION_STD = 1.0 / np.sqrt(12.0)
_FLOAT_NOISE_FLOOR = 1e-4
_BACKGROUND_SHRINK = 8


@dataclass(frozen=True)
class LineLight:
    """One channel that shows the laser line.

    Parameters
    ----------
    picture : (H, W) float32 array
        Light in grey levels: the difference of on and off, or the picture itself.
    full : (H, W) bool array
        Pixels at which the sensor was full: the light there was at least what it shows.
    noise_std : float
        Standard deviation of the noise away from the line, grey levels.
    least_std : float
        What rounding to whole grey levels alone gives, grey levels.
    differenced : bool
        Whether the background has been taken away by a picture without the laser.
    wanted : (H, W) bool array, optional
        Where lines are looked for; everywhere where absent.
    channel : int, optional
        The channel whose pure colour this is; absent for grey and for the sum of all channels.
    channels : (H, W, 3) array, optional
        The picture in all its channels, where `picture` is the pure colour of one.
    background : (H, W) float32 array, optional
        What has been taken away, grey levels.
    """

    picture: Picture
    full: NDArray[np.bool_]
    noise_std: float
    least_std: float
    differenced: bool
    wanted: NDArray[np.bool_] | None = None
    channel: int | None = None
    channels: NDArray[Any] | None = None
    background: Picture | None = None

    def wants(self, uv: NDArray[Any]) -> NDArray[np.bool_]:
        """Whether lines are looked for at image points ``(N, 2)``, px."""
        if self.wanted is None:
            return np.ones(len(uv), dtype=bool)
        height, width = self.wanted.shape
        columns, rows = np.rint(uv).astype(np.int64).T
        return self.wanted[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)]


def line_light(image_on: NDArray[Any], image_off: NDArray[Any] | None = None) -> LineLight:
    """The light of the laser in ``(H, W)`` or ``(H, W, 3)`` pictures, with and without laser.

    A colour picture is reduced to the weighted sum of its channels that follows the colour of
    its contrast: no weight is negative, so a core that is saturated to white stays a line.

    Raises
    ------
    InputError
        If a picture is no picture, or the two have different shapes or sample types.
    """
    on = _checked(image_on, "the picture with the laser on")
    off = None if image_off is None else _checked(image_off, "the picture with the laser off")
    if off is not None:
        _check_pair(on, off)
    full = _full_pixels(on)
    light = on.astype(np.float32)
    if off is None:
        return light_of(
            light if light.ndim == 2 else light @ _weights(light, False), full, on.dtype
        )
    background = off.astype(np.float32)
    light = light - background
    if light.ndim == 3:
        weights = _weights(light, differenced=True)
        light, background = light @ weights, background @ weights
    return replace(light_of(light, full, on.dtype, differenced=True), background=background)


def light_of(
    picture: Picture, full: NDArray[np.bool_], dtype: np.dtype[Any], differenced: bool = False
) -> LineLight:
    """One channel ``(H, W)`` of a picture with samples of a type, its noise estimated."""
    least = _rounding_std(picture, dtype, differenced)
    return LineLight(
        picture=np.ascontiguousarray(picture),
        full=full,
        noise_std=max(least, _noise_std(picture, full)),
        least_std=least,
        differenced=differenced,
    )


def local_background(picture: Picture) -> Picture:
    """Median of the surroundings (some 40 px) of every pixel of ``(H, W)``."""
    height, width = picture.shape
    small = cv2.resize(
        picture,
        (max(1, width // _BACKGROUND_SHRINK), max(1, height // _BACKGROUND_SHRINK)),
        interpolation=cv2.INTER_AREA,
    )
    smooth = cv2.medianBlur(small, 5)
    return cv2.resize(smooth, (width, height), interpolation=cv2.INTER_LINEAR).astype(np.float32)


def _checked(image: NDArray[Any], what: str) -> NDArray[Any]:
    image = np.asarray(image)
    if image.ndim == 3 and image.shape[2] == 1:
        image = image[..., 0]
    colour = image.ndim == 3 and image.shape[2] == 3
    if image.size == 0 or not (image.ndim == 2 or colour):
        raise InputError(
            f"{what} has shape {image.shape}, expected (H, W) or (H, W, 3)",
            "give a grey or a colour picture; drop a transparency channel",
        )
    if image.dtype.kind not in "uif":
        raise InputError(
            f"{what} has samples of type {image.dtype}, expected whole or real numbers",
            "give uint8, uint16 or float samples",
        )
    if image.dtype.kind == "f" and not np.isfinite(image).all():
        raise InputError(
            f"{what} holds {int((~np.isfinite(image)).sum())} samples that are not finite",
            "replace them before looking for the line",
        )
    return image


def _check_pair(on: NDArray[Any], off: NDArray[Any]) -> None:
    if on.shape != off.shape:
        raise InputError(
            f"the picture with the laser on has shape {on.shape}, the one with it off {off.shape}",
            "give two pictures of the same size and the same channels",
        )
    if on.dtype != off.dtype:
        raise InputError(
            f"the picture with the laser on has samples of type {on.dtype}, "
            f"the one with it off {off.dtype}",
            "give two pictures of the same type, so that grey levels can be subtracted",
        )


def _full_pixels(on: NDArray[Any]) -> NDArray[np.bool_]:
    """Pixels at the end of the scale.

    Cameras of 10 or 12 bits fill 16-bit pictures in part, so the end of the scale is the
    largest value there is, if a flat top shows that it was a stop: noise alone does not bring
    several neighbours to exactly the same largest value.
    """
    top = on.max()
    at_top = on == top
    if at_top.ndim == 3:
        at_top = at_top[..., 0] | at_top[..., 1] | at_top[..., 2]
    neighbours = at_top[:, 1:] & at_top[:, :-1]
    is_stop = int(neighbours.sum()) >= 3 and top > on.min()
    return at_top if is_stop else np.zeros_like(at_top)


def _weights(channels: NDArray[np.float32], differenced: bool) -> NDArray[np.float32]:
    """Weights ``(3,)`` of channels ``(H, W, 3)`` that follow the colour of the contrast."""
    contrast = np.empty(3)
    for index in range(3):
        channel = np.ascontiguousarray(channels[..., index])
        excess = channel if differenced else channel - local_background(channel)
        brightest = max(1, excess.size // 1000)
        contrast[index] = np.partition(excess.ravel(), -brightest)[-brightest:].mean()
    contrast = np.maximum(contrast, 0.0)
    if not contrast.any():
        contrast[:] = 1.0
    return (contrast / contrast.sum()).astype(np.float32)


def _rounding_std(picture: Picture, dtype: np.dtype[Any], differenced: bool) -> float:
    if dtype.kind == "f":
        return _FLOAT_NOISE_FLOOR * float(picture.max() - picture.min())
    return float(_QUANTISATION_STD * (np.sqrt(2.0) if differenced else 1.0))


def _noise_std(picture: Picture, full: NDArray[np.bool_]) -> float:
    """Robust noise of the picture; 0 where there is nothing to estimate it from."""
    if min(picture.shape) < 3:
        return 0.0
    response = np.abs(cv2.filter2D(picture, cv2.CV_32F, _NOISE_MASK)[1:-1, 1:-1])
    # Where the sensor is empty or full there is no noise to see.
    usable = (picture > picture.min()) & ~full
    response = response[usable[1:-1, 1:-1]]
    if response.size == 0:
        return 0.0
    sample = response[:: max(1, response.size // _NOISE_SAMPLES)]
    count = max(1, int(_CALM_PART * sample.size))
    return float(np.partition(sample, count - 1)[:count].mean()) / _CALM_MEAN
