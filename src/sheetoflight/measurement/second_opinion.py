"""Rod and board, each solved alone and compared."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from sheetoflight.errors import UntrustworthyError
from sheetoflight.geometry.directions import Array
from sheetoflight.measurement.agreement import (
    Differences,
    agreements,
    chi_squared,
    scale_difference,
    sheet_agreement,
)
from sheetoflight.model.board_views import LinePixels
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.observations import Observations, no_views
from sheetoflight.model.rig import Rig
from sheetoflight.model.second_opinion import Kind, Opinion, SecondOpinion

_STEPS = 5
"""Pixels compared in a sheet: those nearest to the nodes of a grid of so many by so many."""


@dataclass(frozen=True)
class _Evidence:
    """One kind's views, those of them that tell of the camera alone, and its lasers."""

    kind: Kind
    every: Observations
    camera: Observations
    lasers: np.ndarray

    @property
    def views(self) -> int:
        return sum(self.every.counts().values())


def second_opinion(rig: Rig, alone: Callable[[Rig], Calibration]) -> SecondOpinion | None:
    """Solve rod and board each by itself, and compare what both determine.

    Parameters
    ----------
    rig : Rig
    alone : callable
        Calibrates a rig.

    Returns
    -------
    SecondOpinion or None
        None where there is only one kind of evidence.

    Raises
    ------
    InputError
        If the views cannot be adjusted.
    """
    rod, board = _rod(rig), _board(rig)
    if not (rod.views and board.views):
        return None
    first, one = _solved(rod, rig, alone)
    second, other = _solved(board, rig, alone)
    if one is None or other is None:
        return SecondOpinion(first, second)
    found = Differences(one, other, rig.camera is not None)
    total = chi_squared(found)
    sheets = [sheet_agreement(found, _pixels(rig, laser), laser) for laser in found.sheets]
    return SecondOpinion(
        rod=first,
        board=second,
        parameters=agreements(found),
        chi2=total.value,
        degrees_of_freedom=total.size,
        noise_freedom=total.freedom,
        odds=total.odds,
        sheets=tuple(sheet for sheet in sheets if sheet),
        scale=scale_difference(found),
    )


def _rod(rig: Rig) -> _Evidence:
    seen = rig.observations
    spots = seen.crossing.seen[:, len(rig.target.markers_mm) :].any(axis=0)
    lasers = np.union1d(seen.plane.lasers, np.flatnonzero(spots)).astype(int)
    every = Observations(seen.camera, seen.plane, seen.crossing)
    return _Evidence("rod", every, Observations(seen.camera), lasers)


def _board(rig: Rig) -> _Evidence:
    views = rig.observations.board
    lasers = np.unique(views.line.laser).astype(int)
    unlit = Observations(board=replace(views, line=LinePixels()))
    return _Evidence("board", Observations(board=views), unlit, lasers)


def _solved(
    evidence: _Evidence, rig: Rig, alone: Callable[[Rig], Calibration]
) -> tuple[Opinion, Calibration | None]:
    """What the evidence determines: all that it shows, or the camera, or nothing."""
    attempts = [_with_lasers(replace(rig, observations=evidence.every), evidence.lasers)]
    if evidence.camera.counts() and rig.camera is None and len(evidence.lasers):
        attempts.append(replace(rig, observations=evidence.camera, lasers=()))
    refusals: list[str] = []
    for attempt in attempts:
        try:
            found = alone(attempt)
        except UntrustworthyError as refusal:
            refusals.append(str(refusal))
            continue
        known = (*(("camera",) if rig.camera is None else ()), *found.lasers)
        return Opinion(evidence.kind, evidence.views, known, "".join(refusals[:1])), found
    return Opinion(evidence.kind, evidence.views, (), refusals[0]), None


def _with_lasers(rig: Rig, lasers: np.ndarray) -> Rig:
    """The rig with some of its lasers only, all that its views show, and these counted anew."""
    seen, markers = rig.observations, len(rig.target.markers_mm)
    place = np.full(len(rig.lasers), -1)
    place[lasers] = np.arange(len(lasers))
    crossing, line = seen.crossing, seen.board.line
    columns = np.concatenate([np.arange(markers), markers + lasers])
    if len(crossing):
        std = None if crossing.std is None else crossing.std[:, columns]
        crossing = replace(crossing, uv=crossing.uv[:, columns], std=std)
    else:
        crossing = no_views(markers)
    observations = replace(
        seen,
        plane=replace(seen.plane, laser=place[seen.plane.lasers]),
        crossing=crossing,
        board=replace(seen.board, line=replace(line, laser=place[line.laser])),
    )
    names = tuple(rig.lasers[k] for k in lasers)
    return replace(rig, lasers=names, observations=observations)


def _pixels(rig: Rig, laser: str) -> Array:
    """Image points ``(N, 2)`` spread over where a laser's sheet was seen, px."""
    number, seen = rig.lasers.index(laser), rig.observations
    lying = seen.plane.uv[seen.plane.lasers == number].reshape(-1, 2)
    spots = seen.crossing.uv[:, len(rig.target.markers_mm) + number :][:, :1].reshape(-1, 2)
    line = seen.board.line
    every = np.concatenate([lying, spots, line.uv[line.laser == number]])
    every = every[np.isfinite(every).all(axis=1)]
    across, down = np.linspace(every.min(axis=0), every.max(axis=0), _STEPS).T
    nodes = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    nearest = [int(np.argmin(np.sum((every - node) ** 2, axis=1))) for node in nodes]
    return every[sorted(set(nearest))]
