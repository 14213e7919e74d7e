"""Drawings of printed boards with known points, independent of the package's own code."""

from __future__ import annotations

import cv2
import numpy as np

from tests.imaging.drawing import homography, mapped

BLACK, WHITE, WALL = 25.0, 190.0, 90.0


def view(board, *, focal=900.0, size=(640, 480), distance=400.0, tilt=0.0, spin=0.0, roll=0.0,
         shift=(0.0, 0.0)):  # fmt: skip
    """Homography from the board's x, y in mm to px, the board's middle in the picture's."""
    middle = board.points[:, :2].mean(axis=0) + shift
    centre = ((size[0] - 1) / 2, (size[1] - 1) / 2)
    to_middle = np.array([[1, 0, -middle[0]], [0, 1, -middle[1]], [0, 0, 1.0]])
    return homography(focal, distance, centre, tilt, spin, roll) @ to_middle


def truth(matrix, board):
    """Image points ``(M, 2)`` of the board's points."""
    return mapped(matrix, board.points[:, :2])


def _squares(xy, board, margin):
    """Column and row of the square, and whether it is on the pattern and on the board at all."""
    pitch = np.array(board.pitch_mm)
    cell = np.floor(xy / pitch).astype(int)
    last = np.array([board.columns, board.rows])
    pattern = np.all((cell >= -1) & (cell < last), axis=-1)
    paper = np.all((xy > -(1 + margin) * pitch) & (xy < (last + margin) * pitch), axis=-1)
    return cell + 1, pattern, paper


def chessboard(xy, board, margin=0.7):
    """Grey value at board coordinates, the first square black; NaN off the board."""
    cell, pattern, paper = _squares(xy, board, margin)
    value = np.where(pattern & (cell.sum(axis=-1) % 2 == 0), BLACK, WHITE)
    return np.where(paper, value, np.nan)


def charuco(xy, board, margin=0.7, light_first=False):
    """A chessboard with markers in its light squares, numbered row by row."""
    cell, pattern, paper = _squares(xy, board, margin)
    light = pattern & (cell.sum(axis=-1) % 2 == (0 if light_first else 1))
    value = np.where(pattern & ~light, BLACK, WHITE)
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
    bits = dictionary.markerSize + 2
    row, column = np.indices((board.rows + 1, board.columns + 1))
    marked = (row + column) % 2 == (0 if light_first else 1)
    number = np.cumsum(marked.ravel()).reshape(marked.shape) - 1
    markers = np.stack(
        [cv2.aruco.generateImageMarker(dictionary, n, bits) for n in range(number.max() + 1)]
    )
    pitch, side = np.array(board.pitch_mm), board.marker_side
    place = np.floor((xy[light] - (cell[light] - 0.5) * pitch + side / 2) / side * bits).astype(int)
    on = np.all((place >= 0) & (place < bits), axis=-1)
    of_cell = number[cell[light][:, 1], cell[light][:, 0]]
    bit = markers[of_cell[on], place[on][:, 1], place[on][:, 0]]
    painted = value[light]
    painted[on] = np.where(bit > 127, WHITE, BLACK)
    value[light] = painted
    return np.where(paper, value, np.nan)


def circles(xy, board, margin=0.7, light=False):
    """A grid of dark circles on light paper, or the reverse; NaN off the board."""
    points = board.points[:, :2]
    covered = np.zeros(xy.shape[:-1], dtype=bool)
    room = (1 + margin) * np.array(board.pitch_mm)
    low, high = points.min(axis=0) - room, points.max(axis=0) + room
    paper = np.all((xy > low) & (xy < high), axis=-1)
    lattices = [points.reshape(board.rows, board.columns, 2)]
    if board.staggered:
        lattices = [lattices[0][::2], lattices[0][1::2]]
    for lattice in lattices:
        first, step = lattice[0, 0], lattice[1, 1] - lattice[0, 0]
        last = np.array([lattice.shape[1] - 1, lattice.shape[0] - 1])
        nearest = np.clip(np.rint((xy[paper] - first) / step), 0, last)
        away = np.linalg.norm(xy[paper] - first - nearest * step, axis=-1)
        covered[paper] |= away <= board.circle_diameter / 2
    ink, ground = (WHITE, BLACK) if light else (BLACK, WHITE)
    return np.where(paper, np.where(covered, ink, ground), np.nan)


PATTERNS = {"chessboard": chessboard, "circles": circles, "charuco": charuco}


def light_of(board, matrix, *, size=(640, 480), blur=0.8, samples=5, laser=None, under=None, **how):
    """A picture ``(H, W)`` in grey values, without noise.

    ``laser``: (point on it, angle, sigma in px, grey values), a straight line across the picture;
    ``under``: what is behind the board.
    """
    width, height = size
    fine = (np.arange(samples) + 0.5) / samples - 0.5
    u = (np.arange(width)[:, None] + fine).ravel()
    v = (np.arange(height)[:, None] + fine).ravel()
    grid = np.stack(np.meshgrid(u, v), axis=-1)
    # Rows and columns of samples are shifted against each other by the golden section: a plain
    # grid would put an edge that runs along it at the nearest row of samples.
    shift = np.mod(np.arange(max(grid.shape[:2])) * 0.6180339887, 1.0) - 0.5
    grid[..., 0] += shift[: grid.shape[0], None] / samples
    grid[..., 1] += shift[None, : grid.shape[1]] / samples
    inverse = np.linalg.inv(matrix)
    w = grid @ inverse[:, :2].T + inverse[:, 2]
    value = PATTERNS[board.kind](w[..., :2] / w[..., 2:], board, **how)
    behind = np.full((height, width), WALL) if under is None else under
    value = np.where(np.isnan(value), np.kron(behind, np.ones((samples, samples))), value)
    if blur:
        value = cv2.GaussianBlur(value, (0, 0), blur * samples)
    value = value.reshape(height, samples, width, samples).mean(axis=(1, 3))
    if laser is not None:
        (u0, v0), angle, sigma, peak = laser
        v, u = np.indices(value.shape)
        across = -(u - u0) * np.sin(angle) + (v - v0) * np.cos(angle)
        value = value + peak * np.exp(-0.5 * (across / sigma) ** 2)
    return value


def photographed(light, *, noise=1.5, seed=0):
    """What an 8-bit camera makes of a picture's light."""
    noisy = light + np.random.default_rng(seed).normal(0.0, noise, light.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def draw(board, matrix, *, noise=1.5, seed=0, **how):
    """An 8-bit picture of a board."""
    return photographed(light_of(board, matrix, **how), noise=noise, seed=seed)
