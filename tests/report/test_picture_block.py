"""Measured pictures on the page: lengths, marks, and what is refused."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.report.contents import MeasuredPicture
from sheetoflight.report.picture_block import picture_blocks
from tests.report.examples import line_piece, measured


def test_whole_pieces_have_a_length_with_its_interval(calibration, picture):
    """The piece was drawn 150 mm long; its ends are the exact image points."""
    (block,) = picture_blocks(calibration, [picture])
    (row,) = block.rows
    assert block.left_out == 1
    assert (row.number, row.segment, row.points) == (1, "bar-1", len(picture.pieces[0]))
    assert float(row.length) == pytest.approx(150.0, abs=0.006)
    ends = picture.pieces[0].ends
    single = calibration.length(ends[0], ends[1], 0.25)
    assert float(row.std) == pytest.approx(single.std, abs=0.006)
    assert [float(row.low), float(row.high)] == pytest.approx(single.interval, abs=0.006)


def test_pieces_are_numbered_as_the_file_of_lengths_numbers_them(calibration, picture):
    """A piece without a length has no number in either."""
    whole, leaving = picture.pieces
    pieces = (leaving, whole, leaving, whole)
    segments = measured(calibration, (whole, whole))
    (block,) = picture_blocks(calibration, [replace(picture, pieces=pieces, segments=segments)])
    assert [(row.number, row.segment) for row in block.rows] == [(1, "bar-1"), (2, "bar-2")]
    assert [mark.number for mark in block.marks[::2]] == [None, 1, None, 2]
    assert block.plot
    drawn = [trace["name"] for trace in json.loads(block.plot.json)["data"]]
    assert drawn[:4] == ["piece without a length", "piece 1", "piece without a length", "piece 2"]


def test_ends_are_marked_and_their_numbers_stay_in_the_picture(calibration, picture):
    corners = np.array([[2.0, 3.0], [1390.0, 3.0], [1390.0, 1037.0], [2.0, 1037.0]])
    pieces = tuple(line_piece(corners[[i, i - 1]]) for i in range(4))
    segments = measured(calibration, pieces)
    (block,) = picture_blocks(calibration, [replace(picture, pieces=pieces, segments=segments)])
    assert len(block.marks) == 8
    for mark, end in zip(block.marks, [end for p in pieces for end in p.ends], strict=True):
        assert (mark.u, mark.v) == tuple(end)
        assert 0 < mark.text_u < block.width - block.text_size / 2
        assert block.text_size / 2 < mark.text_v < block.height
    assert [mark.number for mark in block.marks] == [1, 1, 2, 2, 3, 3, 4, 4]


def test_a_picture_without_pieces_has_no_lengths_and_no_figure(calibration):
    bare = MeasuredPicture("bare", np.zeros((1040, 1392), np.uint8))
    (block,) = picture_blocks(calibration, [bare])
    assert (block.rows, block.marks, block.left_out, block.plot) == ((), (), 0, None)


def test_a_picture_of_another_size_is_refused(calibration):
    other = MeasuredPicture("small.png", np.zeros((480, 640), np.uint8))
    with pytest.raises(InputError, match=r"small.png has 640 × 480 pixels.*1392 × 1040"):
        picture_blocks(calibration, [other])


def test_each_picture_has_a_figure_of_its_own(calibration, picture):
    blocks = picture_blocks(calibration, [picture, replace(picture, name="second")])
    ids = [block.plot.id for block in blocks if block.plot]
    assert len(set(ids)) == 2
