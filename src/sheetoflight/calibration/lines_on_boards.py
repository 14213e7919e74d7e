"""Lines of light on boards, reduced to what an adjustment can ask of them.

The sheet ``n · X = d`` meets a face ``m · X = c`` of a board, both in the camera frame, in a line
whose image is ``ℓ · r = 0`` with the ray ``r = (x, y, 1)`` and ``ℓ = c n − d m``: the plane
``ℓ · X = 0`` holds the line and the camera's centre. A point of the line misses it by ``ℓ̂ · r``,
ℓ̂ being ℓ over the length of its first two parts, and by ``ℓ̂ · r / g`` in px, g being the
length of the derivative of ``ℓ̂ · r`` by the pixel.

Thousands of points say no more than a few numbers. With the ray's derivatives by the camera's
parameters at a camera c₀, the misses of all points of a line, in their standard uncertainties,
are ``Z (ℓ̂, c − c₀)`` with rows ``(x, y, 1, ℓ̂ · ∂r/∂c) / (g σ)``. Only ``ZᵀZ = RᵀR`` enters a
least-squares adjustment, so that the 13 rows of R stand for the whole line, exactly at c₀ and to
second order beside it. Real lines wind a little, which no adjustment should blame on the lens: four
further columns hold Legendre's polynomials along the line, the shapes that this noise takes.
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from scipy.special import eval_legendre

from sheetoflight.calibration.rig_state import RigState
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board import Board
from sheetoflight.model.board_views import LinePixels
from sheetoflight.model.camera import Camera

RAY = 3
"""Columns of the ray, before those of the camera's ten parameters and of the shapes."""

SHAPES = (2, 3, 4, 5)
"""Degrees of Legendre's polynomials: offset and tilt, 0 and 1, are what a sheet does."""

_FIRST_SHAPE = RAY + len(Camera.PARAMETERS)

_NEGLIGIBLE = 1e-3
"""Largest second-order change of a line, in px, for which a neighbouring camera's rows will do."""


@dataclass(frozen=True, eq=False)
class ReducedLines:
    """The lines of all views, each reduced to 17 rows.

    Parameters
    ----------
    camera : Camera
        c₀, at which they were reduced.
    view, laser, face, slot : (L,) int array
        Whose they are; the slot numbers the lines of one view.
    counts : (L,) array
        Points of each line.
    roots : (L, 17, 17) array
        R, in units of the points' `LinePixels.proportions`.
    lines : (L, 3) array
        The fitted line ℓ̂ that the derivatives were taken across.
    ends : (L, 2, 3) array
        Rays of the line's ends.
    """

    camera: Camera
    view: np.ndarray
    laser: np.ndarray
    face: np.ndarray
    slot: np.ndarray
    counts: Array
    roots: Array
    lines: Array
    ends: Array

    def __len__(self) -> int:
        return len(self.view)

    @property
    def shapes(self) -> Array:
        """``(L, 17, 4)``: what a winding of 1 px rms does to the rows, by degree."""
        return self.roots[:, :, _FIRST_SHAPE:]

    def holds_for(self, camera: Camera) -> bool:
        """Whether the rows are good for another camera."""
        if camera.parameters is self.camera.parameters or camera == self.camera:
            return True
        rays = self.ends.reshape(-1, RAY)
        shift = np.abs(camera.project(rays) - self.camera.project(rays)).max(initial=0.0)
        return bool(shift**2 < _NEGLIGIBLE * self.camera.alpha)


@dataclass(frozen=True)
class LineRows:
    """The lines' misses at a state, and how they move.

    Parameters
    ----------
    bent : (L, 3) array
        The predicted lines ℓ̂, turned to the side of the reduced ones.
    misses : (L, 17) array
        R times the line and the camera's change: in standard uncertainties.
    by_sheet : (L, 2, 3) array
        How the line's two free parts – its turn and its offset – move with the laser's sheet.
    by_pose : (L, 2, 6) array
        The same by the board's pose.
    by_size : (L, 2, 1) array
        The same by the relative size of the board.
    turns : (L, 3, 2) array
        The line's changes that those parts stand for.
    """

    bent: Array
    misses: Array
    by_sheet: Array
    by_pose: Array
    by_size: Array
    turns: Array


_LATEST: WeakKeyDictionary[LinePixels, ReducedLines] = WeakKeyDictionary()
"""The last reduction of points that are still in use: adjustments follow each other at cameras
that hardly differ."""


def reduced_lines(line: LinePixels, camera: Camera) -> ReducedLines:
    """Reduce the points of lines at a camera, or at one so near that it makes no difference."""
    latest = _LATEST.get(line)
    if latest is None or not latest.holds_for(camera):
        latest = _LATEST[line] = _reduced(line, camera)
    return latest


def _reduced(line: LinePixels, camera: Camera) -> ReducedLines:
    rays = camera.unproject(line.uv)
    good = np.asarray(np.isfinite(rays).all(axis=-1))
    key = (line.view * (line.laser.max(initial=0) + 1) + line.laser) * (
        line.face.max(initial=0) + 1
    ) + line.face
    _, first, place = np.unique(key, return_index=True, return_inverse=True)
    weights = np.where(good, 1.0 / line.proportions, 0.0)
    rays = np.where(good[:, None], rays, 0.0)
    fitted = _fitted_lines(rays, weights, place, len(first))
    steep, by_camera = _across(camera, rays, fitted[place])
    ends, way = _extents(rays, good, fitted, place)
    shapes = np.stack([np.sqrt(2 * n + 1) * eval_legendre(n, way) for n in SHAPES], axis=1)
    parts = [rays, by_camera, shapes * steep[:, None]]
    rows = np.concatenate(parts, axis=1) * (weights / steep)[:, None]
    view = line.view[first]
    return ReducedLines(
        camera=camera,
        view=view,
        laser=line.laser[first],
        face=line.face[first],
        slot=np.arange(len(view)) - np.searchsorted(view, view),
        counts=np.bincount(place, good.astype(float), len(first)),
        roots=_triangles(rows, place, len(first)),
        lines=fitted,
        ends=ends,
    )


def _fitted_lines(rays: Array, weights: Array, place: np.ndarray, count: int) -> Array:
    """Weighted total least-squares lines ℓ̂ ``(count, 3)`` through the rays of each group."""
    squares = weights**2
    total = np.maximum(np.bincount(place, squares, count), 1e-300)
    x = np.bincount(place, squares * rays[:, 0], count) / total
    y = np.bincount(place, squares * rays[:, 1], count) / total
    dx, dy = rays[:, 0] - x[place], rays[:, 1] - y[place]
    spread = np.empty((count, 2, 2))
    spread[:, 0, 0] = np.bincount(place, squares * dx * dx, count)
    spread[:, 1, 1] = np.bincount(place, squares * dy * dy, count)
    spread[:, 0, 1] = spread[:, 1, 0] = np.bincount(place, squares * dx * dy, count)
    normal = np.linalg.eigh(spread)[1][:, :, 0]
    return np.column_stack([normal, -(normal[:, 0] * x + normal[:, 1] * y)])


def _across(camera: Camera, rays: Array, lines: Array) -> tuple[Array, Array]:
    """How fast ``ℓ̂ · r`` changes across the line, per px ``(P,)``, and with the camera's
    parameters for a given pixel ``(P, 10)``.

    Both at the foot of each point on its line: a point's noise is a number of pixels, which no
    change of the camera makes smaller.
    """
    off = np.sum(rays * lines, axis=1)
    foot = rays.copy()
    foot[:, :2] -= off[:, None] * lines[:, :2]
    _, by_point, by_parameter = camera.project_with_jacobians(foot)
    slope = np.linalg.solve(np.swapaxes(by_point[..., :2], 1, 2), lines[:, :2, None])[..., 0]
    return np.linalg.norm(slope, axis=1), -np.einsum("pi,pik->pk", slope, by_parameter)


def _triangles(rows: Array, place: np.ndarray, count: int) -> Array:
    """R ``(count, q, q)`` of the rows of each group."""
    sizes = np.bincount(place, minlength=count)
    most = max(int(sizes.max(initial=0)), rows.shape[1])
    order = np.argsort(place, kind="stable")
    starts = np.cumsum(sizes) - sizes
    padded = np.zeros((count, most, rows.shape[1]))
    padded[place[order], np.arange(len(place)) - starts[place[order]]] = rows[order]
    return np.asarray(np.linalg.qr(padded, mode="r"))


def _extents(rays: Array, good: np.ndarray, lines: Array, place: np.ndarray) -> tuple[Array, Array]:
    """Rays ``(L, 2, 3)`` of the first and the last point along each line, moved onto it, and
    where between them, from −1 to 1, each point ``(P,)`` is."""
    along = np.stack([-lines[:, 1], lines[:, 0]], axis=1)
    way = np.sum(rays[:, :2] * along[place], axis=1)
    least, most = np.full(len(lines), np.inf), np.full(len(lines), -np.inf)
    np.minimum.at(least, place[good], way[good])
    np.maximum.at(most, place[good], way[good])
    foot = -lines[:, 2:] * lines[:, :2]
    ends = foot[:, None] + np.stack([least, most], axis=1)[..., None] * along[:, None]
    half = np.maximum(0.5 * (most - least), 1e-300)[place]
    share = np.where(good, (way - 0.5 * (most + least)[place]) / half, 0.0)
    return np.concatenate([ends, np.ones((len(lines), 2, 1))], axis=2), share


def line_rows(reduced: ReducedLines, board: Board, state: RigState) -> LineRows:
    """What the lines miss by at a state.

    Parameters
    ----------
    reduced : ReducedLines
    board : Board
    state : RigState
        With sheets, and poses of stage board.
    """
    poses = state.poses["board"][reduced.view]
    faces = board.faces[reduced.face]
    normal, distance = state.frames[reduced.laser][:, :, 2], state.distances[reduced.laser]
    face = np.einsum("lij,lj->li", poses[:, :, :3], faces[:, :3])
    offset = faces[:, 3] + np.einsum("li,li->l", face, poses[:, :, 3])
    line = offset[:, None] * normal - distance[:, None] * face
    size = np.linalg.norm(line[:, :2], axis=1)
    side = np.where(np.sum(line[:, :2] * reduced.lines[:, :2], axis=1) < 0, -1.0, 1.0)
    scale = side / np.maximum(size, 1e-300)
    bent = line * scale[:, None]

    shift = state.camera.parameters - reduced.camera.parameters
    still = np.zeros(len(SHAPES))
    moved = np.broadcast_to(np.concatenate([shift, still]), (len(bent), len(shift) + len(still)))
    change = np.concatenate([bent, moved], axis=1)
    changes = (
        _by_sheet(state, reduced, face, offset),
        _by_pose(poses[:, :, 3], face, normal, distance),
        (faces[:, 3:] * normal)[..., None],
    )
    by_sheet, by_pose, by_size = (_parts(c * scale[:, None, None], bent) for c in changes)
    misses = (reduced.roots @ change[..., None])[..., 0]
    return LineRows(bent, misses, by_sheet, by_pose, by_size, free_parts(bent))


def free_parts(line: Array) -> Array:
    """The two ways ``(L, 3, 2)`` in which lines ℓ̂ ``(L, 3)`` can change: a turn, and an offset."""
    turns = np.zeros((len(line), 3, 2))
    turns[:, 0, 0], turns[:, 1, 0] = -line[:, 1], line[:, 0]
    turns[:, 2, 1] = 1.0
    return turns


def _parts(change: Array, line: Array) -> Array:
    """Changes of ℓ/s as changes of the two free parts of ℓ̂: ``(L, 3, k)`` to ``(L, 2, k)``."""
    along = np.stack([-line[:, 1], line[:, 0]], axis=1)
    turn = np.einsum("li,lik->lk", along, change[:, :2])
    grown = np.einsum("li,lik->lk", line[:, :2], change[:, :2])
    return np.stack([turn, change[:, 2] - line[:, 2:] * grown], axis=1)


def _by_sheet(state: RigState, reduced: ReducedLines, face: Array, offset: Array) -> Array:
    """Derivatives ``(L, 3, 3)`` of ``ℓ = c n − d m`` by tilt1, tilt2 and d of its sheet."""
    frames = state.frames[reduced.laser]
    return np.concatenate([offset[:, None, None] * frames[:, :, :2], -face[:, :, None]], axis=2)


def _by_pose(place: Array, face: Array, normal: Array, distance: Array) -> Array:
    """Derivatives ``(L, 3, 6)`` of ℓ by a turn ω of the board, ``dm = ω × m`` and ``dc = dm · t``,
    and by a shift of its origin t, ``dc = m · dt``."""
    turned = np.zeros((len(face), 3, 3))  # column k: e_k × m
    turned[:, 1, 0], turned[:, 2, 0] = -face[:, 2], face[:, 1]
    turned[:, 0, 1], turned[:, 2, 1] = face[:, 2], -face[:, 0]
    turned[:, 0, 2], turned[:, 1, 2] = -face[:, 1], face[:, 0]
    moved = np.einsum("li,lik->lk", place, turned)
    by_turn = normal[:, :, None] * moved[:, None] - distance[:, None, None] * turned
    by_shift = normal[:, :, None] * face[:, None]
    return np.concatenate([by_turn, by_shift], axis=2)


def off_sheet_patterns(reduced: ReducedLines, rows: LineRows) -> Array:
    """How the lines' two free parts move when either end lies 1 mm farther along the sheet's
    normal than it should, the other end staying: ``(L, 2, 2)``, an end a column."""
    ends = reduced.ends
    lift = rows.by_sheet[:, :, 2]
    # by how much the line passes beside each end, for a mm, and which parts do that
    shown = np.einsum("lei,lik->lek", ends, rows.turns)
    rise = np.einsum("lek,lk->le", shown, lift)
    inverse = np.linalg.inv(shown)
    return inverse * rise[:, None, :]
