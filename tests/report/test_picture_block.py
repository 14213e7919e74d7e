"""Measured pictures on the page: lengths, marks, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.report.contents import MeasuredPicture
from sheetoflight.report.picture_block import picture_blocks
from tests.report.examples import line_piece


def test_whole_pieces_have_a_length_with_its_interval(calibration, picture):
    """The piece was drawn 150 mm long; its ends are the exact image points."""
    (block,) = picture_blocks(calibration, [picture])
    (row,) = block.rows
    assert block.left_out == 1
    assert (row.number, row.points) == (1, len(picture.pieces[0]))
    assert float(row.length) == pytest.approx(150.0, abs=0.006)
    ends = picture.pieces[0].ends
    single = calibration.length(ends[0], ends[1], 0.25)
    coarse, fine = (calibration.length(ends[0], ends[1], std).std for std in (0.3, 0.2))
    assert fine - 0.006 <= float(row.std) <= coarse + 0.006
    reach = 1.96 * float(row.std)
    assert float(row.low) == pytest.approx(single.value - reach, abs=0.02)
    assert float(row.high) == pytest.approx(single.value + reach, abs=0.02)
    assert 0 < float(row.from_calibration) <= float(row.std)


def test_ends_are_marked_and_their_numbers_stay_in_the_picture(calibration, picture):
    corners = np.array([[2.0, 3.0], [1390.0, 3.0], [1390.0, 1037.0], [2.0, 1037.0]])
    pieces = tuple(line_piece(corners[[i, i - 1]]) for i in range(4))
    (block,) = picture_blocks(calibration, [replace(picture, pieces=pieces)])
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


def test_an_end_outside_the_picture_is_named(calibration, picture):
    wrong = line_piece(np.array([[700.0, 500.0], [700.0, 1200.0]]))
    with pytest.raises(InputError, match=r"1 of bar.png: point 2"):
        picture_blocks(calibration, [replace(picture, pieces=(wrong,))])


def test_each_picture_has_a_figure_of_its_own(calibration, picture):
    blocks = picture_blocks(calibration, [picture, replace(picture, name="second")])
    ids = [block.plot.id for block in blocks if block.plot]
    assert len(set(ids)) == 2
