"""Reflections of the laser line, told from the line itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.centres import Centres

# A reflection is much shorter than what it reflects, and much fainter or of another width, for
# a curved surface spreads the light. A second laser's line is neither.
_MUCH_LONGER = 4.0
_MUCH_FAINTER, _OTHER_WIDTH = 0.5, 2.0
_LEAST_BESIDE = 0.9
_BIN_PX = 4.0

# Pieces of one line go on in each other's direction, over gaps no longer than the longer of them.
_END_CENTRES = 25
_LEAST_COSINE = np.cos(np.radians(20.0))
_ASIDE_PX, _ASIDE_OF_GAP = 1.0, 0.1


@dataclass(frozen=True, eq=False)
class _Line:
    """The centres ``(N, 2)`` of one line, in one piece or several, and its typical profile."""

    uv: Array
    amplitude: float
    width: float

    @property
    def length(self) -> float:
        return float(np.linalg.norm(np.ptp(self.uv, axis=0)))


def without_reflections(runs: list[Centres]) -> list[Centres]:
    """The runs that can be a laser's line at first hand.

    A sheet of light lights each of its rays once. In the picture the rays run across the line, so
    what lies beside a much longer line is either another laser's line, and then much like it, or
    light on its second way. The pieces of a broken line follow each other instead.

    Parameters
    ----------
    runs : list of Centres
    """
    if len(runs) < 2:
        return runs
    of_run = _lines(runs)
    lines = {int(k): _together([runs[i] for i in np.flatnonzero(of_run == k)]) for k in of_run}
    return [
        run
        for run, own in zip(runs, of_run, strict=True)
        if not any(
            line.length >= _MUCH_LONGER * lines[int(own)].length and _reflects(line, run)
            for line in lines.values()
        )
    ]


def _reflects(line: _Line, run: Centres) -> bool:
    """Whether a run lies beside a line and is unlike it."""
    faint = np.median(run.amplitude) < _MUCH_FAINTER * line.amplitude
    wider = float(np.median(run.width)) / line.width
    unlike = faint or not 1.0 / _OTHER_WIDTH < wider < _OTHER_WIDTH
    if not unlike:
        return False
    centre = line.uv.mean(axis=0)
    axis = np.linalg.svd(line.uv - centre, full_matrices=False)[2][0]
    seen = np.floor((line.uv - centre) @ axis / _BIN_PX)
    own = np.floor((run.uv - centre) @ axis / _BIN_PX)
    return float(np.mean(np.isin(own, seen))) >= _LEAST_BESIDE


def _lines(runs: list[Centres]) -> NDArray[np.int64]:
    """Number ``(R,)`` of the line that each run belongs to."""
    points, outwards = _ends(runs)
    offset = points[None] - points[:, None]
    gap = np.linalg.norm(offset, axis=-1)
    ahead = np.einsum("ijk,ik->ij", offset, outwards)
    aside = np.sqrt(np.maximum(gap**2 - ahead**2, 0.0))
    of_end = np.repeat(np.arange(len(runs)), 2)
    length = np.array([_together([run]).length for run in runs])[of_end]
    width = np.array([np.median(run.width) for run in runs])[of_end]
    near = _ASIDE_PX + np.minimum(width[:, None], width) + _ASIDE_OF_GAP * gap
    follow = (gap <= np.maximum(length[:, None], length)) & (ahead > 0.0) & (ahead.T > 0.0)
    follow &= (np.maximum(aside, aside.T) <= near) & (outwards @ outwards.T <= -_LEAST_COSINE)
    line = np.arange(len(runs))
    for first, second in of_end[np.argwhere(follow)]:
        line[line == line[second]] = line[first]
    return line


def _ends(runs: list[Centres]) -> tuple[Array, Array]:
    """Points ``(2 R, 2)`` and unit directions outwards of both ends of each run."""
    points, outwards = [], []
    for run in runs:
        for uv in (run.uv[:_END_CENTRES], run.uv[: -_END_CENTRES - 1 : -1]):
            along = np.linalg.svd(uv - uv.mean(axis=0), full_matrices=False)[2][0]
            points.append(uv[0])
            outwards.append(along * np.sign(along @ (uv[0] - uv[-1])))
    return np.array(points), np.array(outwards)


def _together(runs: list[Centres]) -> _Line:
    amplitude = np.median(np.concatenate([run.amplitude for run in runs]))
    width = np.median(np.concatenate([run.width for run in runs]))
    return _Line(np.concatenate([run.uv for run in runs]), float(amplitude), float(width))
