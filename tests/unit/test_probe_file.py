from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import read_probe, write_probe
from tests.made_recording import PROBE
from tests.unit.camera_samples import CAMERAS, SCARAMUZZA


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "probe.yaml"
    path.write_text(PROBE)
    return path


@pytest.fixture
def calibrated(file: Path) -> Probe:
    probe = read_probe(file)
    root = np.random.default_rng(1).normal(size=(probe.covariance.shape[0],) * 2) * 1e-3
    laser = replace(
        probe.laser, decentre_x_mm=0.02, decentre_y_mm=-0.03, waviness=(1e-4, 0.0, -2e-4, 0.0, 3e-5, 1e-5)
    )
    return replace(
        probe, laser=laser, covariance=root @ root.T, calibrated_from="gauge", encoder_scale_sigma=0.0004
    )


def _sigma(probe: Probe, name: str) -> float:
    i = probe.parameter_names.index(name)
    return float(np.sqrt(probe.covariance[i, i]))


def test_angles_of_the_laser_become_slopes(file: Path) -> None:
    laser = read_probe(file).laser
    slope = np.tan(np.radians(0.5))
    np.testing.assert_allclose(
        [laser.tilt_x, laser.tilt_y], [slope * np.cos(np.radians(120)), slope * np.sin(np.radians(120))]
    )
    np.testing.assert_allclose(laser.cone_rad, np.radians(-0.01))
    # The stated direction is the one in which the sheet leans forward, where it meets larger z.
    far, near = laser.intersect(np.array([[np.cos(a), np.sin(a), 0.5] for a in np.radians([120, 300])]))
    assert far[2] > near[2]


def test_stated_uncertainty_becomes_covariance(file: Path) -> None:
    probe = read_probe(file)
    degree = np.radians(1)
    for name, sigma in {
        "fx": 0.06, "fy": 0.06, "cx": 0.05, "cy": 0.05, "k1": 2e-4, "k3": 1e-4, "k4": 0, "baseline_mm": 0.008,
        "tilt_x": 0.006 * degree, "tilt_y": 0.006 * degree, "cone_rad": 0.006 * degree, "wave2_cos": 0,
        "decentre_x_mm": 0,
    }.items():  # fmt: skip
        np.testing.assert_allclose(_sigma(probe, name), sigma, rtol=1e-12, err_msg=name)
    off = probe.covariance - np.diag(np.diag(probe.covariance))
    # fx and fy move together, nothing else does.
    np.testing.assert_allclose(off[0, 1], 0.06**2)
    assert np.count_nonzero(off) == 2
    assert probe.encoder_scale_sigma == 0.002


def test_round_trip_is_exact(calibrated: Probe, tmp_path: Path) -> None:
    write_probe(calibrated, tmp_path / "out.yaml")
    back = read_probe(tmp_path / "out.yaml")
    np.testing.assert_array_equal(back.covariance, calibrated.covariance)
    np.testing.assert_array_equal(back.camera.parameters, calibrated.camera.parameters)
    np.testing.assert_allclose(back.laser.parameters, calibrated.laser.parameters, rtol=1e-12, atol=1e-15)
    assert replace(back, camera=calibrated.camera, laser=calibrated.laser, covariance=0) == replace(
        calibrated, covariance=0
    )


def test_the_written_uncertainty_alone_gives_the_same_sigmas(file: Path, tmp_path: Path) -> None:
    stated, out = read_probe(file), tmp_path / "out.yaml"
    write_probe(stated, out)
    text = out.read_text()
    out.write_text(text[: text.index("covariance:")])
    np.testing.assert_allclose(read_probe(out).covariance, stated.covariance, rtol=1e-12, atol=1e-20)


@pytest.mark.parametrize("name", CAMERAS)
def test_every_camera_model_round_trips_with_its_uncertainty(file: Path, tmp_path: Path, name: str) -> None:
    camera, laser = CAMERAS[name], read_probe(file).laser
    size = camera.parameters.size + laser.parameters.size
    probe = Probe(camera, laser, np.diag(np.linspace(0, 1e-2, size) ** 2))
    write_probe(probe, tmp_path / "out.yaml")
    back = read_probe(tmp_path / "out.yaml")
    assert back.camera == camera
    np.testing.assert_array_equal(back.covariance, probe.covariance)


def test_focal_uncertainty_of_a_camera_without_focal_length_is_refused(file: Path, tmp_path: Path) -> None:
    probe = replace(read_probe(file), camera=SCARAMUZZA, covariance=np.eye(SCARAMUZZA.parameters.size + 12))
    out = tmp_path / "out.yaml"
    write_probe(probe, out)
    text = out.read_text()
    out.write_text(text[: text.index("covariance:")].replace("centre_px: 1.0", "focal_px: 0.1"))
    with pytest.raises(InputError, match="focal_px: has no meaning"):
        read_probe(out)


def test_the_covariance_is_ordered_by_names(file: Path) -> None:
    file.write_text(PROBE + "covariance: {names: [tilt_x, fx], matrix: [[4.0e-8, 1.0e-6], [1.0e-6, 0.01]]}\n")
    probe = read_probe(file)
    fx, tilt_x = (probe.parameter_names.index(n) for n in ("fx", "tilt_x"))
    assert probe.covariance[fx, fx] == 0.01
    assert probe.covariance[fx, tilt_x] == probe.covariance[tilt_x, fx] == 1e-6
    assert np.count_nonzero(probe.covariance) == 4


COVARIANCE = "covariance: {{names: [{}], matrix: {}}}\n"
SPOILED = {
    "no laser": ("laser:", "lasr:", "lasr: is not a key"),
    "mistyped laser key": ("baseline_mm: 23.5", "basline_mm: 23.5", "did you mean baseline_mm"),
    "zero baseline": ("baseline_mm: 23.5", "baseline_mm: 0", "greater than 0"),
    "wild opening": ("180.02", "20.0", "opening_angle_deg: is 20"),
    "wild tilt": ("tilt_deg: 0.5", "tilt_deg: 80.0", "between -45 and 45"),
    "no direction": (", tilt_direction_deg: 120.0", "", "tilt_direction_deg: is missing"),
    "NaN wavelength": ("520", ".nan", "wavelength_nm: is nan"),
    "negative line": ("0.15", "-0.15", "line_sigma_mm: is -0.15"),
    "camera of another model": ("kannala_brandt", "kannala_brant", "kannala_brandt"),
    "negative size": ("[64, 48]", "[64, -48]", "image_size"),
    "NaN focal": ("[15.0, 15.0]", "[15.0, .nan]", "focal_px"),
    "negative sigma": ("focal_px: 0.06", "focal_px: -0.06", "standard_uncertainty.focal_px: is -0.06"),
    "sigmas of another model": ("[2.0e-4, 2.0e-4, 1.0e-4, 0.0]", "[0.1]", "a list of 4 numbers"),
    "unknown sigma": ("tilt_deg: 0.006", "tillt_deg: 0.006", "did you mean tilt_deg"),
    "unknown shutter": ("global", "globel", "did you mean global"),
    "no LEDs": ("leds: 8", "leds: 0", "at least 1"),
    "lopsided covariance": (None, COVARIANCE.format("fx, fy", "[[1, 0.5], [0, 1]]"), "not a covariance"),
    "indefinite covariance": (None, COVARIANCE.format("fx, fy", "[[1, 2], [2, 1]]"), "not a covariance"),
    "ragged covariance": (None, COVARIANCE.format("fx, fy", "[[1, 2], [2]]"), "not a table of numbers"),
    "small covariance": (None, COVARIANCE.format("fx, fy", "[[1]]"), r"has the shape \(1, 1\)"),
    "NaN covariance": (None, COVARIANCE.format("fx", "[[.nan]]"), "not finite"),
    "unknown parameter": (None, COVARIANCE.format("fz", "[[1]]"), "names 'fz'"),
    "repeated parameter": (None, COVARIANCE.format("fx, fx", "[[1, 0], [0, 1]]"), "different names"),
}


@pytest.mark.parametrize("case", SPOILED)
def test_wrong_probe_files_are_refused_with_the_key(file: Path, case: str) -> None:
    old, new, complaint = SPOILED[case]
    assert old is None or old in PROBE
    file.write_text(PROBE + new if old is None else PROBE.replace(old, new, 1))
    with pytest.raises(InputError, match=complaint) as caught:
        read_probe(file)
    assert "probe.yaml" in str(caught.value)


def test_parameters_are_those_of_camera_and_laser(file: Path) -> None:
    probe = read_probe(file)
    assert probe.parameter_names[-len(LaserSheet.PARAMETER_NAMES) :] == LaserSheet.PARAMETER_NAMES
    assert probe.covariance.shape == (len(probe.parameter_names),) * 2
