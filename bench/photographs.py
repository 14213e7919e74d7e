"""Other people's photographs of boards and laser lines, calibrated as a user would.

Nothing is set but the board's geometry; the photographs lie in a folder of their own, for most of
them state no licence. Prints each camera with its standard uncertainties beside the published
one, each sheet of light beside another person's or another program's, and how far each line lies
off its board when it is triangulated with a sheet that was calibrated without it.
Run with ``python -m bench.photographs FOLDER [--all]``; ``--all`` takes the 121 pictures of
srv_desktop/laser too, which last a quarter of an hour.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from rich.console import Console
from rich.table import Table

from sheetoflight.calibration.board_screening import screened_boards
from sheetoflight.calibration.methods import calibrate
from sheetoflight.errors import SheetOfLightError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.camera import Camera
from sheetoflight.model.rig import Rig
from sheetoflight.report.numbers import rounded
from sheetoflight.workflow.rig_folder import load_rig


@dataclass(frozen=True)
class Photographs:
    """One folder of pictures, what is seen there, and what others found.

    Parameters
    ----------
    folder : str
    columns, rows : int
        Inner corners of the chessboard.
    pitch_mm : float
    turned : bool
        Whether they are stored transposed and flipped.
    camera : Camera, optional
        Known, and taken as exact.
    published : tuple of float, optional
        alpha, beta, u0, v0 in px that the pictures' own authors found.
    sheet : (nx, ny, nz, d), optional
        ``n · X = d``, d in mm: single OpenCV runs on the same pictures, which have errors too.
    """

    folder: str
    columns: int
    rows: int
    pitch_mm: float
    turned: bool = False
    camera: Camera | None = None
    published: tuple[float, float, float, float] | None = None
    sheet: tuple[float, float, float, float] | None = None


PUBLISHED = ("alpha", "beta", "u0", "v0")

# the cameras are those that the pictures' authors published beside them
CICLOP = (1430.39147, 1429.66307, 636.40393, 478.03271)
SRV = (620.27, 618.61, 322.95, 239.42)
HJAMAL = Camera(
    (640, 480),
    514.41205,
    685.92876,
    329.83671,
    237.71471,
    distortion=(-0.350373, 0.158447, 0.000735, -0.000231, 0.0),
)

SETS = (
    Photographs("ciclop_3dscanscience/camera", 11, 6, 13.0, turned=True, published=CICLOP),
    Photographs("srv_desktop/camera", 8, 6, 40.0, published=SRV),
    Photographs(
        "hjamal_green", 6, 8, 40.0, camera=HJAMAL, sheet=(-0.99988, -0.01436, -0.00528, 39.376)
    ),
    Photographs("etna_robot/calib2", 7, 6, 10.0, sheet=(-0.8370, -0.1204, 0.5339, 98.92)),
    Photographs("etna_robot/set0", 7, 6, 10.0, sheet=(0.7897, 0.0588, 0.6107, 179.90)),
)

LONG = (Photographs("srv_desktop/laser", 8, 6, 40.0, sheet=(0.90597, -0.13929, 0.39977, 165.46)),)


def photographed(pictures: Photographs, root: Path) -> Rig:
    """The rig of a folder of photographs, its boards and lines detected."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        board = folder / "board"
        board.mkdir()
        for path in sorted((root / pictures.folder).iterdir()):
            if path.suffix not in (".jpg", ".png"):
                continue
            if pictures.turned:
                stored = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
                assert stored is not None
                cv2.imwrite(str(board / f"{path.stem}.png"), cv2.flip(cv2.transpose(stored), 1))
            else:
                (board / path.name).symlink_to(path.resolve())
        (folder / "rig.toml").write_text(
            f'[board]\nkind = "chessboard"\ncolumns = {pictures.columns}\nrows = {pictures.rows}\n'
            f"pitch_mm = [{pictures.pitch_mm}, {pictures.pitch_mm}]\n"
        )
        rig = load_rig(folder)
    return rig if pictures.camera is None else replace(rig, camera=pictures.camera)


def with_lines(rig: Rig, kept: np.ndarray) -> Rig:
    """The rig with some of the points of its lines."""
    views = rig.observations.board
    views = replace(views, line=views.line.take(kept))
    return replace(rig, observations=replace(rig.observations, board=views))


def left_out_heights(rig: Rig) -> Iterator[float]:
    """Mean height in mm of each view's line above its board, by the sheet of all other views.

    Parameters
    ----------
    rig : Rig
        Without what of the lines does not lie on the boards.
    """
    line, names = rig.observations.board.line, rig.observations.board.names
    for view in np.unique(line.view):
        own = line.view == view
        try:
            found = calibrate(with_lines(rig, ~own))
        except SheetOfLightError:
            continue
        placed = [v.xyz for v in found.residuals.views if v.view == names[view]]
        if placed and found.light_planes:
            normal, offset = fitted_plane(placed[0])
            yield float(np.mean(found.triangulate(line.uv[own]) @ normal - offset))


def fitted_plane(points: Array) -> tuple[Array, float]:
    """Normal and distance of the plane through points ``(N, 3)``, by least squares."""
    points = points[np.isfinite(points).all(axis=1)]
    middle = points.mean(axis=0)
    normal = np.linalg.svd(points - middle, full_matrices=False)[2][2]
    offset = float(normal @ middle)
    return (normal, offset) if offset >= 0 else (-normal, -offset)


def compared_sheet(found: Calibration, reference: Array, uv: Array) -> str:
    """Angle and distance from another sheet, with what is stated of them."""
    normal, distance = fitted_plane(found.triangulate(uv))
    sine = np.linalg.norm(np.cross(normal, reference[:3]))
    angle = np.degrees(np.arctan2(sine, normal @ reference[:3]))
    turns = found.covariance.block(tuple(f"laser.{part}" for part in ("nx", "ny", "nz")))
    stated = np.degrees(np.sqrt(np.trace(turns))), found.covariance.std("laser.d")
    return (
        f"{angle:.3f}° and {distance - reference[3]:+.2f} mm from the reference; stated "
        f"± {stated[0]:.3f}° and ± {stated[1]:.2f} mm"
    )


def camera_table(name: str, found: Calibration, published: tuple[float, ...] | None) -> Table:
    """What was estimated of camera and sheet, with standard uncertainties."""
    table = Table(title=f"{name}: {len(found.residuals.views)} views")
    for heading in ("parameter", "value", "standard uncertainty", "published"):
        table.add_column(heading, justify="left" if heading == "parameter" else "right")
    others: dict[str, float] = dict(zip(PUBLISHED, published or (), strict=False))
    camera = found.camera
    values = {f"camera.{p}": v for p, v in zip(camera.PARAMETERS, camera.parameters, strict=True)}
    for plane in found.light_planes:
        values |= plane.parameters
    for parameter in found.covariance.parameters:
        if parameter.startswith("camera.") and not found.covariance.std(parameter):
            continue  # known
        other = others.get(parameter.rpartition(".")[2])
        said = "" if other is None else f"{other:.3f}"
        text = rounded(float(values[parameter]), found.covariance.std(parameter))
        table.add_row(parameter, *text, said)
    return table


def report(pictures: Photographs, root: Path, console: Console) -> None:
    """Print all that there is of one folder."""
    rig = photographed(pictures, root)
    found = calibrate(rig)
    console.print(camera_table(pictures.folder, found, pictures.published))
    for warning in found.warnings:
        if "is curved" in warning:
            console.print(warning, highlight=False)
    if not found.light_planes:
        console.print()
        return
    rig = screened_boards(rig).rig
    line = rig.observations.board.line
    if pictures.sheet is not None:
        console.print(compared_sheet(found, np.array(pictures.sheet), line.uv), highlight=False)
    heights = np.abs(list(left_out_heights(rig)))
    console.print(
        f"{len(line.groups())} lines; heights above the board of {len(heights)}, each by a sheet "
        f"without it: median {np.median(heights):.3f} mm, 90 % within "
        f"{np.quantile(heights, 0.9):.3f} mm\n",
        highlight=False,
    )


def main(*words: str) -> None:
    """Print the tables."""
    folders = [word for word in words if not word.startswith("-")]
    if len(folders) != 1:
        sys.exit("give the folder that holds the photographs, and --all for the long ones too")
    console = Console(width=100)
    for pictures in (*SETS, *(LONG if "--all" in words else ())):
        report(pictures, Path(folders[0]), console)


if __name__ == "__main__":
    main(*sys.argv[1:])
