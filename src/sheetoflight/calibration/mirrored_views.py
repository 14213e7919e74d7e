"""Pictures of boards that were mirrored or turned upside down before they were handed in.

A mirrored chessboard is a chessboard, and a board turned upside down is one held otherwise: the
points of such a view fit nearly as well as they are, and pull the camera's principal point over.
But its line of light lies in no sheet with the others'. Put back as it was taken, view and line
fit; that this happens by chance, to a line that was wrong, is told by two numbers, its place and
its direction, each of which must come right to a hundredth of what it could be.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sheetoflight.calibration.board_planes import faces_in_space, planes_on_boards, point_errors
from sheetoflight.calibration.board_start import boards_alone
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.errors import UntrustworthyError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board import PlanarBoard
from sheetoflight.model.board_views import BoardViews
from sheetoflight.model.camera import Camera
from sheetoflight.model.observations import Observations
from sheetoflight.model.rig import Rig

_FEWEST = 3
"""Other views that tell camera and sheet."""

_AS_WELL = 2.0
"""How many times the others' residuals those of a view's points may be, put back, if they are not
the less for it."""

_LINE_FACTOR = 3.0
"""How many times the others' median a line's distance from the sheet's image may be, put back."""

_LEAST_PX = 3.0
"""Distance that is no reason to doubt."""

_WORSE_POINTS = 1.3
"""How many times larger the points' residuals are as they stand, where the sheet lies so that its
lines are changed little."""

_ROUNDING_PX = 1e-4


@dataclass(frozen=True)
class _Change:
    """A change of pictures, which undoes itself.

    Parameters
    ----------
    in_words : str
    left_right, up_down : bool
        Which coordinates are reversed.
    """

    in_words: str
    left_right: bool
    up_down: bool

    @property
    def mirrors(self) -> bool:
        """Whether the axes of what is seen turn the other way."""
        return self.left_right != self.up_down

    def of_pixels(self, uv: Array, size: tuple[int, int]) -> Array:
        """Where image points ``(..., 2)`` px of pictures of a size come to lie."""
        ends = np.array(size) - 1.0
        return np.where([self.left_right, self.up_down], ends - uv, uv)

    def of_views(self, views: BoardViews, board: PlanarBoard, size: tuple[int, int]) -> BoardViews:
        """The views as they were before the change."""
        numbers = np.arange(len(board.points)).reshape(board.rows, board.columns)
        order = (numbers[:, ::-1] if self.mirrors else numbers).ravel()
        line = replace(views.line, uv=self.of_pixels(views.line.uv, size))
        uv = self.of_pixels(views.uv[:, order], size)
        return replace(views, uv=uv, std=views.stds[:, order], line=line)


_CHANGES = (
    _Change("mirrored", True, False),
    _Change("mirrored", False, True),
    _Change("turned upside down", True, True),
)


def mirrored_views(rig: Rig, lined: Rig) -> dict[str, str]:
    """Views of flat boards whose line comes into the others' sheet when the picture is put back.

    Parameters
    ----------
    rig : Rig
        With all lines.
    lined : Rig
        With the same views, and the lines that lie in the sheets.

    Returns
    -------
    dict from view to str
        What is wrong with it, in words.
    """
    views, rest = rig.observations.board, lined.observations.board
    lost = np.isin(np.arange(len(views)), views.line.view)
    lost &= ~np.isin(np.arange(len(views)), rest.line.view)
    if not lost.any() or (~lost).sum() < _FEWEST or not isinstance(rig.board, PlanarBoard):
        return {}
    others = _Others.of(_with(lined, rest.take(~lost)))
    if others is None:
        return {}
    found = ((k, others.change_of(views.take(np.array([k])))) for k in np.flatnonzero(lost))
    return {
        views.names[k]: f"view {views.names[k]} of stage board (the picture is {change.in_words})"
        for k, change in found
        if change is not None
    }


@dataclass(frozen=True)
class _Agreement:
    """Root mean square residual of a view's points and greatest miss of its lines, px."""

    residual: float
    miss: float

    @property
    def total(self) -> float:
        """Both, to compare changes that explain a view."""
        return self.residual + self.miss

    def clearly_worse_than(self, other: _Agreement) -> bool:
        """Whether points and line both say so."""
        return (
            self.residual > _WORSE_POINTS * other.residual and self.miss > _LINE_FACTOR * other.miss
        )


_NONE = _Agreement(np.inf, np.inf)


@dataclass(frozen=True)
class _Others:
    """The views that agree, with the camera and the sheets that they give."""

    rig: Rig
    camera: Camera
    planes: list[tuple[Array, float] | None]
    typical: _Agreement

    @classmethod
    def of(cls, rig: Rig) -> _Others | None:
        """None where they give no sheet."""
        state = boards_alone(rig).state
        planes = planes_on_boards(rig, state)
        misses = _misses(rig, state, planes)
        if not len(misses):
            return None
        typical = _Agreement(_residual_px(rig, state), float(np.median(misses)))
        return cls(rig, state.camera, planes, typical)

    def change_of(self, view: BoardViews) -> _Change | None:
        """The change that explains why a view's line is not in the sheet."""
        board = self.rig.board
        assert isinstance(board, PlanarBoard)
        as_is = self._agreement(view)
        best, least = None, _NONE
        for change in _CHANGES:
            if change.mirrors and (board.staggered or board.kind == "charuco"):
                continue  # its reading would have failed
            back = self._agreement(change.of_views(view, board, self.rig.image_size))
            if self._explains(as_is, back) and back.total < least.total:
                best, least = change, back
        return best

    def _explains(self, as_is: _Agreement, back: _Agreement) -> bool:
        """Whether a view agrees when put back, and does not as it is."""
        limit = max(_AS_WELL * max(self.typical.residual, _ROUNDING_PX), as_is.residual)
        if back.residual > limit or not self._near(back):
            return False
        return not self._near(as_is) or as_is.clearly_worse_than(back)

    def _near(self, one: _Agreement) -> bool:
        return one.miss <= max(_LINE_FACTOR * self.typical.miss, _LEAST_PX)

    def _agreement(self, view: BoardViews) -> _Agreement:
        """How a view and its lines fit to the others'."""
        alone = replace(_with(self.rig, view), camera=self.camera)
        try:
            state = boards_alone(alone).state
        except UntrustworthyError:
            return _NONE
        misses = _misses(alone, state, self.planes)
        return _Agreement(_residual_px(alone, state), float(misses.max(initial=0.0)))


def _with(rig: Rig, views: BoardViews) -> Rig:
    return replace(rig, observations=Observations(board=views))


def _residual_px(rig: Rig, state: RigState) -> float:
    """Root mean square of the points' reprojection errors."""
    return float(np.sqrt(np.nanmean(point_errors(rig, state) ** 2)))


def _misses(rig: Rig, state: RigState, planes: list[tuple[Array, float] | None]) -> Array:
    """``(L,)``: the median distance of each line's points, px, from the image of the line in which
    its sheet meets the board (`lines_on_boards`); lines of unknown sheets left out."""
    assert rig.board is not None
    line = rig.observations.board.line
    focal = 0.5 * (state.camera.alpha + state.camera.beta)
    misses = []
    for own in line.groups():
        first = own[:1]
        plane = planes[int(line.laser[first[0]])]
        if plane is None:
            continue
        poses = state.poses["board"]
        face, offset = faces_in_space(rig.board, poses, line.view[first], line.face[first])
        image = offset[0] * plane[0] - plane[1] * face[0]
        off = state.camera.unproject(line.uv[own]) @ image / np.linalg.norm(image[:2])
        misses.append(focal * float(np.nanmedian(np.abs(off))))
    return np.array(misses)
