"""The line in streams of pictures, and in space: every frame judged by itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sheetoflight.errors import FileError, InputError
from sheetoflight.imaging.stripe.extraction import StripeOptions, extract_stripe
from sheetoflight.io.frames import DamagedFrame, list_frames
from sheetoflight.measurement.reconstruction import reconstruct
from sheetoflight.workflow.reconstructed import Reconstructed, find_points
from sheetoflight.workflow.spread import Execution
from sheetoflight.workflow.stripes import find_stripes, mask_of
from tests.cli.laser_pictures import a_line, calibration, cut_short, dark, saved


def test_a_mask_is_where_the_picture_is_bright(tmp_path: Path) -> None:
    picture = np.zeros((4, 6, 3), np.uint8)
    picture[1, 2], picture[3, 5], picture[0, 0] = (0, 0, 255), (200, 0, 0), (9, 9, 100)
    mask = mask_of(saved(tmp_path / "mask.png", picture))
    assert mask.shape == (4, 6)
    assert np.argwhere(mask).tolist() == [[1, 2], [3, 5]]
    with pytest.raises(InputError, match=r"black.png is black – paint white"):
        mask_of(saved(tmp_path / "black.png", 0 * picture))
    with pytest.raises(FileError, match=r"none.png does not exist"):
        mask_of(tmp_path / "none.png")


def test_a_mask_and_a_region_keep_the_line_where_they_are(tmp_path: Path) -> None:
    saved(tmp_path / "a.png", a_line())
    mask = np.zeros(a_line().shape, dtype=bool)
    mask[:70] = True
    frames = list_frames([tmp_path / "a.png"])
    for options in (StripeOptions(mask=mask), StripeOptions(region=(0, 0, 200, 70))):
        ((_, seen),) = find_stripes(frames, options)
        assert not isinstance(seen, DamagedFrame)
        assert len(seen) > 50
        assert seen.uv[:, 1].max() < 70.0
        assert np.abs(seen.uv[:, 0] - 60.0 - 45.0 / 159.0 * seen.uv[:, 1])[seen.good].max() < 0.2


def test_a_picture_with_the_laser_off_serves_all_that_have_none(tmp_path: Path) -> None:
    """What shines with the laser off too is no line; a frame's own partner comes first."""
    scene = np.maximum(dark(), a_line(3))
    folder = tmp_path / "pair"
    folder.mkdir()
    saved(folder / "b_on.png", scene)
    saved(folder / "b_off.png", dark())
    single = saved(tmp_path / "a.png", scene)
    found = list(find_stripes(list_frames([single, folder]), None, scene))
    (_, alone), (_, paired) = found
    assert not isinstance(alone, DamagedFrame)
    assert not isinstance(paired, DamagedFrame)
    assert len(alone) == 0
    assert len(paired) > 100


def test_points_are_those_of_each_frame_alone(tmp_path: Path) -> None:
    paths = [saved(tmp_path / f"{k}.png", a_line(k)) for k in range(3)]
    cut_short(paths[1])
    found = [result for _, result in find_points(calibration(), list_frames(paths))]
    assert isinstance(found[1], DamagedFrame)
    for k in (0, 2):
        result = found[k]
        assert isinstance(result, Reconstructed)
        alone = reconstruct(calibration(), [(str(k), extract_stripe(a_line(k)))])
        assert np.array_equal(result.cloud.xyz, alone.xyz)
        (line,) = result.lines
        assert (line.points, line.picture) == (len(alone), str(k))


def test_bad_arguments_are_refused_before_a_picture_is_read(tmp_path: Path) -> None:
    frames = list_frames([saved(tmp_path / "a.png", a_line())])
    (tmp_path / "a.png").unlink()
    with pytest.raises(InputError, match="no laser 'green'"):
        find_points(calibration(), frames, laser="green")
    for step in ((1.0, 2.0), (1.0, np.inf, 0.0)):
        with pytest.raises(InputError, match="three finite numbers"):
            find_points(calibration(), frames, step_mm=step)


def test_frames_shared_by_processes_move_as_those_of_one(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.stack([a_line(k) for k in range(9)]))
    frames, step = list_frames([tmp_path / "a.npy"]), (1.0, -2.0, 3.0)
    still = list(find_points(calibration(), frames))
    moved = list(find_points(calibration(), frames, run=Execution(processes=2), step_mm=step))
    for k, ((_, one), (_, other)) in enumerate(zip(still, moved, strict=True)):
        assert isinstance(one, Reconstructed)
        assert isinstance(other, Reconstructed)
        assert np.allclose(one.cloud.xyz - other.cloud.xyz, k * np.array(step), atol=1e-9)
