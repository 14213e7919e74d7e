"""Which parts of the lines lie on the boards: those that agree on one sheet of light.

Where a line leaves the board, it goes on beside it: on the table, a hand, the wall. Straight as
it is there, too, nothing in one picture tells which part lies on the board, for a board may be
larger than its pattern. All views together do: put onto the boards' planes, only what really lies
on them lies in one sheet. So each line is cut into straight pieces, and the sheet is sought with
which most points agree (Fischler and Bolles, Comm. ACM 24(6), 1981; Torr and Zisserman's score,
CVIU 78(1), 2000).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from sheetoflight.calibration.straight_pieces import Piece
from sheetoflight.geometry.directions import Array

_PAIRS = 1500

_AGREED_PX = 6.0
"""Distance of a piece from the image of the sheet's line on its board beyond which it says nothing
for a sheet: boards bend, and sheets are not quite flat."""

_AGREED_SHARE = 0.3
"""Share of the lines that must agree on one sheet: edges and scratches agree by chance."""

_LINED_SHARE = 0.15
"""The same of all views: where hardly a picture shows a line, the laser was off in all, or was on
in these few."""

_MOST_LINES = 0.8

_UNLIKELY = 4
"""Share of the few lines, and their number, that do not agree by chance."""

_EDGE_ON = 0.01
"""Distance of a sheet from the camera, as a part of the boards', that is as good as none."""

_LINE_FACTOR = 3.0
"""How many times farther off than the median piece a piece may lie: one in 500 does by chance."""

_LEAST_PX = 0.5
"""Distance of a piece from its line that is no reason to leave it out."""


@dataclass(frozen=True, eq=False)
class FacePlanes:
    """The plane ``m · X = c`` of the board's face on which each of L lines would lie, camera
    frame: ``normal (L, 3)``, ``offset (L,)`` mm."""

    normal: Array
    offset: Array


def agreed_pieces(
    pieces: list[list[Piece]], faces: FacePlanes, focal: float, views: int
) -> list[int | None]:
    """For every line the number of its piece that lies in the sheet of most; None where none does.

    Parameters
    ----------
    pieces : L lists of pieces
    faces : FacePlanes
    focal : float
        px per unit of normalised coordinates.
    views : int
        How many views there are, with a line or without.
    """
    owner = np.array([k for k, own in enumerate(pieces) for _ in own], dtype=int)
    every = [piece for own in pieces for piece in own]
    if len(set(owner.tolist())) < 2:
        return [next((k for k, piece in enumerate(own) if piece.weight), None) for own in pieces]
    rays = np.concatenate([[p.ends for p in every], np.ones((len(every), 2, 1))], axis=2)
    normal, offset = faces.normal[owner], faces.offset[owner]
    with np.errstate(divide="ignore", invalid="ignore"):
        points = rays * (offset[:, None] / np.einsum("pei,pi->pe", rays, normal))[..., None]
    weight = np.array([p.weight for p in every])
    sheets = _candidates(points, owner, weight)
    if not len(sheets):
        return [None] * len(pieces)
    errors = _errors(sheets, rays, normal, offset, focal)
    best = int(_scores(errors, owner, weight).argmin())
    chosen = _chosen(errors[best], weight, owner, len(pieces))
    saying = sum(any(piece.weight for piece in own) for own in pieces)
    agreed = sum(
        number is not None and own[number].weight > 0
        for own, number in zip(pieces, chosen, strict=True)
    )
    return chosen if _enough(agreed, saying, views) else [None] * len(pieces)


def _enough(agreed: int, lines: int, views: int) -> bool:
    """Whether so many of these lines, in so many views, tell a sheet: any two agree."""
    if views <= 2:
        return agreed >= 2
    if agreed < max(3, round(_AGREED_SHARE * lines)):
        return False
    return agreed >= _LINED_SHARE * views or agreed >= max(_UNLIKELY, _MOST_LINES * lines)


def _candidates(points: Array, owner: np.ndarray, weight: Array) -> Array:
    """Sheets ``(S, 4)``, as (n, d), through pairs of pieces of different lines."""
    order = np.argsort(-weight, kind="stable")
    order = order[weight[order] > 0]
    pairs = np.array(list(combinations(order.tolist(), 2)), dtype=int).reshape(-1, 2)
    pairs = pairs[owner[pairs[:, 0]] != owner[pairs[:, 1]]]
    if len(pairs) > _PAIRS:
        pairs = pairs[np.random.default_rng(0).permutation(len(pairs))[:_PAIRS]]
    corners = points[pairs].reshape(-1, 4, 3)
    corners = corners[np.isfinite(corners).all(axis=(1, 2))]
    middle = corners.mean(axis=1)
    normal = np.linalg.svd(corners - middle[:, None], full_matrices=False)[2][:, 2]
    sheets = np.column_stack([normal, np.einsum("si,si->s", normal, middle)])
    # an edge of the scenery stands at one place of all pictures, in a plane through the camera
    far = np.linalg.norm(middle, axis=1)
    return sheets[np.abs(sheets[:, 3]) > _EDGE_ON * far]


def _errors(sheets: Array, rays: Array, normal: Array, offset: Array, focal: float) -> Array:
    """Root mean square distance ``(S, P)``, px, of each piece's ends from the image of the line in
    which each sheet meets its face."""
    line = offset[None, :, None] * sheets[:, None, :3] - sheets[:, 3, None, None] * normal[None]
    size = np.maximum(np.linalg.norm(line[..., :2], axis=-1), 1e-300)
    off = np.einsum("spi,pei->spe", line, rays) / size[..., None]
    return np.nan_to_num(focal * np.sqrt(np.mean(off**2, axis=-1)), nan=np.inf)


def _scores(errors: Array, owner: np.ndarray, weight: Array) -> Array:
    """Of each sheet: what its lines' best pieces miss by, large misses counting alike."""
    gains = weight * np.maximum(1.0 - (errors / _AGREED_PX) ** 2, 0.0)
    total = np.zeros(len(errors))
    for line in np.unique(owner):
        total -= gains[:, owner == line].max(axis=1)
    return total


def _chosen(errors: Array, weight: Array, owner: np.ndarray, lines: int) -> list[int | None]:
    """Each line's piece nearest to the sheet, if it is near; one with a say, if there is one."""
    best: list[int | None] = [None] * lines
    least = np.full(lines, np.inf)
    for line in range(lines):
        own, silent = errors[owner == line], weight[owner == line] == 0
        if (own[~silent] <= _AGREED_PX).any():
            own = np.where(silent, np.inf, own)
        if len(own):
            best[line], least[line] = int(own.argmin()), float(own.min())
    near = least[least <= _AGREED_PX]
    limit = max(_LINE_FACTOR * float(np.median(near)), _LEAST_PX) if near.size else 0.0
    return [piece if size <= limit else None for piece, size in zip(best, least, strict=True)]
