"""HALCON's camera parameters and poses, by the formulas and files of its operator reference."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sheetoflight.errors import InputError
from sheetoflight.io.exchange import read_exchange, write_exchange
from sheetoflight.io.exchange.halcon_lens import (
    HalconCamera,
    camera_from_halcon,
    halcon_from_camera,
)
from sheetoflight.io.exchange.halcon_pose import light_plane_of, pose_of
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.light_plane import LightPlane

# read_cam_par, HALCON 12
CAMPAR = """# INTERNAL CAMERA PARAMETERS

ParGroup: Camera: Parameter;
  "Internal camera parameters";

Focus:foc:      0.00806039;
  DOUBLE:0.0:;
  "Focal length of the lens [meter]";

Kappa:kappa:    -2253.5;
  DOUBLE::;
  "Radial distortion coefficient [1/(meter*meter)]";

Sx:sx:  1.0629e-05;
  DOUBLE:0.0:;
  "Width of a cell on the sensor [meter]";

Sy:sy:  1.1e-05;
  DOUBLE:0.0:;
  "Height of a cell on the sensor [meter]";

Cx:cx:  378.236;
  DOUBLE:0.0:;
  "X-coordinate of the image center [pixel]";

Cy:cy:  297.587;
  DOUBLE:0.0:;
  "Y-coordinate of the image center [pixel]";

ImageWidth:imgw:        768;
  INT:1:32767;
  "Width of the images [pixel]";

ImageHeight:imgh:       576;
  INT:1:32767;
  "Height of the images [pixel]";
"""
LINES = """Focus 0.00806039
Kappa -2253.5
Sx 1.0629e-05
Sy 1.1e-05
Cx 378.236
Cy 297.587
ImageWidth 768
ImageHeight 576
"""
TUPLE = (
    "['area_scan_division', 0.00806039, -2253.5, 1.0629e-005, 1.1e-005, 378.236, 297.587, 768, 576]"
)
BARE = "[0.00806039, -2253.5, 1.0629e-005, 1.1e-005, 378.236, 297.587, 768, 576]"

FOCUS, KAPPA, SX, SY, CX, CY = 0.00806039, -2253.5, 1.0629e-5, 1.1e-5, 378.236, 297.587
SIZE = (768, 576)

# read_pose, HALCON
POSE = """# 3D POSE PARAMETERS: rotation and translation

# Used representation type:
f 0

# Rotation angles [deg] or Rodriguezvector:
r -17.8134 1.83816 0.288092

# Translation vector (x y z [m]):
t 0.280164 0.150644 1.7554
"""


def saved(folder: Path, text: str, name: str = "campar.dat") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def rays_into(size: tuple[int, int], camera) -> np.ndarray:
    """Rays ``(N, 3)`` through a picture's every part, by a pinhole of the same focal length."""
    u, v = np.meshgrid(np.linspace(0, size[0] - 1, 37), np.linspace(0, size[1] - 1, 29))
    x, y = (u.ravel() - camera.u0) / camera.alpha, (v.ravel() - camera.v0) / camera.beta
    return np.column_stack([x, y, np.ones(x.size)])


def halcon_division(rays: np.ndarray, kappa: float) -> np.ndarray:
    """Image points by the formula that write_cam_par's reference page gives."""
    u, v = FOCUS * rays[:, 0] / rays[:, 2], FOCUS * rays[:, 1] / rays[:, 2]
    root = 1.0 + np.sqrt(1.0 - 4.0 * kappa * (u * u + v * v))
    return np.column_stack([2.0 * u / root / SX + CX, 2.0 * v / root / SY + CY])


def stated_px(notes: tuple[str, ...]) -> float:
    (found,) = (note.split()[-2] for note in notes if "largest difference" in note)
    return float(found)


@pytest.mark.parametrize(
    "text", [CAMPAR, LINES, TUPLE, BARE], ids=["file", "lines", "tuple", "bare"]
)
def test_the_reference_pages_camera_projects_as_halcon_says(text: str, tmp_path: Path):
    found = read_exchange(saved(tmp_path, text))
    assert found.format == "halcon"
    camera = found.camera
    assert camera.image_size == SIZE
    expected = (FOCUS / SX, FOCUS / SY, CX, CY)
    np.testing.assert_allclose(
        (camera.alpha, camera.beta, camera.u0, camera.v0), expected, rtol=1e-15
    )
    rays = rays_into(SIZE, camera)
    uv = halcon_division(rays, KAPPA)
    inside = ((uv > -0.5) & (uv < np.array(SIZE) - 0.5)).all(axis=1)
    apart = np.linalg.norm(camera.project(rays) - uv, axis=1)[inside]
    assert apart.max() < 1.01 * stated_px(found.notes)
    assert stated_px(found.notes) < 0.005


def test_without_distortion_nothing_is_fitted(tmp_path: Path):
    found = read_exchange(saved(tmp_path, LINES.replace("-2253.5", "0")))
    assert not found.camera.distorts
    assert not any("fitted" in note for note in found.notes)


@pytest.mark.parametrize("kappa", [0.0, -1.0, 50.0, -500.0, KAPPA, 2253.5])
def test_division_to_brown_and_back(kappa: float):
    """κ comes back to within what the stated misfit, at the corner, is of it:
    the image point moves by κ r³ / Sx there."""
    there = HalconCamera(FOCUS, (kappa,), SX, SY, CX, CY, SIZE)
    camera, misfit = camera_from_halcon(there)
    back, misfit_back = halcon_from_camera(camera, 1e6 * SX)
    assert len(back.coefficients) == 1
    radius = np.hypot(CX * SX, CY * SY)
    assert abs(back.coefficients[0] - kappa) * radius**3 / SX <= 2 * (misfit + misfit_back) + 1e-9
    for name in ("focus", "sx", "sy", "cx", "cy"):
        assert getattr(back, name) == pytest.approx(getattr(there, name), rel=1e-14)


K = (-1800.0, 6e6, -4e10, 0.05, -0.08)


def halcon_polynomial(uv: np.ndarray) -> np.ndarray:
    """Rays of image points by the formula of the reference's chapter Calibration."""
    u, v = (uv[:, 0] - CX) * SX, (uv[:, 1] - CY) * SY
    r2 = u**2 + v**2
    radial = K[0] * r2 + K[1] * r2**2 + K[2] * r2**3
    x = u + u * radial + K[3] * (r2 + 2 * u**2) + 2 * K[4] * u * v
    y = v + v * radial + 2 * K[3] * u * v + K[4] * (r2 + 2 * v**2)
    return np.column_stack([x, y, np.full(len(x), FOCUS)])


@pytest.mark.parametrize("names", [("Poly1", "Poly5"), ("K1", "P2")], ids="–".join)
def test_the_polynomial_leads_from_the_picture_to_the_rays(names: tuple[str, str], tmp_path: Path):
    called = (
        [f"Poly{i}" for i in range(1, 6)] if names[0] == "Poly1" else ["K1", "K2", "K3", "P1", "P2"]
    )
    lines = "\n".join(f"{name} {value!r}" for name, value in zip(called, K, strict=True))
    found = read_exchange(saved(tmp_path, LINES.replace("Kappa -2253.5", lines)))
    rng = np.random.default_rng(2)
    uv = rng.uniform((0, 0), (SIZE[0] - 1, SIZE[1] - 1), (500, 2))
    apart = np.linalg.norm(found.camera.project(halcon_polynomial(uv)) - uv, axis=1)
    assert apart.max() < 1.01 * stated_px(found.notes)
    assert stated_px(found.notes) < 0.1


def test_p1_and_p2_change_places_with_the_axes(tmp_path: Path):
    """Turned by a quarter, a picture's columns are its rows: P1 then does what P2 did."""

    def camera(p1: float, p2: float):
        return camera_from_halcon(
            HalconCamera(FOCUS, (0.0, 0.0, 0.0, p1, p2), SX, SX, 300.0, 300.0, (601, 601))
        )[0]

    one, other = camera(0.2, 0.0), camera(0.0, 0.2)
    rays = rays_into((601, 601), one)
    np.testing.assert_allclose(
        one.project(rays), other.project(rays[:, [1, 0, 2]])[:, ::-1], atol=1e-6
    )


@pytest.mark.parametrize("distortion", [(-0.05, 0.0, 0.0, 0.0, 0.0), (-0.2, 0.1, 4e-4, -6e-4, 0.0)])
def test_what_is_written_projects_as_stated(
    distortion: tuple[float, ...], calibration: Calibration, tmp_path: Path
):
    camera = replace(
        calibration.camera, alpha=2000.0, beta=1990.0, gamma=0.0, distortion=distortion
    )
    notes = write_exchange(tmp_path / "c.dat", replace(calibration, camera=camera), "halcon")
    found = read_exchange(tmp_path / "c.dat")
    np.testing.assert_allclose(
        found.camera.parameters[:5], camera.parameters[:5], rtol=1e-14, atol=0
    )
    rays = camera.unproject(np.random.default_rng(3).uniform((0, 0), (1391, 1039), (500, 2)))
    apart = np.linalg.norm(found.camera.project(rays) - camera.project(rays), axis=1)
    assert apart.max() < 1.05 * (stated_px(notes) + stated_px(found.notes))
    assert stated_px(notes) < 0.1  # no more than a marker's own noise
    assert any("5 µm" in note for note in notes)


def test_a_pixel_size_changes_nothing_but_units(calibration: Calibration, tmp_path: Path):
    camera = replace(calibration.camera, gamma=0.0, distortion=(0.0,) * 5)
    known = replace(calibration, camera=camera)
    for size in (3.45, 7.4):
        write_exchange(tmp_path / "c.dat", known, "halcon", pixel_um=size)
        text = (tmp_path / "c.dat").read_text()
        assert f"Sx:sx: {size * 1e-6!r};" in text
        found = read_exchange(tmp_path / "c.dat").camera
        np.testing.assert_allclose(found.parameters, camera.parameters, rtol=1e-14)


def test_a_lens_that_the_model_cannot_follow_is_refused(calibration: Calibration, tmp_path: Path):
    camera = replace(calibration.camera, alpha=900.0, beta=900.0, distortion=(-0.35, 0.16, 0, 0, 0))
    with pytest.raises(InputError, match=r"c\.dat: .*limit 0\.5 px"):
        write_exchange(tmp_path / "c.dat", replace(calibration, camera=camera), "halcon")
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(InputError, match=r"limit 0\.5 px"):
        camera_from_halcon(HalconCamera(FOCUS, (-12000.0,), SX, SY, CX, CY, SIZE))


# --- poses ----------------------------------------------------------------------------------------


def plane_by_scipy(rotated: Rotation, translation: list[float]) -> tuple[np.ndarray, float]:
    """The plane z = 0 of a pose through three of its points, in mm."""
    corners = rotated.apply([[0, 0, 0], [1, 0, 0], [0, 1, 0]]) + translation
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    distance = 1000.0 * normal @ corners[0]
    return normal * np.sign(distance), abs(distance)


@pytest.mark.parametrize("code", [0, 2, 4])
def test_a_poses_plane_is_that_of_its_rotation(code: int):
    """'gba' turns about the turned axes x, y, z; 'abg' about the fixed ones; the vector of
    'rodriguez' is that of Gibbs, a quaternion's vector over its scalar."""
    rng = np.random.default_rng(code)
    for _ in range(20):
        turned, moved = rng.uniform(-80, 80, 3), rng.uniform(-1, 1, 3)
        if code == 4:
            turned = turned / 40
            rotated = Rotation.from_quat([*turned, 1.0])
        else:
            rotated = Rotation.from_euler("XYZ" if code == 0 else "xyz", turned, degrees=True)
        normal, distance = plane_by_scipy(rotated, moved.tolist())
        plane = light_plane_of(np.array([*moved, *turned, code]), "laser")
        np.testing.assert_allclose(plane.normal, normal, atol=1e-12)
        assert plane.distance_mm == pytest.approx(distance, rel=1e-10)


@pytest.mark.parametrize(
    "normal",
    [(0, 0, 1), (1, 0, 0), (0, -1, 0), (0, 0, -1), (0.9098, 0.0872, 0.4058), (-1, 1e-9, 0)],
)
def test_a_plane_and_its_pose_are_one(normal: tuple[float, ...]):
    plane = LightPlane(np.array(normal), 562.3337)
    back = light_plane_of(pose_of(plane), "laser")
    np.testing.assert_allclose(back.normal, plane.normal, atol=1e-15)
    assert back.distance_mm == pytest.approx(562.3337, rel=1e-14)


def test_a_light_plane_comes_from_a_pose_file(tmp_path: Path):
    pose = saved(tmp_path, POSE, "pose.dat")
    found = read_exchange(saved(tmp_path, CAMPAR), pose=pose)
    rotated = Rotation.from_euler("XYZ", [-17.8134, 1.83816, 0.288092], degrees=True)
    normal, distance = plane_by_scipy(rotated, [0.280164, 0.150644, 1.7554])
    (plane,) = found.light_planes
    np.testing.assert_allclose(plane.normal, normal, atol=1e-12)
    assert plane.distance_mm == pytest.approx(distance, rel=1e-12)
    known = found.as_calibration(0.1)
    assert known.covariance.parameters == ()
    assert "no uncertainty" in known.warnings[0]


@pytest.mark.parametrize("code", ["1", "8", "0.5"])
def test_a_pose_of_another_code_is_refused(code: str, tmp_path: Path):
    pose = saved(tmp_path, POSE.replace("f 0", f"f {code}"), "pose.dat")
    with pytest.raises(InputError, match=rf"pose\.dat: the pose has the code {code}, expected 0"):
        read_exchange(saved(tmp_path, CAMPAR), pose=pose)


def test_several_light_planes_stand_in_comments(calibration: Calibration, tmp_path: Path):
    camera = replace(calibration.camera, gamma=0.0, distortion=(0.0,) * 5)
    planes = (
        calibration.light_plane,
        LightPlane(np.array([-0.9, 0.1, 0.4]), 480 / 7, 'the "red"\none: ö'),
    )
    known = replace(calibration, camera=camera, light_planes=planes)
    write_exchange(tmp_path / "c.dat", known, "halcon")
    found = read_exchange(tmp_path / "c.dat").light_planes
    for was, came in zip(planes, found, strict=True):
        assert came.name == was.name
        np.testing.assert_allclose(came.normal, was.normal, atol=1e-15)
        assert came.distance_mm == pytest.approx(was.distance_mm, rel=1e-14)


WRONG = {
    "negative": ("Focus 0.008", "Focus -0.008", "Focus is -0.008"),
    "telecentric": ("Focus 0.00806039", "Focus 0", "telecentric"),
    "text": ("Sx 1.0629e-05", "Sx wide", "line 3: Sx is 'wide', expected a number"),
    "infinite": ("Sx 1.0629e-05", "Sx 1e999", "expected a finite number"),
    "missing": ("Cy 297.587\n", "", "'Cy' is missing"),
    "twice": ("Cy 297.587", "Cy 297.587\nCy 3", "line 7: Cy is given twice"),
    "line scan": ("Cy 297.587", "Cy 297.587\nVx 0.1", "line 7: 'Vx' is a parameter of another"),
    "two models": ("Cy 297.587", "Cy 297.587\nK1 0.1", "Kappa and K1 are of two lens models"),
    "type": ("Focus", "CameraType area_scan_telecentric_division\nFocus", "CameraType is"),
    "size": ("ImageWidth 768", "ImageWidth 0", "ImageWidth, ImageHeight is 0 x 576"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_is_wrong_is_named(wrong: str, tmp_path: Path):
    old, new, said = WRONG[wrong]
    assert old in LINES
    with pytest.raises(InputError, match=rf"campar\.dat: .*{said}"):
        read_exchange(saved(tmp_path, LINES.replace(old, new, 1)))


def test_a_pose_beside_another_tools_file_is_refused(tmp_path: Path):
    pose = saved(tmp_path, POSE, "pose.dat")
    with pytest.raises(InputError, match="no HALCON file, and a pose file was given"):
        read_exchange(saved(tmp_path, "K: 1\n", "camera.yaml"), pose=pose)
