"""A laser adds light: what is darker in any colour than its surroundings is something else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.light import LineLight

_SIDE_WIDTHS, _SIDE_PX = 3.0, 2.0
_LEAST_OWN, _MOST_TAKEN = 0.4, 0.5


@dataclass(frozen=True)
class Seen:
    """A line as far as it is known: points ``(N, 2)``, unit directions across it ``(N, 2)``, width
    in px and height in grey levels ``(N,)``."""

    uv: Array
    across: Array
    width: Array
    height: Array


def adds_light(light: LineLight, line: Seen) -> bool:
    """Whether a line found in one channel's pure colour is brighter than both its sides.

    An edge, a shadow or a stripe of paint can show more of a colour by reflecting less of the
    others; a bright thread is bright in all channels. The laser's line must rise over the mean of
    both sides in its own channel, and there clearly more than in the others. These may fall a
    little: a camera's colour correction subtracts some of each channel from the others.
    """
    if light.channels is None or light.channel is None:
        return True
    reach = (_SIDE_WIDTHS * line.width + _SIDE_PX)[:, None] * line.across
    beside = [_read(light.channels, line.uv + sign * reach) for sign in (-1.0, 1.0)]
    rise = np.median(_read(light.channels, line.uv) - (beside[0] + beside[1]) / 2.0, axis=0)
    own, others = rise[light.channel], np.delete(rise, light.channel)
    least = _LEAST_OWN * float(np.median(line.height))
    return bool(min(own, own - others.max()) > least and others.min() > -_MOST_TAKEN * own)


def _read(channels: Array, uv: Array) -> Array:
    """The nearest pixels ``(N, 3)``; the border is continued."""
    height, width = channels.shape[:2]
    columns = np.clip(np.rint(uv[:, 0]).astype(np.int64), 0, width - 1)
    rows = np.clip(np.rint(uv[:, 1]).astype(np.int64), 0, height - 1)
    return channels[rows, columns].astype(float)
