"""What a caller adds to the report is checked when it is made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.report.contents import MeasuredPicture, Table


@pytest.mark.parametrize(
    "image", [np.zeros((4, 5, 3), np.uint8), np.zeros((4, 5)), np.zeros(5, np.uint8)]
)
def test_a_picture_is_grey_with_8_or_16_bit(image):
    with pytest.raises(InputError, match=r"picture bar.*give a grey picture"):
        MeasuredPicture("bar", image)


def test_a_binary_picture_has_the_pictures_size():
    with pytest.raises(InputError, match=r"\(4, 4\).*\(4, 5\).*same size"):
        MeasuredPicture("bar", np.zeros((4, 5), np.uint16), np.zeros((4, 4), bool))


def test_a_row_has_a_cell_for_each_column():
    with pytest.raises(InputError, match="table 'T': row 1 has 1 cells, there are 2 columns"):
        Table("T", ("a", "b"), (("x", 1.0), ("y",)))


@pytest.mark.parametrize("row", [-1, 2])
def test_only_rows_that_exist_are_highlighted(row):
    with pytest.raises(InputError, match=f"row {row} is to be highlighted, there are 2 rows"):
        Table("T", ("a",), (("x",), ("y",)), highlight=(0, row))


def test_every_whole_piece_has_a_length(picture):
    with pytest.raises(InputError, match="1 whole pieces and 0 lengths"):
        replace(picture, segments=())
