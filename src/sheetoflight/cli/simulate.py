"""``sol simulate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from sheetoflight.cli.telling import on_all_cores, tell
from sheetoflight.model.board import BoardKind, PlanarBoard
from sheetoflight.model.target import CollinearTarget
from sheetoflight.workflow.simulated import SimulationOptions
from sheetoflight.workflow.simulated import simulate as simulate_folder

_DEFAULT = SimulationOptions()
_BOARD = _DEFAULT.board


def simulate(
    folder: Path,
    /,
    *,
    seed: int = _DEFAULT.seed,
    camera_views: int = _DEFAULT.camera_views,
    plane_views: int = _DEFAULT.plane_views,
    bars_mm: Annotated[tuple[float, ...], Parameter(consume_multiple=True)] = tuple(
        _DEFAULT.bars_mm
    ),
    markers_mm: Annotated[
        tuple[float, ...], Parameter(consume_multiple=True)
    ] = _DEFAULT.target.markers_mm,
    marker: Literal["quadrant", "disc"] = _DEFAULT.target.marker,
    marker_size_mm: float = _DEFAULT.target.marker_size_mm,
    distortion: tuple[float, float, float, float, float] = _DEFAULT.distortion,
    clutter: int = _DEFAULT.clutter,
    bits: Literal[8, 16] = 8,
    board_views: int = _DEFAULT.board_views,
    crossing_views: int = _DEFAULT.crossing_views,
    board: BoardKind = _BOARD.kind,
    board_size: tuple[int, int] = (_BOARD.columns, _BOARD.rows),
    board_pitch_mm: tuple[float, float] = _BOARD.pitch_mm,
    staggered: bool = False,
    pairs: bool = _DEFAULT.pairs,
) -> None:
    """Render a rig folder with pictures of the paper's rig, and truth.json beside it.

    Parameters
    ----------
    folder
        The rig folder to write; new, empty, or of an earlier simulation.
    seed
        The same seed gives the same bytes.
    camera_views
        Pictures of the target pivoting about marker 0.
    plane_views
        Pairs of pictures of the target in the sheet of light.
    bars_mm
        Lengths of bars to be measured, one pair of pictures each.
    markers_mm
        Position of every marker from marker 0 in mm.
    marker
        quadrant: a disc in four black and white quarters. disc: a plain disc.
    marker_size_mm
        Diameter of a marker in mm.
    distortion
        k1 k2 p1 p2 k3.
    clutter
        Things painted on the wall.
    bits
        Bits a pixel.
    board_views
        Views of a board held across the sheet of light.
    crossing_views
        Views of the target that the sheet crosses at one point.
    board
        chessboard, circles, or charuco.
    board_size
        Columns and rows of the board's inner corners, or circles.
    board_pitch_mm
        Distance between neighbouring points along rows and columns in mm.
    staggered
        Shift every other row of circles by half of their distance.
    pairs
        Take boards and crossing targets with the laser off and on; or once, with it on.
    """
    options = SimulationOptions(
        camera_views=camera_views,
        plane_views=plane_views,
        bars_mm=bars_mm,
        target=CollinearTarget(markers_mm, marker=marker, marker_size_mm=marker_size_mm),
        distortion=distortion,
        clutter=clutter,
        bits=bits,
        seed=seed,
        board_views=board_views,
        crossing_views=crossing_views,
        board=PlanarBoard(board, *board_size, board_pitch_mm, staggered=staggered),
        pairs=pairs,
    )
    with on_all_cores() as run:
        simulate_folder(folder, options, run)
    tell(f"written to {folder}")
