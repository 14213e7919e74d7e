"""What a simulated picture is: how it is to be taken, the task of rendering it, the result."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from sheetoflight.simulation.board_surface import Code
from sheetoflight.simulation.render import Picture, RenderOptions
from sheetoflight.simulation.rig import SimulatedRig
from sheetoflight.simulation.scene import Scene


@dataclass(frozen=True)
class ViewOptions:
    """How targets and bars are held before the camera, and lit in each stage.

    Parameters
    ----------
    render : RenderOptions
        Its ``ambient_level`` is replaced by the stage's.
    camera_ambient, plane_ambient, measure_ambient, board_ambient, crossing_ambient : float
        Brightness of white paint without laser, as a share of full scale. Where the laser is
        on, ambient light is dimmed so that the line stands out and does not saturate.
    max_tilt_deg : float
        Largest angle between a strip's surface normal and the direction to the camera – and,
        where the laser is on, to the projector. People do not hold a target edge-on.
    max_board_tilt_deg : float
        Largest angle between a board's normal and the line of sight to it.
    max_board_roll_deg : float
        Largest turn of a board about its normal, either way, from upright.
    margin_px : float
        Least distance of every marker's rim, and of a bar's ends, from the picture's edge, px.
    wall_gap_mm : float
        Distance of the wall behind the farthest point a target or bar may reach, mm.
    bar_width_mm : float
        Width of the measured bars, mm.
    clutter : int
        Number of things painted on the wall.
    pairs : bool
        Whether boards and crossing targets are taken twice, laser off and on, or once, with it on.
    codes : tuple of codes
        The coded markers of a charuco board, in the order of their numbers.
    """

    render: RenderOptions = field(default_factory=RenderOptions)
    camera_ambient: float = 180 / 255
    plane_ambient: float = 0.33
    measure_ambient: float = 0.12
    board_ambient: float = 0.33
    crossing_ambient: float = 0.33
    max_tilt_deg: float = 60.0
    max_board_tilt_deg: float = 50.0
    max_board_roll_deg: float = 30.0
    margin_px: float = 10.0
    wall_gap_mm: float = 100.0
    bar_width_mm: float = 30.0
    clutter: int = 0
    pairs: bool = True
    codes: tuple[Code, ...] = ()

    def lit(self, stage: str) -> RenderOptions:
        """How the pictures of a stage are rendered."""
        return replace(self.render, ambient_level=getattr(self, f"{stage}_ambient"))


@dataclass(frozen=True, eq=False)
class SimulatedPicture:
    """A rendered picture and what it shows.

    Parameters
    ----------
    stage : {"camera", "plane", "measure", "board", "crossing"}
    name : str
        File name without ending; pairs end in ``_off`` and ``_on``.
    image : (height, width) array of uint8 or uint16
    truth : dict
        See `PictureTask`.
    """

    stage: str
    name: str
    image: Picture
    truth: dict[str, Any]


@dataclass(frozen=True, eq=False)
class PictureTask:
    """All that is needed to render one picture, also in another process.

    Parameters
    ----------
    stage, view : str
        The view's name is common to both pictures of a pair.
    laser : bool or None
        On or off; None in a stage without laser.
    rig : SimulatedRig
    scene : Scene
    options : RenderOptions
    seed : int
    key : tuple of int
        The picture's place in the folder, which with the seed fixes its noise.
    truth : dict
        Plain lists and numbers: ``markers_uv`` (px) and ``markers_xyz`` (mm) of a target, with
        ``spots_uv`` and ``spots_xyz`` where it crosses the sheet; ``ends_uv``, ``ends_xyz`` and
        ``length_mm`` of a bar; ``points_uv``, ``points_xyz`` and ``camera_from_target``
        (``rotation``, ``translation_mm``) of a board, with ``line_uv`` and ``line_xyz``, the ends
        of the line on it.
    pair : bool
        Whether the view is taken twice, laser off and on.
    """

    stage: str
    view: str
    laser: bool | None
    rig: SimulatedRig
    scene: Scene
    options: RenderOptions
    seed: int
    key: tuple[int, ...]
    truth: dict[str, Any]
    pair: bool = True

    @property
    def name(self) -> str:
        """File name without ending."""
        if self.laser is None or not self.pair:
            return self.view
        return f"{self.view}_{'on' if self.laser else 'off'}"
