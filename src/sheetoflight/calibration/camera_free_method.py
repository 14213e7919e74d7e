"""Lengths on the sheet from targets lying in it, and nothing else.

Three targets in the sheet that are not parallel fix its metric homography to the image: five
numbers, and three for each target's pose in the sheet. No camera is calibrated and no lens
corrected for. Start in closed form, refined by maximum likelihood.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sheetoflight.calibration.components import COMPONENTS, PIXEL
from sheetoflight.calibration.noise import chi2_limit, noise_model
from sheetoflight.calibration.sheet_map_closed_form import sheet_map
from sheetoflight.calibration.usable_views import refuse_unusable_views
from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.estimation.block_least_squares import Block, Solution, scaled_inverse, solve
from sheetoflight.estimation.variance_components import ReducedModel, contrasts, reduced_model
from sheetoflight.geometry.directions import Array
from sheetoflight.model.calibration import Residuals, SheetCalibration, ViewResiduals
from sheetoflight.model.covariance import (
    SHEET_MAP_PARTS,
    Covariance,
    NoiseComponents,
    Source,
)
from sheetoflight.model.observations import TargetViews
from sheetoflight.model.rig import Rig
from sheetoflight.model.sheet_map import SheetMap

_LINEAR_LIMIT = 0.1
"""Greatest relative standard uncertainty of a scale at which a covariance describes it."""

_STANDS_OUT = 4.0


@dataclass(frozen=True)
class _State:
    """A sheet map, and x, y in mm and ψ of every target ``(N, 3)``."""

    sheet: SheetMap
    poses: Array


class _MapAdjustment:
    """The least-squares problem of one sheet, for `estimation.block_least_squares.solve`."""

    shared_size = len(SHEET_MAP_PARTS)

    def __init__(self, positions: Array, views: TargetViews, std: Array) -> None:
        self.positions = positions
        self.views = views
        self.weights = np.repeat(np.where(views.seen, 1.0 / std, 0.0), 2, axis=1)

    def points(self, state: _State) -> tuple[Array, Array]:
        """Markers ``(N, M, 2)`` in the sheet and the targets' directions ``(N, 1, 2)``, mm."""
        turn = state.poses[:, None, 2]
        along = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        return state.poses[:, None, :2] + self.positions[:, None] * along, along

    def block(self, state: _State, markers: bool = False) -> Block:
        """Residuals in px, not weighted; with ``markers``, derivatives by each marker's position
        along the target behind the five of the map."""
        xy, along = self.points(state)
        uv, by_point, by_map = state.sheet.image_with_jacobians(xy)
        seen = self.views.seen[..., None]
        residuals = np.where(seen, uv - np.nan_to_num(self.views.uv), 0.0)
        across = np.stack([-along[..., 1], along[..., 0]], axis=-1) * self.positions[:, None]
        by_turn = by_point @ across[..., None]
        by_shared = [by_map]
        if markers:
            own = np.einsum("nmij,nkj->nmi", by_point, along)[..., None]
            by_shared.append(own * np.eye(len(self.positions))[:, None, :])
        count, size = residuals.shape[:2]
        shared = np.where(seen[..., None], np.concatenate(by_shared, axis=-1), 0.0)
        local = np.where(seen[..., None], np.concatenate([by_point, by_turn], axis=-1), 0.0)
        return Block(
            residuals.reshape(count, 2 * size),
            shared.reshape(count, 2 * size, -1),
            np.arange(shared.shape[-1]),
            local.reshape(count, 2 * size, -1),
        )

    def blocks(self, state: _State) -> list[Block]:
        """Weighted residuals and their derivatives."""
        block, weights = self.block(state), self.weights
        return [
            Block(
                block.residuals * weights,
                block.by_shared * weights[..., None],
                block.columns,
                block.by_local * weights[..., None],
            )
        ]

    def moved(self, state: _State, shared: Array, local: Sequence[Array]) -> _State:
        """The state after a step; unchanged where no such map exists."""
        a, b, c, l1, l2 = (float(x) for x in state.sheet.parameters + shared)
        if not (a > 0 and c * state.sheet.c > 0 and np.isfinite([b, l1, l2]).all()):
            return state
        sheet = replace(state.sheet, a=a, b=b, c=c, l1=l1, l2=l2)
        return _State(sheet, state.poses + local[0])


@dataclass(frozen=True)
class _MapFit:
    """One sheet's minimum."""

    problem: _MapAdjustment
    solution: Solution[_State]
    proportions: Array

    @property
    def freedom(self) -> int:
        """Observations less unknowns."""
        views = self.problem.views
        return 2 * int(views.seen.sum()) - 3 * len(views) - self.problem.shared_size

    def model(self, variance: float) -> ReducedModel:
        """Information on the map and on the markers' positions behind it."""
        block = self.problem.block(self.solution.state, markers=True)
        seen = np.repeat(self.problem.views.seen, 2, axis=1)
        diagonal = np.repeat(np.where(self.problem.views.seen, self.proportions, 0.0), 2, axis=1)
        pixel = np.zeros((*diagonal.shape, diagonal.shape[1]))
        places = np.arange(diagonal.shape[1])
        pixel[:, places, places] = diagonal**2
        group = contrasts(block, [(0, pixel)], seen)
        size = self.problem.shared_size + len(self.problem.positions)
        return reduced_model([group], size, np.array([variance]))


def camera_free(rig: Rig) -> SheetCalibration:
    """The sheets' metric homographies from the in-plane views alone.

    Raises
    ------
    InputError
        If a lens model is asked for, which cannot be told without a camera.
    UntrustworthyError
        If the positions do not determine the homography.
    """
    refuse_unusable_views(rig)
    if rig.distortion != "none":
        raise InputError(
            f'distortion is "{rig.distortion}", but method camera-free knows no camera and no lens',
            'set distortion = "none", or use --method joint',
        )
    noise = noise_model(rig)
    fits = [_fitted(rig, laser, noise.proportions) for laser in range(len(rig.lasers))]
    chi2 = sum(2.0 * fit.solution.cost for fit in fits)
    freedom = sum(fit.freedom for fit in fits)
    stated = not noise.free[PIXEL]
    warnings = []
    if freedom < 1 and not stated:
        raise UntrustworthyError(
            "plane",
            "there are no more observations than unknowns, so the noise cannot be estimated",
            "lay the target into the sheet in further positions, or state pixel_std",
        )
    variance = float(noise.variances[PIXEL])
    if not stated:
        variance = chi2 / freedom
    elif freedom > 0 and chi2 / variance > chi2_limit(freedom):
        stated = False
        warnings.append(
            f"the residuals are {np.sqrt(chi2 / freedom / variance):.1f} times as large as the "
            "stated noise; the uncertainties follow the residuals instead – look for targets off "
            "the sheet, lens distortion or a wrong view"
        )
        variance = chi2 / freedom
    component = None if stated else COMPONENTS[PIXEL]
    size, told = float(np.sqrt(variance)), (COMPONENTS[PIXEL],)
    estimated = NoiseComponents(told, (size,), np.array([[2.0 / max(freedom, 1)]]))
    components = NoiseComponents() if stated else estimated
    views = tuple(view for fit in fits for view in _views(fit))
    squares = np.concatenate([view.residuals.ravel() ** 2 for view in views])
    covariance = _covariance(rig, fits, variance, component, components)
    _refuse_vague(fits, covariance)
    return SheetCalibration(
        method="camera-free",
        sheet_maps=tuple(fit.solution.state.sheet for fit in fits),
        covariance=covariance,
        residuals=Residuals(
            rms_px=float(np.sqrt(np.nanmean(squares))),
            chi2_per_dof=chi2 / freedom / variance if stated and freedom > 0 else 1.0,
            views=views,
        ),
        target=rig.target,
        pixel_std=size,
        warnings=(*warnings, *_stand_out(views)),
    )


def _fitted(rig: Rig, laser: int, proportions: Mapping[str, Array]) -> _MapFit:
    everything = rig.observations.plane
    chosen = np.flatnonzero(everything.lasers == laser)
    views = everything.take(chosen)
    name = rig.lasers[laser]
    scale = 0.5 * float(np.hypot(*rig.image_size))
    centre = 0.5 * (np.array(rig.image_size) - 1.0)
    length = float(rig.target.positions[-1])
    points = (views.uv - centre) / scale
    found = sheet_map(points, rig.target.positions / length) if len(views) else None
    if found is None:
        raise UntrustworthyError(
            "plane",
            f"{len(views)} positions of the target in the sheet of {name} do not give its picture",
            "lay the target into the sheet in at least 3 positions, turned into different "
            "directions; 10 give a good result",
        )
    in_mm = np.array([length, length, 1.0])[:, None] * found
    start = _state_of(in_mm, name, rig, views)
    own = proportions["plane"][chosen]
    problem = _MapAdjustment(rig.target.positions, views, own)
    try:
        solution = solve(problem, start)
    except np.linalg.LinAlgError as reason:
        raise _undetermined(name) from reason
    if not solution.converged:
        raise _undetermined(name)
    return _MapFit(problem, solution, own)


def _state_of(found: Array, name: str, rig: Rig, views: TargetViews) -> _State:
    """The closed form's homography in the parameters of `SheetMap`, and the targets' poses."""
    line = found[2] / found[2, 2]
    upper = found[:2, :2] / found[2, 2] - np.outer(found[:2, 2] / found[2, 2], line[:2])
    angle = np.arctan2(upper[1, 0], upper[0, 0])
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    upper = turn @ upper
    sheet = SheetMap(rig.image_size, upper[0, 0], upper[0, 1], upper[1, 1], line[0], line[1], name)
    xy = sheet.points(views.uv)[..., :2]
    poses = np.zeros((len(views), 3))
    for index, seen in enumerate(views.seen):
        first, last = np.flatnonzero(seen)[[0, -1]]
        along = xy[index, last] - xy[index, first]
        if not np.isfinite(along).all():
            raise _undetermined(name)
        psi = np.arctan2(along[1], along[0])
        direction = np.array([np.cos(psi), np.sin(psi)])
        start = xy[index, first] - rig.target.positions[first] * direction
        poses[index] = (*start, psi)
    return _State(sheet, poses)


def _undetermined(name: str) -> UntrustworthyError:
    return UntrustworthyError(
        "plane",
        f"the positions do not determine the picture of the sheet of {name}",
        "lay the target into the sheet in further positions, turned into different directions",
    )


def _covariance(
    rig: Rig,
    fits: Sequence[_MapFit],
    variance: float,
    component: str | None,
    components: NoiseComponents,
) -> Covariance:
    names, own, by_marker, by_scale = [], [], [], []
    size = len(SHEET_MAP_PARTS)
    for fit in fits:
        model = fit.model(variance)
        sheet = fit.solution.state.sheet
        try:
            covariance, _ = scaled_inverse(model.information[:size, :size])
        except np.linalg.LinAlgError as reason:
            raise _undetermined(sheet.name) from reason
        names += [f"{sheet.name}.{part}" for part in SHEET_MAP_PARTS]
        own.append(covariance)
        by_marker.append(-covariance @ model.information[:size, size:])
        by_scale.append([sheet.a, sheet.b, sheet.c, 0.0, 0.0])
    whole = np.zeros((len(names), len(names)))
    for index, part in enumerate(own):
        place = slice(size * index, size * (index + 1))
        whole[place, place] = part
    sources = [Source("sheet", whole, component)]
    markers, scale = np.concatenate(by_marker), np.concatenate(by_scale)
    if rig.target.tolerance_mm > 0:
        sources.append(Source("target length", rig.target.tolerance_mm**2 * markers @ markers.T))
    if rig.target.thermal_std > 0:
        grown = scale * rig.target.thermal_std
        sources.append(Source("temperature", np.outer(grown, grown)))
    total = np.sum([source.matrix for source in sources], axis=0)
    return Covariance(tuple(names), total, tuple(sources), components)


def _refuse_vague(fits: Sequence[_MapFit], covariance: Covariance) -> None:
    for fit in fits:
        sheet = fit.solution.state.sheet
        for part, what in (("a", "along the picture's rows"), ("c", "across them")):
            relative = covariance.std(f"{sheet.name}.{part}") / abs(getattr(sheet, part))
            if not relative <= _LINEAR_LIMIT:
                raise UntrustworthyError(
                    "plane",
                    f"the positions leave the scale of the sheet of {sheet.name} {what} uncertain "
                    f"by {relative:.0%} (limit {_LINEAR_LIMIT:.0%})",
                    "lay the target into the sheet in further positions, turned into different "
                    "directions and spread over the picture",
                )


def _views(fit: _MapFit) -> list[ViewResiduals]:
    xy, _ = fit.problem.points(fit.solution.state)
    xyz = np.concatenate([xy, np.zeros_like(xy[..., :1])], axis=-1)
    views = fit.problem.views
    residuals = views.uv - fit.solution.state.sheet.image_with_jacobians(xy)[0]
    return [
        ViewResiduals("plane", name, views.uv[i], residuals[i], xyz[i])
        for i, name in enumerate(views.names)
    ]


def _stand_out(views: Sequence[ViewResiduals]) -> tuple[str, ...]:
    typical = float(np.median([view.rms_px for view in views]))
    return tuple(
        f"view {view.view} of stage plane has residuals of {view.rms_px:.2g} px, the median is "
        f"{typical:.2g} px – check its markers, or remove it"
        for view in views
        if view.rms_px > max(_STANDS_OUT * typical, 1e-6)
    )
