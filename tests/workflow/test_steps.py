"""From pictures to lengths, step by step."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

import sheetoflight as sol
from sheetoflight.errors import FileError, InputError, UntrustworthyError
from sheetoflight.io.pictures import list_pictures, read_picture
from sheetoflight.io.points_csv import read_points
from sheetoflight.workflow.calibrated import calibrate_folder, load_calibration
from sheetoflight.workflow.measured import (
    measure_pictures,
    measure_segments,
    pictures_named,
)
from sheetoflight.workflow.reported import write_report, write_target
from sheetoflight.workflow.rig_folder import detect, load_rig
from sheetoflight.workflow.simulated import SimulationOptions, simulate
from tests.rendered import SMALL, rendered, rig_folder

__all__ = ["rendered", "rig_folder"]


def truth_of(folder: Path) -> dict:
    return json.loads((folder / "truth.json").read_text())


def test_every_marker_is_found_where_it_is(rendered: Path) -> None:
    rig = load_rig(rendered)
    views = truth_of(rendered)["views"]
    assert len(rig.observations.camera) == SMALL.camera_views
    assert len(rig.observations.plane) == SMALL.plane_views
    for stage, seen in rig.observations.stages().items():
        for name, uv in zip(seen.names, seen.uv, strict=True):
            assert np.abs(uv - views[stage][name]["markers_uv"]).max() < 0.06


def test_pictures_become_lengths(rendered: Path) -> None:
    """Seven views and four positions give lengths whose 99.99 % intervals hold."""
    calibration = calibrate_folder(rendered)
    found = measure_pictures(calibration, list_pictures(rendered / "measure"))
    assert len(found) == len(SMALL.bars_mm)
    for picture, true_mm in zip(found, SMALL.bars_mm, strict=True):
        (measured,) = picture.segments
        assert measured.name == picture.file.name
        assert abs(measured.length.value - true_mm) < 4 * measured.length.std
        assert measured.length.std < 0.5


def test_points_csv_is_used_instead_of_the_pictures(rig_folder: Path) -> None:
    expected = load_rig(rig_folder)
    for stage in ("camera", "plane"):
        shutil.rmtree(rig_folder / stage)
    again = load_rig(rig_folder)
    assert np.array_equal(again.observations.camera.uv, expected.observations.camera.uv)
    calibrate_folder(rig_folder)


def test_detection_without_points_csv_gives_the_same_rig(rig_folder: Path) -> None:
    written = load_rig(rig_folder)
    (rig_folder / "points.csv").unlink()
    detected = load_rig(rig_folder)
    assert np.array_equal(written.observations.plane.uv, detected.observations.plane.uv)
    assert not (rig_folder / "points.csv").exists()


def test_a_calibration_comes_back_from_its_file(rendered: Path, tmp_path: Path) -> None:
    calibration = calibrate_folder(rendered)
    calibration.save(tmp_path / "calibration.json")
    again = load_calibration(tmp_path / "calibration.json")
    assert again.camera == calibration.camera
    assert np.array_equal(again.covariance.matrix, calibration.covariance.matrix)
    uv = np.array([[900.0, 300.0], [950.0, 700.0]])
    assert again.length(*uv) == calibration.length(*uv)
    assert calibration.provenance["views"] == {"camera": 7, "plane": 4}


def test_the_same_seed_gives_the_same_bytes(rendered: Path, tmp_path: Path) -> None:
    simulate(tmp_path / "again", SimulationOptions(camera_views=1, plane_views=0, bars_mm=(300.0,),
                                                   clutter=4, seed=3))  # fmt: skip
    for name in ("camera/camera00.png",):
        assert (tmp_path / "again" / name).read_bytes() == (rendered / name).read_bytes()


def test_a_simulation_replaces_only_a_simulation(rig_folder: Path) -> None:
    few = SimulationOptions(camera_views=1, plane_views=0, bars_mm=(), clutter=0)
    simulate(rig_folder, few)
    assert len(list((rig_folder / "camera").iterdir())) == 1
    assert not (rig_folder / "points.csv").exists()
    (rig_folder / "truth.json").unlink()
    with pytest.raises(InputError, match="no simulation"):
        simulate(rig_folder, few)
    assert (rig_folder / "rig.toml").exists()


def test_segments_are_measured_by_name(rendered: Path, tmp_path: Path) -> None:
    table = tmp_path / "segments.csv"
    table.write_text("segment,u1,v1,u2,v2,std\nrail,900,300,950,700,0.2\ngap,900,300,950,700,\n")
    calibration = calibrate_folder(rendered)
    rail, gap = measure_segments(calibration, table)
    assert (rail.name, gap.name) == ("rail", "gap")
    assert rail.length.value == gap.length.value
    assert rail.length.std > gap.length.std


def test_pictures_are_paired_however_they_are_named(rendered: Path) -> None:
    folder = rendered / "measure"
    whole = pictures_named([folder])
    each = pictures_named(sorted(folder.iterdir()))
    assert [(f.name, f.path, f.laser_on) for f in whole] == [
        (f.name, f.path, f.laser_on) for f in each
    ]
    (alone,) = pictures_named([folder / "bar00_on.png"])
    assert alone.laser_on is None


def test_a_single_picture_with_the_laser_on_can_be_measured(rendered: Path) -> None:
    calibration = calibrate_folder(rendered)
    files = pictures_named([rendered / "measure" / "bar00_on.png"])
    (picture,) = measure_pictures(calibration, files)
    values = [measured.length.value for measured in picture.segments]
    assert min(abs(value - SMALL.bars_mm[0]) for value in values) < 1.0


def test_a_picture_of_another_size_is_named(rig_folder: Path) -> None:
    path = rig_folder / "camera" / "camera02.png"
    picture = read_picture(path)
    cv2.imwrite(str(path), picture[:-10])
    with pytest.raises(InputError, match=r"camera02\.png has 1392×1030"):
        detect(rig_folder)


def test_a_target_never_seen_is_no_result(rig_folder: Path) -> None:
    blank = np.full((1040, 1392), 120, np.uint8)
    for path in (rig_folder / "camera").iterdir():
        cv2.imwrite(str(path), blank)
    before = read_points(rig_folder / "points.csv", sol.CollinearTarget())
    with pytest.raises(UntrustworthyError, match="none of 7 pictures"):
        detect(rig_folder)
    after = read_points(rig_folder / "points.csv", sol.CollinearTarget())
    assert np.array_equal(before.camera.uv, after.camera.uv)


def test_a_missed_picture_is_named_and_the_rest_is_used(rig_folder: Path) -> None:
    cv2.imwrite(str(rig_folder / "camera" / "camera04.png"), np.full((1040, 1392), 120, np.uint8))
    detection = detect(rig_folder)
    assert [(missed.stage, missed.view) for missed in detection.missed] == [("camera", "camera04")]
    assert detection.missed[0].reason
    assert "camera04" not in detection.rig.observations.camera.names


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="nowhere"):
        load_rig(tmp_path / "nowhere")


def test_image_size_may_come_from_the_pictures(rig_folder: Path) -> None:
    text = (rig_folder / "rig.toml").read_text()
    lines = [line for line in text.splitlines() if not line.startswith("image_size")]
    (rig_folder / "rig.toml").write_text("\n".join(lines))
    assert load_rig(rig_folder).image_size == (1392, 1040)
    (rig_folder / "points.csv").unlink()
    assert load_rig(rig_folder).image_size == (1392, 1040)


def with_lasers(folder: Path, *names: str) -> None:
    """The same rig with named lasers, and no points.csv."""
    with (folder / "rig.toml").open("a") as file:
        file.writelines(f'\n[[laser]]\nname = "{name}"\n' for name in names)
    (folder / "points.csv").unlink()


def test_each_of_two_lasers_has_a_folder_of_in_plane_pictures(rig_folder: Path) -> None:
    expected = load_rig(rig_folder).observations.plane
    pictures = sorted((rig_folder / "plane").iterdir())
    for name in ("left", "right"):
        (rig_folder / "plane" / name).mkdir()
    for path in pictures:
        name = "left" if "plane00" in path.name else "right"
        path.rename(path.parent / name / path.name.replace("plane01", "plane00"))
    with_lasers(rig_folder, "left", "right")
    plane = detect(rig_folder).rig.observations.plane
    assert plane.names == ("left/plane00", "right/plane00", "right/plane02", "right/plane03")
    assert plane.lasers.tolist() == [0, 1, 1, 1]
    assert np.array_equal(plane.uv, expected.uv)
    again = load_rig(rig_folder)
    assert again.lasers == ("left", "right")
    assert again.observations.plane.names == plane.names
    assert np.array_equal(again.observations.plane.lasers, plane.lasers)


def test_pictures_that_name_no_laser_are_refused(rig_folder: Path) -> None:
    with_lasers(rig_folder, "left", "right")
    (rig_folder / "plane" / "left").mkdir()
    with pytest.raises(InputError, match=r"plane holds no folder right/, but .* 2 lasers – put"):
        load_rig(rig_folder)
    (rig_folder / "plane" / "right").mkdir()
    with pytest.raises(InputError, match=r"plane holds pictures that name no laser, but the rig"):
        load_rig(rig_folder)


def test_a_single_laser_of_any_name_needs_no_folder(rig_folder: Path) -> None:
    with_lasers(rig_folder, "red")
    rig = load_rig(rig_folder)
    assert rig.lasers == ("red",)
    assert "plane00" in rig.observations.plane.names


CROSSING = "c0,crossing,0,100,200,\nc0,crossing,1,300,200,\nc0,crossing,laser,250.5,200,0.2\n"


def test_given_crossings_are_used_and_kept(rig_folder: Path) -> None:
    """Where points.csv has views of stage crossing and no picture shows any, they stay."""
    with (rig_folder / "points.csv").open("a") as file:
        file.write(CROSSING)
    crossing = load_rig(rig_folder).observations.crossing
    assert crossing.names == ("c0",)
    assert crossing.uv[0, 3].tolist() == [250.5, 200.0]
    kept = detect(rig_folder).rig.observations.crossing
    assert np.array_equal(kept.uv, crossing.uv, equal_nan=True)
    again = load_rig(rig_folder).observations
    assert np.array_equal(again.crossing.uv, crossing.uv, equal_nan=True)
    assert list(again.stages()) == ["camera", "plane", "crossing"]


@pytest.mark.parametrize("stage", ["camera", "plane", "crossing"])
def test_points_of_one_stage_alone_are_loaded(rig_folder: Path, stage: str) -> None:
    path = rig_folder / "points.csv"
    header, *rows = (path.read_text() + CROSSING).splitlines()
    path.write_text("\n".join([header, *(row for row in rows if f",{stage}," in row)]))
    assert list(load_rig(rig_folder).observations.stages()) == [stage]


def test_a_wrong_detection_is_loaded_for_the_calibration_to_name(rig_folder: Path) -> None:
    path = rig_folder / "points.csv"
    lines = path.read_text().splitlines()
    view, stage, marker, *_ = lines[2].split(",")
    lines[2] = ",".join([view, stage, marker, "7.5", "8.5", ""])
    path.write_text("\n".join(lines))
    seen = load_rig(rig_folder).observations.stages()[stage]
    assert seen.uv[seen.names.index(view), int(marker)].tolist() == [7.5, 8.5]


def test_a_report_is_written_with_its_pictures(rendered: Path, tmp_path: Path) -> None:
    calibration = calibrate_folder(rendered)
    pictures = measure_pictures(calibration, list_pictures(rendered / "measure")[:1])
    write_report(tmp_path / "report.html", calibration, pictures)
    page = (tmp_path / "report.html").read_text()
    assert "bar00" in page
    assert "joint" in page


def test_a_target_is_drawn_by_its_ending(tmp_path: Path) -> None:
    write_target(tmp_path / "target.svg", sol.CollinearTarget())
    write_target(tmp_path / "target.pdf", sol.CollinearTarget())
    assert b"<svg" in (tmp_path / "target.svg").read_bytes()
    assert (tmp_path / "target.pdf").read_bytes().startswith(b"%PDF-")
    with pytest.raises(InputError, match="svg or"):
        write_target(tmp_path / "target.docx", sol.CollinearTarget())
