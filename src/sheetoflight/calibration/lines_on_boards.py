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
from numpy.polynomial.legendre import legvander

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

_COLUMNS = _FIRST_SHAPE + len(SHAPES)

_DEGREES = 10
"""Legendre's polynomials that describe what is smooth along a line: a lens of Brown's kind bends
with the seventh power."""

_NODES = np.cos(np.pi * (np.arange(_DEGREES) + 0.5) / _DEGREES)
_TO_LEGENDRE = np.linalg.inv(legvander(_NODES, _DEGREES - 1))
_AT_NODES = legvander(_NODES, 1)
_SHAPES_AT_NODES = legvander(_NODES, max(SHAPES))[:, SHAPES] * np.sqrt(2 * np.array(SHAPES) + 1)

_NEGLIGIBLE = 1e-2
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
    nodes : (L, 10, 3) array
        Rays of ten places along the line.
    steep : (L, 10) array
        g at these.
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
    nodes: Array
    steep: Array

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
    by_bend : (L, 17, 3) array, optional
        How the misses move with the bend of the laser's sheet.
    """

    bent: Array
    misses: Array
    by_sheet: Array
    by_pose: Array
    by_size: Array
    turns: Array
    by_bend: Array | None = None


_LATEST: WeakKeyDictionary[LinePixels, ReducedLines] = WeakKeyDictionary()
"""The last reduction of points that are still in use: adjustments follow each other at cameras
that hardly differ."""


def reduced_lines(line: LinePixels, camera: Camera, rays: Array | None = None) -> ReducedLines:
    """Reduce the points of lines at a camera, or at one so near that it makes no difference.

    Parameters
    ----------
    line : LinePixels
    camera : Camera
    rays : (P, 3) array, optional
        The points' rays, where they are known already.
    """
    latest = _LATEST.get(line)
    if latest is None or not latest.holds_for(camera):
        rays = camera.unproject(line.uv) if rays is None else rays
        latest = _LATEST[line] = _reduced(line, camera, rays)
    return latest


def _reduced(line: LinePixels, camera: Camera, rays: Array) -> ReducedLines:
    groups = line.groups()
    fits = [_fitted(rays[own, 0], rays[own, 1], line.proportions[own]) for own in groups]
    lines = np.array([fit.line for fit in fits]).reshape(-1, RAY)
    reach = np.array([(fit.middle, fit.half) for fit in fits]).reshape(-1, 2)
    nodes = _feet(lines, reach[:, :1] + reach[:, 1:] * _NODES)
    turned, steep = _turned_into_columns(camera, lines, reach, nodes)
    products = [t.T @ fit.products(slow) @ t for fit, (slow, t) in zip(fits, turned, strict=True)]
    roots = _roots(np.array(products).reshape(len(fits), _COLUMNS, _COLUMNS))
    roots[:, :, :RAY] = roots[:, :, :RAY] @ np.swapaxes(_frames(lines), 1, 2)
    first = np.array([own[0] for own in groups], dtype=int)
    view = line.view[first]
    return ReducedLines(
        camera=camera,
        view=view,
        laser=line.laser[first],
        face=line.face[first],
        slot=np.arange(len(view)) - np.searchsorted(view, view),
        counts=np.array([float(len(fit.along)) for fit in fits]),
        roots=roots,
        lines=lines,
        ends=_feet(lines, reach[:, :1] + reach[:, 1:] * np.array([-1.0, 1.0])),
        nodes=nodes,
        steep=steep,
    )


@dataclass(frozen=True, eq=False)
class _FittedLine:
    """The points of one line: where along it, from −1 to 1, how far from it, and their weights."""

    line: Array
    along: Array
    off: Array
    weights: Array
    middle: float
    half: float

    def products(self, slow: Array) -> Array:
        """``(11, 11)`` products of the columns ``[off, P0 … P9] / (g σ)``, with Legendre's
        polynomials along the line, and 1/g by its coefficients ``slow``."""
        columns = np.empty((1 + _DEGREES, len(self.along)))
        columns[0] = self.off
        columns[1], columns[2] = 1.0, self.along
        for n in range(2, _DEGREES):
            previous = (n - 1) * columns[n - 1]
            columns[n + 1] = ((2 * n - 1) * self.along * columns[n] - previous) / n
        columns *= self.weights * (slow @ columns[1:])
        return columns @ columns.T


def _fitted(x: Array, y: Array, proportions: Array) -> _FittedLine:
    """The weighted total least-squares line ℓ̂ through points, those without a ray left out."""
    if not np.isfinite(x).all():
        there = np.isfinite(x)
        x, y, proportions = x[there], y[there], proportions[there]
    weights = 1.0 / proportions
    share = weights**2 / np.sum(weights**2)
    x0, y0 = share @ x, share @ y
    dx, dy = x - x0, y - y0
    angle = 0.5 * np.arctan2(2.0 * (share @ (dx * dy)), share @ (dx * dx - dy * dy))
    cosine, sine = np.cos(angle), np.sin(angle)
    along = x * cosine + y * sine
    low, high = along.min(), along.max()
    middle, half = 0.5 * (high + low), max(0.5 * (high - low), 1e-300)
    line = np.array([-sine, cosine, sine * x0 - cosine * y0])
    off = cosine * dy - sine * dx
    return _FittedLine(line, (along - middle) / half, off, weights, float(middle), float(half))


def _feet(lines: Array, along: Array) -> Array:
    """Rays ``(L, K, 3)`` of the points at given places ``(L, K)`` along lines ``(L, 3)``."""
    way = np.stack([lines[:, 1], -lines[:, 0]], axis=1)
    foot = -lines[:, 2:] * lines[:, :2]
    points = foot[:, None] + along[..., None] * way[:, None]
    return np.concatenate([points, np.ones((*along.shape, 1))], axis=2)


def _turned_into_columns(
    camera: Camera, lines: Array, reach: Array, feet: Array
) -> tuple[list[tuple[Array, Array]], Array]:
    """For each line the coefficients of 1/g, and the matrix ``(11, 17)`` that makes of
    `_FittedLine.products`' columns those of Z: place along the line, distance from it, 1, the
    camera's parameters, and the windings; and g at the feet ``(L, 10)``.

    g and the derivatives by the camera are taken at the feet of the points on their line: a
    point's noise is a number of pixels, which no change of the camera makes smaller. So they
    are smooth along the line, and known from ten places.
    """
    _, by_point, by_parameter = camera.project_with_jacobians(feet)
    right = np.broadcast_to(lines[:, None, :2, None], (*feet.shape[:2], 2, 1))
    slope = np.linalg.solve(np.swapaxes(by_point[..., :2], 2, 3), right)[..., 0]
    steep = np.linalg.norm(slope, axis=2)
    by_camera = _TO_LEGENDRE @ -np.einsum("lki,lkij->lkj", slope, by_parameter)
    windings = _TO_LEGENDRE @ (steep[..., None] * _SHAPES_AT_NODES)
    slow = (1.0 / steep) @ _TO_LEGENDRE.T
    found = []
    for number, (middle, half) in enumerate(reach):
        turned = np.zeros((1 + _DEGREES, _COLUMNS))
        turned[1, 0], turned[2, 0] = middle, half
        turned[0, 1] = turned[1, 2] = 1.0
        turned[1:, RAY:_FIRST_SHAPE] = by_camera[number]
        turned[1:, _FIRST_SHAPE:] = windings[number]
        found.append((slow[number], turned))
    return found, steep


def _frames(lines: Array) -> Array:
    """``(L, 3, 3)``: from a point's place along its line, its distance from it, and 1, to its ray.
    In these coordinates nothing cancels."""
    frames = np.zeros((len(lines), RAY, RAY))
    frames[:, 0, 0], frames[:, 1, 0] = lines[:, 1], -lines[:, 0]
    frames[:, :2, 1] = lines[:, :2]
    frames[:, :2, 2] = -lines[:, 2:] * lines[:, :2]
    frames[:, 2, 2] = 1.0
    return frames


def _roots(products: Array) -> Array:
    """R ``(L, q, q)`` with given products ``RᵀR``, by their eigenvectors: with columns of one
    length they lose nothing that matters."""
    size = np.sqrt(np.maximum(np.einsum("lqq->lq", products), 1e-300))
    values, vectors = np.linalg.eigh(products / size[:, :, None] / size[:, None, :])
    root = np.sqrt(np.maximum(values, 0.0))[:, :, None] * np.swapaxes(vectors, 1, 2)
    return root * size[:, None, :]


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
    by_bend = None
    if state.bends is not None:
        by_bend = -reduced.roots @ _bent_away(reduced, state, scale, face, offset)
        misses = misses + np.einsum("lqk,lk->lq", by_bend, state.bends.per_mm[reduced.laser])
    return LineRows(bent, misses, by_sheet, by_pose, by_size, free_parts(bent), by_bend)


def _bent_away(
    reduced: ReducedLines, state: RigState, scale: Array, face: Array, offset: Array
) -> Array:
    """``(L, 17, 3)``: what in the reduced columns a bend of 1/mm of the sheet does to the lines.

    Where the sheet is h above its plane, its image misses the plane's line by ``h (m · r)``, in
    the units of ``ℓ · r``. That is smooth along the line: a polynomial, whose first two degrees
    are an offset and a turn, and the others windings.
    """
    assert state.bends is not None
    rays = reduced.nodes
    depth = np.einsum("lki,li->lk", rays, face)
    points = rays * (offset[:, None] / depth)[..., None] - state.bends.centres[reduced.laser, None]
    x, y = np.moveaxis(points @ state.frames[reduced.laser][:, :, :2], 2, 0)
    heights = np.stack([0.5 * x * x, x * y, 0.5 * y * y], axis=2)
    off = heights * (scale[:, None] * depth)[..., None]
    design = np.concatenate(
        [
            np.broadcast_to(_AT_NODES, (len(rays), *_AT_NODES.shape)),
            reduced.steep[..., None] * _SHAPES_AT_NODES,
        ],
        axis=2,
    )
    parts = np.linalg.pinv(design) @ off
    along = np.stack([reduced.lines[:, 1], -reduced.lines[:, 0]], axis=1)
    low, high = (np.einsum("li,li->l", reduced.ends[:, e, :2], along) for e in (0, 1))
    turn = parts[:, 1] * (2.0 / (high - low))[:, None]
    away = np.zeros((len(rays), _COLUMNS, 3))
    away[:, :2] = along[:, :, None] * turn[:, None]
    away[:, 2] = parts[:, 0] - (0.5 * (high + low))[:, None] * turn
    away[:, _FIRST_SHAPE:] = parts[:, 2:]
    return away


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
