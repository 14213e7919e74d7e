"""The laser's colour: found in the picture, and used to see its line among other bright things."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from sheetoflight.imaging.stripe.added import Seen, adds_light
from sheetoflight.imaging.stripe.light import LineLight, light_of, line_light
from sheetoflight.imaging.stripe.linking import linked
from sheetoflight.imaging.stripe.ridges import SCALES, Ridges, ridges_at

# Every lens and Bayer pattern leaves some colour at edges, and compression spreads it; and grey
# shows every bright thing, not only what adds light of one colour. It must show its lines so
# much better than a colour shows its own before it is believed.
_GREY_HANDICAP = 8.0
_LONGEST_CHAINS = 3
_LEAST_CHAIN_PX = 12
_BRIGHT_QUANTILE, _FAINT_PART = 0.98, 0.25
_CORE_PX = 15

# What stands out twice as clearly as needed is certain; more is no further sign of a laser.
_CERTAIN = 2.0

# To tell the colour, a picture of this length is as good as a larger one.
_LONGEST_SIDE_PX = 1600


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
    channel = _laser_channel(image, whole)
    return whole if channel is None else _pure_colour(image, whole, channel)


def _laser_channel(image: NDArray[Any], whole: LineLight) -> int | None:
    """The channel whose pure colour shows the best lines; none where grey shows better ones."""
    shrink = -(-max(image.shape) // _LONGEST_SIDE_PX)
    if shrink > 1:
        image = _shrunk(image, shrink)
        whole = line_light(image)
    evidence = [_evidence(_pure_colour(image, whole, channel)) for channel in range(3)]
    best = int(np.argmax(evidence))
    return None if _evidence(whole) > _GREY_HANDICAP * evidence[best] else best


def _shrunk(image: NDArray[Any], by: int) -> NDArray[Any]:
    """Means of blocks of pixels of ``(H, W, 3)``, in the same type of samples."""
    height, width = (size // by * by for size in image.shape[:2])
    samples = image[:height, :width].astype(np.float32)
    means = cv2.resize(samples, (width // by, height // by), interpolation=cv2.INTER_AREA)
    return (np.rint(means) if image.dtype.kind in "ui" else means).astype(image.dtype)


def _pure_colour(image: NDArray[Any], whole: LineLight, channel: int) -> LineLight:
    own, *others = (image[..., k].astype(np.float32) for k in (channel, channel - 1, channel - 2))
    pure = own - np.maximum(*others)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (_CORE_PX, _CORE_PX))
    closed = cv2.morphologyEx(pure, cv2.MORPH_CLOSE, kernel)
    pure = np.where(whole.full, closed, pure).astype(np.float32)
    light = light_of(pure, whole.full, image.dtype)
    return replace(light, channel=channel, channels=image)


def _evidence(light: LineLight) -> float:
    """Length of the three best chains of ridge pixels that add light, in their own widths.

    A laser's line is longer for its width than edges, reflections and strips of other things.
    How bright it is says little: it may fall on a white board beside glossy wood. So each scale
    is asked for its chains, the clearer ones up to a limit counting more, and the best is taken.
    """
    if min(light.picture.shape) < _LEAST_CHAIN_PX or light.noise_std == 0.0:
        return 0.0
    found = [ridges_at(light.picture, scale, light.noise_std) for scale in SCALES]
    return max(_evidence_at(light, one) for one in found)


def _evidence_at(light: LineLight, found: Ridges) -> float:
    if len(found) == 0:
        return 0.0
    seed = _FAINT_PART * float(np.quantile(found.strength, _BRIGHT_QUANTILE))
    found = found.taken(found.strength >= seed / 2.0)
    clear = np.minimum(found.strength / found.least, _CERTAIN)
    chains = sorted(
        linked(found, seed, _LEAST_CHAIN_PX),
        key=lambda chain: -len(chain) * float(np.median(clear[chain])),
    )
    adding = (chain for chain in chains if adds_light(light, _seen(found.taken(chain))))
    best = islice(adding, _LONGEST_CHAINS)
    return sum(len(chain) * float(np.median(clear[chain])) for chain in best) / found.scale


def _seen(chain: Ridges) -> Seen:
    across = np.stack([-chain.direction[:, 1], chain.direction[:, 0]], axis=-1)
    return Seen(chain.uv, across, np.full(len(chain), chain.scale), chain.strength)
