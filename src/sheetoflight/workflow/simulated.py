"""A rig folder of rendered pictures, with the truth beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import isfinite
from pathlib import Path
from typing import Any

from sheetoflight.errors import InputError
from sheetoflight.io.documents import write_json
from sheetoflight.io.folders import made_folder, put_in_place, working_folder
from sheetoflight.io.pictures import write_picture
from sheetoflight.io.rig_toml import write_rig_toml
from sheetoflight.model.board import Board, PlanarBoard
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.board_poses import SHEET_OF_PAPER
from sheetoflight.simulation.board_surface import Code
from sheetoflight.simulation.render import RenderOptions
from sheetoflight.simulation.rig import SimulatedRig, paper_rig
from sheetoflight.simulation.views import (
    PictureTask,
    ViewOptions,
    folder_truth,
    picture_tasks,
    render_task,
)
from sheetoflight.workflow.spread import ALONE, Execution, spread

TRUTH = "truth.json"
_MADE_HERE = frozenset(
    ("rig.toml", "points.csv", TRUTH, "camera", "plane", "measure", "board", "crossing")
)

TABLE_2_MM = (150.0, 150.0, 300.0, 300.0, 450.0, 450.0)
TABLE_4_MM = (20.0, 20.0, 20.0, 40.0, 40.0, 60.0)
"""The lengths that the paper measures in its Tables 2 and 4."""


_COUNTS = ("camera_views", "plane_views", "clutter", "seed", "board_views", "crossing_views")


@dataclass(frozen=True)
class SimulationOptions:
    """What is simulated: the paper's rig, seen in so many pictures.

    Parameters
    ----------
    camera_views, plane_views : int
        Pictures of the pivoting target, and of the target in the sheet of light.
    bars_mm : sequence of float
        Lengths of the bars to be measured, one pair of pictures each.
    target : CollinearTarget
    distortion : (k1, k2, p1, p2, k3)
    clutter : int
        Number of things painted on the wall.
    bits : {8, 16}
    seed : int
    board_views, crossing_views : int
        Views of a board held across the sheet, and of the target that the sheet crosses.
    board : PlanarBoard
    pairs : bool
        Whether these views are taken twice, laser off and on, or once, with it on.

    Raises
    ------
    InputError
        If a number is negative, or a bar has no length.
    """

    camera_views: int = 30
    plane_views: int = 10
    bars_mm: Sequence[float] = TABLE_2_MM
    target: CollinearTarget = field(default_factory=CollinearTarget)
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
    clutter: int = 12
    bits: int = 8
    seed: int = 0
    board_views: int = 0
    crossing_views: int = 0
    board: PlanarBoard = SHEET_OF_PAPER
    pairs: bool = True

    def __post_init__(self) -> None:
        for name in _COUNTS:
            if getattr(self, name) < 0:
                raise InputError(f"{name} is {getattr(self, name)}", "give 0 or more")
        if not all(isfinite(length) and length > 0 for length in self.bars_mm):
            raise InputError(
                f"the bars' lengths are {list(self.bars_mm)} mm", "give lengths above zero"
            )


def simulate(
    folder: str | Path,
    options: SimulationOptions | None = None,
    run: Execution = ALONE,
) -> dict[str, Any]:
    """Render a rig folder: pictures, ``rig.toml`` and ``truth.json``.

    Returns
    -------
    dict
        The content of ``truth.json``.

    Raises
    ------
    InputError
        If the folder holds something that a simulation did not make, or the views cannot be.
    FileError
        If a file cannot be written.
    """
    folder, options = Path(folder), options or SimulationOptions()
    truth_rig = _truth_rig(options)
    view_options = ViewOptions(
        render=replace(RenderOptions(), bits=options.bits),
        clutter=options.clutter,
        pairs=options.pairs,
        codes=_codes(truth_rig.board),
    )
    tasks = picture_tasks(
        truth_rig,
        options.camera_views,
        options.plane_views,
        options.bars_mm,
        view_options,
        options.seed,
        options.board_views,
        options.crossing_views,
    )
    _refuse_foreign(folder)
    truth = folder_truth(truth_rig, tasks)
    made_folder(folder.parent)
    with working_folder(folder) as work:
        for stage in dict.fromkeys(task.stage for task in tasks):
            made_folder(work / stage)
        jobs = [(task, work / task.stage / f"{task.name}.png") for task in tasks]
        for _ in spread(_rendered, jobs, "render", run):
            pass
        write_rig_toml(work / "rig.toml", _known(truth_rig, options))
        write_json(work / TRUTH, truth)
        put_in_place(work, folder, _MADE_HERE)
    return truth


def _rendered(job: tuple[PictureTask, Path]) -> None:
    task, path = job
    write_picture(path, render_task(task).image)


def _truth_rig(options: SimulationOptions) -> SimulatedRig:
    rig = paper_rig(options.distortion, options.target)
    return replace(rig, board=options.board) if options.board_views else rig


def _codes(board: Board | None) -> tuple[Code, ...]:
    if not isinstance(board, PlanarBoard) or board.kind != "charuco":
        return ()
    from sheetoflight.imaging.marker_codes import marker_codes

    return marker_codes(board)


def _known(rig: SimulatedRig, options: SimulationOptions) -> Rig:
    """What the person who calibrates knows of the rig."""
    model = "none" if not any(options.distortion) else "radial2"
    if any(options.distortion[2:]):
        model = "brown"
    return Rig(rig.target, rig.camera.image_size, distortion=model, board=rig.board)


def _refuse_foreign(folder: Path) -> None:
    """An earlier simulation may be replaced, nothing else."""
    if not folder.is_dir():
        return
    present = {path.name for path in folder.iterdir()}
    if present and TRUTH not in present:
        raise InputError(
            f"{folder} holds {', '.join(sorted(present)[:3])} and no {TRUTH}, so no simulation "
            "made it",
            "name a new or empty folder",
        )
