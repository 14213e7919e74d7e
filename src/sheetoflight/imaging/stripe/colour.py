"""The laser's colour: found in the picture, and used to see its line among other bright things."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from sheetoflight.imaging.stripe.added import Seen, adds_light
from sheetoflight.imaging.stripe.light import LineLight, light_of, line_light
from sheetoflight.imaging.stripe.linking import linked
from sheetoflight.imaging.stripe.ridges import Ridges, ridges

# Every lens and Bayer pattern leaves some colour at edges, and compression spreads it. Grey must
# show its lines so much better than a colour shows its own before grey is believed.
_GREY_HANDICAP = 4.0
_LONGEST_CHAINS = 3
_LEAST_CHAIN_PX = 6
_BRIGHT_QUANTILE, _FAINT_PART = 0.98, 0.25
_CORE_PX = 15


def laser_light(image_on: NDArray[Any], image_off: NDArray[Any] | None = None) -> LineLight:
    """The light in which the laser's line stands out best.

    A pair, and a grey picture, have one such light, `line_light`. In a single colour picture a
    laser is the purest colour: what one channel has over the larger of the others. White, grey and
    black surfaces have none of it, however contrasting; so long narrow ridges in it are looked for
    in every channel, and in the sum of all three. Where a core is saturated to white the colour has
    a hole, which is closed for finding the line and left open for measuring it.

    Raises
    ------
    InputError
        If a picture is no picture, or the two have different shapes or sample types.
    """
    whole = line_light(image_on, image_off)
    image = np.asarray(image_on)
    if image_off is not None or image.ndim == 2 or image.shape[2] == 1:
        return whole
    coloured = [_pure_colour(image, whole, channel) for channel in range(3)]
    best = max(coloured, key=_evidence)
    return whole if _evidence(whole) > _GREY_HANDICAP * _evidence(best) else best


def _pure_colour(image: NDArray[Any], whole: LineLight, channel: int) -> LineLight:
    samples = image.astype(np.float32)
    others = np.delete(samples, channel, axis=2).max(axis=2)
    pure = samples[..., channel] - others
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (_CORE_PX, _CORE_PX))
    closed = cv2.morphologyEx(pure, cv2.MORPH_CLOSE, kernel)
    pure = np.where(whole.full, closed, pure).astype(np.float32)
    light = light_of(pure, whole.full, image.dtype)
    return replace(light, channel=channel, channels=image)


def _evidence(light: LineLight) -> float:
    """Length times clearness of the three best chains of ridge pixels that add light."""
    if min(light.picture.shape) < _LEAST_CHAIN_PX:
        return 0.0
    found = ridges(light, light.noise_std)
    if len(found) == 0:
        return 0.0
    seed = _FAINT_PART * float(np.quantile(found.strength, _BRIGHT_QUANTILE))
    found = found.taken(found.strength >= seed / 2.0)
    clear = found.strength / found.least
    chains = [
        chain
        for chain in linked(found, seed, _LEAST_CHAIN_PX)
        if adds_light(light, _seen(found.taken(chain)))
    ]
    scores = sorted(len(chain) * float(np.median(clear[chain])) for chain in chains)
    return sum(scores[-_LONGEST_CHAINS:])


def _seen(chain: Ridges) -> Seen:
    across = np.stack([-chain.direction[:, 1], chain.direction[:, 0]], axis=-1)
    return Seen(chain.uv, across, np.full(len(chain), chain.scale), chain.strength)
