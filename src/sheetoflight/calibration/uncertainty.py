"""What the uncertainty of the estimates comes from, source by source.

With contrasts y of the residuals, their derivatives X and covariance ``V = Σ θ_k V_k`` block by
block, the estimates move by ``δθ = −C Xᵀ V⁻¹ y`` with ``C = (Xᵀ V⁻¹ X)⁻¹``. Noise component k of
stage b therefore brings ``C (Xᵀ V⁻¹ θ_k V_k V⁻¹ X)_b C``, and these shares add up to C. A marker
that lies ds from where it is said to lie moves the residuals by ``Z ds`` and the estimates by
``−C Xᵀ V⁻¹ Z ds``: the target's own errors are propagated exactly, not as a mere scale.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sheetoflight.calibration.components import (
    COMPONENTS,
    CORNER,
    LINE,
    MARKER,
    PLACEMENT,
    SHAPE,
    STRIPE,
)
from sheetoflight.calibration.fit import Fit, undetermined
from sheetoflight.calibration.printed_points import PrintErrors, by_printed_point, print_errors
from sheetoflight.calibration.rig_state import CAMERA, RigState, bend_names, sheet_names
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board import Board
from sheetoflight.model.covariance import (
    CURVATURE_PARTS,
    PLANE_PARTS,
    Covariance,
    NoiseComponents,
    Source,
)
from sheetoflight.model.target import CollinearTarget

STAGE_SOURCES = {"camera": "camera", "plane": "sheet", "crossing": "crossing"}
"""What the pixel noise of a stage is called in a budget."""

NOISE_SOURCES = {
    PLACEMENT: "placement",
    MARKER: "placement",
    CORNER: "board",
    STRIPE: "line",
    LINE: "lines off the sheet",
    SHAPE: "lines off the sheet",
}
"""What noise that has one cause is called in a budget."""


@dataclass(frozen=True)
class Influence:
    """Where the errors of some estimates come from.

    Parameters
    ----------
    names : tuple of str
        The P shared parameters, of `CAMERA`, `sheet_names` and `bend_names`.
    noise : tuple of (source, component, (P, P) array)
        Shares of the covariance that come from noise; the component is None where its size was
        stated.
    by_marker : (P, M) array
        How the estimates move with the position of each marker, per mm.
    by_size : (P,) array
        How they move with the relative size of the boards.
    by_print : (P, M, 3) array
        How they move with the place of each of the boards' points, per mm.
    printed : PrintErrors
        How far these points are off, by the residuals.
    """

    names: tuple[str, ...]
    noise: tuple[tuple[str, str | None, Array], ...]
    by_marker: Array
    by_size: Array
    by_print: Array
    printed: PrintErrors = field(default_factory=PrintErrors)


def influence(fit: Fit, names: Sequence[str], stage: str) -> Influence:
    """Where the errors of a fit's parameters come from.

    Raises
    ------
    UntrustworthyError
        If the views leave a combination of parameters undetermined.
    """
    size = fit.adjustment.shared_size
    markers = len(fit.adjustment.positions)
    asked = bool(fit.adjustment.stages) or (fit.rig.board is not None and fit.rig.board.scale_std)
    model = fit.model(marker_moves(fit) if asked else None)
    chosen = fit.adjustment.columns_of(names)
    try:
        gain = fit.covariance[chosen]
    except np.linalg.LinAlgError as reason:
        raise undetermined(stage) from reason
    stages = fit.adjustment.block_names
    noise = []
    for (place, k), share in model.shares.items():
        if fit.noise.variances[k] == 0:
            continue
        part = fit.noise.variances[k] * gain @ share[:size, :size] @ gain.T
        source = NOISE_SOURCES.get(k) or STAGE_SOURCES[stages[place]]
        estimated = fit.size_covariance[k, k] > 0
        noise.append((source, COMPONENTS[k] if estimated else None, part))
    by_marker, by_size = np.zeros((len(names), markers)), np.zeros(len(names))
    if asked:
        by_marker = -gain @ model.information[:size, size : size + markers]
        by_size = -gain @ model.information[:size, size + markers]
    by_print, printed = np.zeros((len(names), 0, 3)), PrintErrors()
    if fit.adjustment.boards is not None:
        now = fit.noise.adjustment(
            fit.rig, fit.adjustment.stages, fit.adjustment.parameters, fit.state
        )
        by_print = by_printed_point(now, fit.state, gain)
        printed = print_errors(fit.adjustment.boards, fit.state)
    return Influence(tuple(names), tuple(noise), by_marker, by_size, by_print, printed)


def marker_moves(fit: Fit) -> dict[str, list[Array]]:
    """Moves of the points ``(N, M, 3)`` when one marker after the other shifts along the target."""
    moves = {}
    for stage in fit.adjustment.stages:
        place = fit.adjustment.placed(fit.state, stage)
        moves[stage] = []
        for marker in range(len(fit.adjustment.positions)):
            move = np.zeros_like(place.points)
            move[:, marker] = place.along
            moves[stage].append(move)
    return moves


def chained(
    first: Influence, second: Influence, slope: Array, shared: Array | None = None
) -> Influence:
    """Influence on two sets of estimates, the second computed with the first held.

    Parameters
    ----------
    first, second : Influence
        Of P and Q parameters.
    slope : (Q, P) array
        How the second estimates move with the first.
    shared : (P, Q) array, optional
        Covariance of the two by the noise of the boards' points, which both saw.
    """
    down = np.concatenate([np.eye(len(first.names)), slope])
    aside = np.concatenate([np.zeros_like(slope.T), np.eye(len(second.names))])
    shares: dict[tuple[str, str | None], Array] = {}
    for change, influence in ((down, first), (aside, second)):
        for source, component, part in influence.noise:
            key = (source, component)
            shares[key] = shares.get(key, 0.0) + change @ part @ change.T
    if shared is not None:
        key = next(k for k in shares if k[0] == NOISE_SOURCES[CORNER])
        mixed = down @ shared @ aside.T
        shares[key] = shares[key] + mixed + mixed.T
    return Influence(
        (*first.names, *second.names),
        tuple((*key, part) for key, part in shares.items()),
        down @ first.by_marker + aside @ second.by_marker,
        down @ first.by_size + aside @ second.by_size,
        _chained_print(first, second, down, aside),
        second.printed if second.by_print.size else first.printed,
    )


def _chained_print(first: Influence, second: Influence, down: Array, aside: Array) -> Array:
    """Boards' points move both, where both saw boards."""
    parts = [
        np.einsum("qp,pmk->qmk", change, part.by_print)
        for change, part in ((down, first), (aside, second))
        if part.by_print.size
    ]
    return np.sum(parts, axis=0) if parts else np.zeros((len(down), 0, 3))


def covariance_of(
    influence: Influence,
    state: RigState,
    lasers: Sequence[str],
    target: CollinearTarget,
    components: NoiseComponents,
    board: Board | None = None,
) -> Covariance:
    """Covariance in public names: the sheets' tilts become changes of their normals."""
    names, change = _public(influence.names, state, lasers)
    sources = [
        Source(source, change @ part @ change.T, component)
        for source, component, part in influence.noise
    ]
    by_marker = change @ influence.by_marker
    if target.tolerance_mm > 0:
        part = target.tolerance_mm**2 * by_marker @ by_marker.T
        sources.append(Source("target length", part))
    if target.thermal_std > 0:
        grown = by_marker @ target.positions * target.thermal_std
        sources.append(Source("temperature", np.outer(grown, grown)))
    if board is not None and board.scale_std > 0:
        sized = change @ influence.by_size * board.scale_std
        sources.append(Source("board length", np.outer(sized, sized)))
    sources += _print_sources(change, influence, board)
    sources = [replace(s, matrix=0.5 * (s.matrix + s.matrix.T)) for s in sources]
    whole = np.sum([source.matrix for source in sources], axis=0)
    return Covariance(names, whole, tuple(sources), components)


def _print_sources(change: Array, influence: Influence, board: Board | None) -> list[Source]:
    """What the points of a board that lie off do: as stated, or as the residuals show."""
    if board is None or not influence.by_print.size:
        return []
    moved = np.einsum("qp,pmk->qmk", change, influence.by_print)
    size = np.full(3, board.tolerance_mm or 0.0)
    if board.tolerance_mm is None:
        printed = influence.printed
        size = np.array([printed.in_plane_mm, printed.in_plane_mm, printed.out_of_plane_mm])
    flat = (moved * size).reshape(len(moved), -1)
    return [Source("board print", flat @ flat.T)] if size.any() else []


def _public(
    names: Sequence[str], state: RigState, lasers: Sequence[str]
) -> tuple[tuple[str, ...], Array]:
    """The parameters' public names, and how these move with them."""
    count = len(lasers)
    intrinsics = [name for name in names if name in CAMERA]
    told = list(intrinsics)
    change = [np.eye(len(names))[names.index(name)] for name in intrinsics]
    for index, (laser, sign) in enumerate(zip(lasers, state.signs, strict=True)):
        sheet = sheet_names(count)[3 * index : 3 * index + 3]
        if sheet[0] in names:
            told += [f"{laser}.{part}" for part in PLANE_PARTS]
            moved = np.zeros((4, len(names)))
            moved[:3, [names.index(n) for n in sheet[:2]]] = sign * state.frames[index][:, :2]
            moved[3, names.index(sheet[2])] = sign
            change += list(moved)
        bend = bend_names(count)[3 * index : 3 * index + 3]
        if bend[0] in names:
            told += [f"{laser}.{part}" for part in CURVATURE_PARTS]
            change += [sign * np.eye(len(names))[names.index(name)] for name in bend]
    return tuple(told), np.array(change).reshape(len(told), len(names))
