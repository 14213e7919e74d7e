"""From chains of ridge pixels to rows and columns to fit in, and from fits to unbroken runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter, uniform_filter1d

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.centres import Centres, Track, joined
from sheetoflight.imaging.stripe.gaussian import fitted_centres
from sheetoflight.imaging.stripe.light import LineLight
from sheetoflight.imaging.stripe.noise import UNKNOWN_NOISE, NoiseLaw
from sheetoflight.imaging.stripe.ridges import Ridges

_DIRECTION_PIXELS = 15
_SIDE_PIXELS = 61
_PLATEAU_ROWS = 41

_BORDER_SCALES, _CONTINUED_FROM = 2.0, 9

# A gap of 2 px, seen through defocus and pixels of together 0.76 px, leaves 0.28 of the light in
# the two rows nearest to its middle; a wider one leaves less.
_GAP_LIGHT = 0.35
_GAP_ROWS = 2

# Where rows give way to columns the centres' distance may be this much more than a step's.
_JUMP_PX = 2.0


def centres_along(light: LineLight, ridges: Ridges, chain: NDArray[np.int64]) -> Centres:
    """Centres for all rows or columns that a chain of ridge pixels crosses, in its order."""
    tracks = _tracks(ridges.uv[chain], ridges.pixels[chain], ridges.scale)
    tracks = [_to_the_border(track, light.picture.shape, ridges.scale) for track in tracks]
    centres = joined([fitted_centres(light, track) for track in tracks])
    return replace(centres, good=centres.good & light.wants(centres.uv))


def _to_the_border(track: Track, shape: tuple[int, ...], scale: float) -> Track:
    """The track continued where it ends so near the picture's border that the smoothing, which
    sees beyond it, shows no ridge any more."""
    near = int(np.ceil(_BORDER_SCALES * scale)) + 2
    if len(track.along) < _CONTINUED_FROM:
        return track
    last = shape[0 if track.by_rows else 1] - 1
    forward = track.along[-1] > track.along[0]
    low, high = track.along.min(), track.along.max()
    before = np.arange(0, low) if low <= near else np.empty(0, dtype=np.int64)
    after = np.arange(high + 1, last + 1) if last - high <= near else np.empty(0, dtype=np.int64)
    order = slice(None) if forward else slice(None, None, -1)
    along, across = track.along[order], track.across[order]
    extended = np.concatenate(
        [_continued(along, across, before), across, _continued(along[::-1], across[::-1], after)]
    )
    everything = np.concatenate([before, along, after])[order]

    def padded(values: Array) -> Array:
        return np.pad(values[order], (len(before), len(after)), mode="edge")[order]

    return replace(
        track,
        along=everything,
        across=extended[order],
        slope=padded(track.slope),
        width=padded(track.width),
        amplitude=padded(track.amplitude),
    )


def _continued(along: NDArray[np.int64], across: Array, to: NDArray[np.int64]) -> Array:
    """The straight line through the first centres, read further out."""
    near = slice(0, _CONTINUED_FROM)
    slope, level = np.polyfit(along[near] - along[0], across[near], 1)
    return level + slope * (to - along[0])


def tracks_of(run: Centres) -> list[Track]:
    """Tracks through centres that were found, with what is known of the line there."""
    switches = np.flatnonzero(np.diff(run.by_rows)) + 1
    parts = np.split(np.arange(len(run)), switches)
    return [_known_track(run.taken(part)) for part in parts]


def _known_track(run: Centres) -> Track:
    by_rows = bool(run.by_rows[0])
    along, across = run.uv.T[::-1] if by_rows else run.uv.T
    size = min(_DIRECTION_PIXELS, len(run))
    slope = np.gradient(across, along) if len(run) > 1 else np.zeros(1)
    smooth = uniform_filter1d(median_filter(slope, size, mode="nearest"), size, mode="nearest")
    return Track(
        np.rint(along).astype(np.int64),
        across,
        by_rows,
        np.abs(smooth),
        width=median_filter(run.width, size, mode="nearest"),
        amplitude=median_filter(run.amplitude, size, mode="nearest"),
        law=NoiseLaw(float(run.dark_variance.mean()), float(run.variance_per_level.mean())),
    )


def unbroken(centres: Centres, least_amplitude: float) -> list[Centres]:
    """Runs of good centres, split where the light goes out or the line jumps aside."""
    bright = centres.good & (centres.amplitude > least_amplitude)
    if not bright.any():
        return []
    plateau = _plateau(centres.amplitude, bright)
    lit = bright & (centres.amplitude > _GAP_LIGHT * plateau)
    index = np.flatnonzero(lit)
    step = np.diff(index)
    moved = np.linalg.norm(np.diff(centres.uv[index], axis=0), axis=1)
    # From one row to the next a line of up to 45° moves by √2 at most.
    broken = (step > _GAP_ROWS) | (moved > np.sqrt(2.0) * step + _JUMP_PX)
    runs = np.split(index, np.flatnonzero(broken) + 1)
    return [centres.taken(run) for run in runs]


def _plateau(amplitude: Array, bright: NDArray[np.bool_]) -> Array:
    """Running median of the amplitude of the bright rows, at every row."""
    index = np.flatnonzero(bright)
    smooth = median_filter(amplitude[index], size=min(_PLATEAU_ROWS, len(index)), mode="nearest")
    return np.interp(np.arange(len(amplitude)), index, smooth)


def _tracks(uv: Array, pixels: NDArray[np.int64], width: float) -> list[Track]:
    """Runs of the chain that advance mainly by rows, and those that advance by columns."""
    step = np.gradient(uv, axis=0) if len(uv) > 1 else np.array([[0.0, 1.0]])
    smooth = uniform_filter1d(step, min(_DIRECTION_PIXELS, len(uv)), axis=0, mode="nearest")
    steep = np.abs(smooth[:, 1]) >= np.abs(smooth[:, 0])
    # A straight line at 45° must not change sides at every step.
    steep = median_filter(steep, size=min(_SIDE_PIXELS, len(steep)), mode="nearest")
    switches = np.flatnonzero(np.diff(steep)) + 1
    runs = np.split(np.arange(len(uv)), switches)
    return [_track(uv[run], pixels[run], bool(steep[run[0]]), width) for run in runs]


def _track(uv: Array, pixels: NDArray[np.int64], by_rows: bool, width: float) -> Track:
    """The track of one run; rows or columns that it passes over are filled in."""
    axis = 1 if by_rows else 0
    forward = pixels[-1, axis] >= pixels[0, axis]
    seen, first = np.unique(pixels[:, axis], return_index=True)
    along = np.arange(seen[0], seen[-1] + 1)
    across = np.interp(along, pixels[first, axis], uv[first, 1 - axis])
    step = np.gradient(across) if len(along) > 1 else np.zeros(1)
    slope = uniform_filter1d(step, min(9, len(step)), mode="reflect")
    order = slice(None) if forward else slice(None, None, -1)
    return Track(
        along[order],
        across[order],
        by_rows,
        np.abs(slope[order]),
        width=np.full(len(along), width),
        amplitude=np.ones(len(along)),
        law=UNKNOWN_NOISE,
    )
