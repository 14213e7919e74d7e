"""How far a board's points lie from where they should, and what that does to the estimates.

The points of a printed board are some hundredths of a millimetre off, and no board is quite flat.
Every view sees the same errors, so that no number of views averages them out, and the scatter of
the residuals does not tell them: they are what is common to all views. With the residuals e and
their derivatives Z by a point's place, the point's offset is ``ŝ = (ΣZᵀZ)⁻¹ ΣZᵀe``; by how much
the offsets of all points exceed what noise makes of them tells how large they are (analysis of
variance), and they move the estimates by ``−C Xᵀ V⁻¹ Z s``, X having the poses eliminated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from sheetoflight.calibration.adjustment import Adjustment
from sheetoflight.calibration.board_evidence import BoardEvidence
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.geometry.directions import Array

_ODDS = 1e-3
"""Odds of offsets as large by chance below which they are believed."""

_ABSORBED = {"in plane": 4, "out of plane": 3}
"""Offsets that poses take up: two shifts, a turn and the size; a shift and two tilts."""


@dataclass(frozen=True)
class PrintErrors:
    """Standard deviations of the points' offsets, mm: along each of the board's axes, and out of
    its plane; 0 where the residuals do not show any."""

    in_plane_mm: float = 0.0
    out_of_plane_mm: float = 0.0

    @property
    def any(self) -> bool:
        """Whether there are any."""
        return self.in_plane_mm > 0 or self.out_of_plane_mm > 0


def print_errors(boards: BoardEvidence, state: RigState) -> PrintErrors:
    """What the residuals of a board's points have in common in all views."""
    residuals, by_place = _by_place(boards, state)
    seen = np.asarray(np.isfinite(residuals).all(axis=-1))
    residuals = np.where(seen[..., None], residuals, 0.0)
    freedom = 2 * int(seen.sum()) - 6 * len(seen)
    squares = float(np.sum(residuals**2))
    flat = _offsets(residuals, by_place[..., :2], squares, freedom, _ABSORBED["in plane"])
    high = _offsets(residuals, by_place[..., 2:], squares, freedom, _ABSORBED["out of plane"])
    return PrintErrors(flat, high)


def _offsets(
    residuals: Array, by_place: Array, squares: float, freedom: int, absorbed: int
) -> float:
    """Standard deviation of the points' offsets in k directions, mm."""
    normal = np.einsum("nmik,nmil->mkl", by_place, by_place)
    pull = np.einsum("nmik,nmi->mk", by_place, residuals)
    told = np.linalg.cond(normal) < 1e8
    normal, pull = normal[told], pull[told]
    between = float(np.einsum("mk,mk->", pull, np.linalg.solve(normal, pull[..., None])[..., 0]))
    own = pull.size - absorbed
    rest = freedom - own
    if own < 1 or rest < 1 or squares <= between:
        return 0.0
    noise = (squares - between) / rest
    if not noise > 0 or float(fdtrc(own, rest, between / own / noise)) > _ODDS:
        return 0.0
    per_mm = float(np.einsum("mkk->", normal)) * own / pull.size
    return float(np.sqrt(max(between - noise * own, 0.0) / per_mm))


def _by_place(boards: BoardEvidence, state: RigState) -> tuple[Array, Array]:
    """Weighted residuals, observed minus predicted, ``(N, M, 2)``, and how they fall with a point's
    place on the board ``(N, M, 2, 3)``, per mm; NaN and 0 where not seen."""
    weights = 1.0 / boards.proportions[..., None]
    _, by_point, _ = state.camera.project_with_jacobians(boards.points(state), ())
    by_place = by_point @ state.poses["board"][:, None, :, :3] * weights[..., None]
    seen = boards.views.seen[..., None, None]
    return boards.errors(state) * weights, np.where(seen, by_place, 0.0)


def by_printed_point(adjustment: Adjustment, state: RigState, gain: Array) -> Array:
    """How estimates move with the place of each of a board's points, ``(P, M, 3)`` per mm.

    Parameters
    ----------
    adjustment : Adjustment
        With boards.
    state : RigState
    gain : (P, S) array
        Covariance of the P estimates with the adjustment's S shared parameters.
    """
    boards = adjustment.boards
    assert boards is not None
    block = adjustment.blocks(state)[-1]
    local = np.linalg.qr(block.by_local)[0]
    free = block.by_shared - local @ (np.swapaxes(local, 1, 2) @ block.by_shared)
    count, points = boards.views.uv.shape[:2]
    own = free[:, : 2 * points].reshape(count, points, 2, -1)
    _, by_place = _by_place(boards, state)
    pull = np.einsum("nmis,nmik->smk", own, by_place / boards.corner_std)
    return -np.einsum("ps,smk->pmk", gain[:, block.columns], pull)
