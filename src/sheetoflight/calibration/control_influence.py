"""Where the errors of sheets come from that a closed form laid through control points.

The camera comes first, from the boards' points, and their poses with it; then the sheet. A pose
follows the camera, ``δp = G (ε − A δc)`` with ``G = (BᵀB)⁻¹ Bᵀ``, ε being the noise of the
points' picture over its size, A and B its derivatives by camera and pose over the same. What of ε
moves the pose so, the camera does not see, whose estimate has the poses eliminated. Only where a
method looks at the points' picture once more, as the cross-ratio does, are both disturbed by the
same noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sheetoflight.calibration.board_evidence import BoardEvidence
from sheetoflight.calibration.components import COMPONENTS, CORNER, LINE, SHAPE, STRIPE
from sheetoflight.calibration.control_forms import ControlForm
from sheetoflight.calibration.control_lines import line_shares
from sheetoflight.calibration.control_motions import (
    by_camera,
    by_picture,
    by_poses,
    plane_slopes,
)
from sheetoflight.calibration.fit import Fit
from sheetoflight.calibration.printed_points import print_errors
from sheetoflight.calibration.rig_state import RigState, sheet_names
from sheetoflight.calibration.uncertainty import NOISE_SOURCES, Influence
from sheetoflight.geometry.directions import Array
from sheetoflight.model.rig import Rig

_PARTS = 3
"""Of a sheet: two tilts and the distance."""


@dataclass(frozen=True, eq=False)
class SheetErrors:
    """Where the errors of L sheets come from.

    Parameters
    ----------
    influence : Influence
        The camera held.
    slope : (3L, P) array
        How the sheets move with the camera's parameters, the poses following.
    in_common : (P, 3L) array
        What the noise of the points' picture has in common: times the camera's covariance, it is
        that of camera and sheets.
    """

    influence: Influence
    slope: Array
    in_common: Array


def sheet_errors(
    rig: Rig, forms: Sequence[ControlForm], fit: Fit, state: RigState, names: tuple[str, ...]
) -> SheetErrors:
    """Follow the errors of all that closed forms computed sheets from.

    Parameters
    ----------
    rig : Rig
        Of boards.
    forms : sequence of ControlForm
        One for each laser.
    fit : Fit
        Of the camera and the boards' poses, with the sizes of all noise.
    state : RigState
        The same, with the sheets.
    names : tuple of str
        The camera's parameters, P, whose errors are carried on.
    """
    assert rig.board is not None
    sheets = [
        (form, plane_slopes(form.place(form.sights).points, frame))
        for form, frame in zip(forms, state.frames, strict=True)
    ]
    known = BoardEvidence(rig.board, rig.observations.board, fit.noise.variances)
    views, points = known.views.uv.shape[:2]
    pose = np.concatenate([by_poses(*sheet, state) for sheet in sheets])
    picture = np.concatenate([by_picture(*sheet, views, points) for sheet in sheets])
    camera = np.concatenate([by_camera(*sheet, names) for sheet in sheets])
    gain, seen, free = _poses(known, state, names)
    direct = picture * _sizes(known)
    own = np.einsum("qnl,nlr->qnr", pose, gain) + direct
    shares = {CORNER: np.einsum("qnr,snr->qs", own, own)}
    shares |= _line_shares(rig, sheets, state, fit.noise.variances)
    found = Influence(
        sheet_names(len(forms)),
        tuple((NOISE_SOURCES[k], _told(fit, k), part) for k, part in shares.items()),
        np.zeros((len(pose), len(rig.target.positions))),
        _by_size(state),
        _by_print(known, state, own),
        print_errors(known, state),
    )
    slope = camera - np.einsum("qnl,nlr,nrp->qp", pose, gain, seen)
    return SheetErrors(found, slope, np.einsum("nrp,qnr->pq", free, direct))


def _sizes(known: BoardEvidence) -> Array:
    """Standard uncertainties ``(N, 2M)`` of the picture of the target's points, px; 0 where it
    was not seen."""
    std = known.proportions * known.corner_std
    return np.repeat(np.where(known.views.seen, std, 0.0), 2, axis=1)


def _by_size(state: RigState) -> Array:
    """``(3L,)``: a larger board is as much farther away at a given camera, and so is the sheet."""
    still = np.zeros_like(state.distances)
    return np.stack([still, still, state.distances], axis=1).ravel()


def _poses(
    known: BoardEvidence, state: RigState, names: tuple[str, ...]
) -> tuple[Array, Array, Array]:
    """G ``(N, 6, 2M)``, A ``(N, 2M, P)``, and A with the poses eliminated."""
    block = known.block(state, names)
    seen = np.zeros((*block.residuals.shape, len(names)))
    seen[:, :, block.columns] = block.by_shared
    turned = np.swapaxes(block.by_local, 1, 2)
    gain = np.linalg.solve(turned @ block.by_local, turned)
    return gain, seen, seen - block.by_local @ (gain @ seen)


def _by_print(known: BoardEvidence, state: RigState, response: Array) -> Array:
    """``(Q, M, 3)``: how sheets move with the places of the target's points, per mm, by their
    response ``(Q, N, 2M)`` to the points' picture, in its standard uncertainties. The faces stay,
    and the light on them."""
    _, by_point, _ = state.camera.project_with_jacobians(known.points(state), ())
    by_place = by_point @ state.poses["board"][:, None, :, :3]
    by_place = by_place / (known.proportions * known.corner_std)[..., None, None]
    by_place = np.where(known.views.seen[..., None, None], by_place, 0.0)
    return -np.einsum("qnmi,nmij->qmj", response.reshape(-1, *by_place.shape[:3]), by_place)


def _line_shares(
    rig: Rig, sheets: Sequence[tuple[ControlForm, Array]], state: RigState, variances: Array
) -> dict[int, Array]:
    """Covariances ``(3L, 3L)`` by kind of the lines' noise, of which each laser has its own."""
    size = _PARTS * len(sheets)
    shares = {k: np.zeros((size, size)) for k in (STRIPE, LINE, SHAPE)}
    for laser, (form, slopes) in enumerate(sheets):
        rows = slice(_PARTS * laser, _PARTS * (laser + 1))
        found = line_shares(rig, laser, form, slopes, state, variances)
        for k, part in found.items():
            shares[k][rows, rows] = part
    return {k: part for k, part in shares.items() if variances[k] > 0}


def _told(fit: Fit, component: int) -> str | None:
    """The noise component whose size the residuals told."""
    return COMPONENTS[component] if fit.size_covariance[component, component] > 0 else None
