"""``boresight calibrate`` on an open gauge run whose sheet has a tilt that its probe file does not state."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from pipeline.api.calibrate import STAGES, calibrate
from pipeline.errors import InputError
from pipeline.instrument.probe_file import read_probe, read_with_source
from pipeline.machine.configuration import resolve
from pipeline.recording import open_recording
from stages.calibrate.gauge import GaugeParameters
from tests.shared_data import shared


@pytest.fixture(scope="module")
def calibration(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("calibration")
    calibrate(shared("recordings", "open-2-gauge"), folder)
    return folder


def test_hidden_tilt_is_found(calibration: Path) -> None:
    name, (tilt_deg, toward_deg) = json.loads(shared("recordings", "open-2-gauge", "truth.json").read_text())[
        "effects"
    ][0]
    assert name == "laser_tilt"
    true = tilt_deg * np.array([np.cos(np.radians(toward_deg)), np.sin(np.radians(toward_deg))])
    probe = read_probe(calibration / "probe.yaml")
    found = np.degrees([probe.laser.tilt_x, probe.laser.tilt_y])
    assert np.linalg.norm(found - true) < 0.01
    assert probe.calibrated_from == "open-2-gauge"


def test_the_calibrated_probe_file_has_a_smaller_covariance(calibration: Path) -> None:
    stated = read_probe(shared("recordings", "open-2-gauge", "probe.yaml"))
    found = read_probe(calibration / "probe.yaml")
    names = list(found.parameter_names)
    for name in ("fx", "cx", "cy", "k1", "k2", "k3", "baseline_mm", "tilt_x", "tilt_y"):
        k = names.index(name)
        assert 0 < found.covariance[k, k] < stated.covariance[k, k]
    cx, tilt = names.index("cx"), names.index("tilt_x")
    c = found.covariance
    assert abs(c[cx, tilt]) > 0.5 * np.sqrt(c[cx, cx] * c[tilt, tilt])


def test_document_and_page_state_what_changed(calibration: Path) -> None:
    document = json.loads((calibration / "calibration.json").read_text("utf-8"))
    moved = {p["name"]: p["change_in_stated_sigma"] for p in document["parameters"]}
    assert moved["tilt_x"] > 30
    assert abs(moved["cx"]) < 4
    assert document["radius_error"][0]["before_largest_mm"] > 0.9
    assert document["radius_error"][0]["sigma_mm"] < 0.01
    tilt = document["laser"]["tilt_deg"]
    assert abs(tilt["value"] - 0.6) < 3 * tilt["sigma"] < 0.05
    gauge = open_recording(shared("recordings", "open-2-gauge")).content_key
    assert document["made_by"]["input_sha256"]["recording"] == gauge
    _, source = read_with_source(calibration / "probe.yaml")
    assert source.made_by == document["made_by"]
    assert document["outvoted"] == {"fiducials": [], "rings": []}
    page = (calibration / "calibration.html").read_text("utf-8")
    assert "open-2-gauge" in page
    assert page.count("data:image/png;base64,") == 4
    assert "http" not in page.replace("http-equiv", "")


def test_unknown_parameter_is_refused() -> None:
    for words in ("gauge.tilt=3", "tilt_prior_deg=3", "gauge.tilt_prior_deg=-1"):
        with pytest.raises(InputError, match="tilt_prior_deg"):
            resolve(STAGES, None, [words])
    set_so = resolve(STAGES, None, ["gauge.tilt_prior_deg=1", "gauge.ring_bins=120"]).of("gauge")
    assert isinstance(set_so, GaugeParameters)
    assert set_so.tilt_prior_deg == 1.0


def states(folder: Path) -> dict[str, str]:
    """Return the state of each stage as run.json gives it."""
    stages = json.loads((folder / "run.json").read_text("utf-8"))["stages"]
    return {stage["name"]: stage["state"] for stage in stages}


def test_a_second_call_computes_nothing(calibration: Path) -> None:
    before = {p.name: p.read_bytes() for p in calibration.iterdir() if p.is_file() and p.name != "run.json"}
    assert len(before) == 3
    calibrate(shared("recordings", "open-2-gauge"), calibration)
    assert states(calibration) == {"premises": "reused", "rings": "reused", "gauge": "reused"}
    assert {name: (calibration / name).read_bytes() for name in before} == before


def test_another_prior_reuses_the_rings(calibration: Path) -> None:
    calibrate(shared("recordings", "open-2-gauge"), calibration, settings=["gauge.iterations=11"])
    assert states(calibration) == {"premises": "reused", "rings": "reused", "gauge": "completed"}


def test_an_inspection_instead_of_a_gauge_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="it is not a gauge run"):
        calibrate(shared("recordings", "open-2-field"), tmp_path / "out")
    assert not (tmp_path / "out").exists()
