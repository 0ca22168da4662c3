"""The twin's page and document: unknown values are marked, and all frames are there."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pipeline.api.diagnosis.simulated import DiagnosisTried
from pipeline.api.twin import TwinOf, twin_document, write_twin
from pipeline.artefacts.twin import GaugeTwin, Mismatch, NamedFigure, RegionFit, Twin, TwinView
from pipeline.commands.twin import _show
from pipeline.files.provenance import MadeBy


def _twin():
    picture = np.full((30, 40), 90, np.uint8)
    nameless = Mismatch("", "intensity", "image", (), (), 1e-5, 3.0, 2.0, "Brighter </script> here.")
    return Twin(
        np.array([4]), True, (NamedFigure("white_dn", float("inf"), 0.0),), (),
        (RegionFit("wall", 0, float("nan"), float("nan")),), (nameless,), 45.0, float("inf"),
        1.1, 0.0, 0.9, 0.97, (),
        (TwinView(4, "led", 1.2, picture, picture, picture),),
    )  # fmt: skip


def test_unknown_values_are_null_and_the_page_has_all_frames(tmp_path):
    tilt = Mismatch("laser_tilt", "line", "laser", (), (), 1.0, 9.0, 0.9, "Laser tilt: pictures fit better.")
    gauge = GaugeTwin(np.array([2]), ("laser_tilt=0.6@40",), 9, 9.0, 0.9, 0.8, 2.0, 0.1, 0.09, 16.0, (True,))
    tried = DiagnosisTried(gauge, (tilt,))
    of = TwinOf("/runs/one", ("motion",))
    write_twin(_twin(), tried, of, MadeBy("twin", {}, {}), tmp_path)
    document = json.loads((tmp_path / "twin.json").read_text("utf-8"))
    assert document["noise"]["white_dn"]["value"] is None
    assert document["compared_of_seen"] == 0.97
    assert document["regions"]["wall"]["chi2_after"] is None
    assert [found["name"] for found in document["found"]] == ["laser_tilt", None]
    assert document["gauge"]["chi2_diagnosed"] == 0.9
    said = json.loads(json.dumps(twin_document(_twin(), tried, of)))
    assert document | {"made_by": 0} == said | {"made_by": 0}
    assert (said["run"], said["computed_again"]) == ("/runs/one", ["motion"])
    page = (tmp_path / "twin.html").read_text("utf-8")
    assert "motion had to be computed again" in page
    assert page.count("data:image/jpeg;base64") == 3
    assert page.count("</script>") == 1


@pytest.mark.parametrize(
    ("whole", "beyond", "said", "tile"),
    [
        (45.0, 52.3, "45.0 dB, without the noise 52.3 dB", "52.3 dB"),
        (45.0, np.inf, "45.0 dB, no difference beyond the noise", "no difference beyond the noise"),
        (np.inf, np.inf, "no difference beyond the noise", "no difference beyond the noise"),
        (np.nan, np.nan, "not compared", "not compared"),
    ],
)
def test_the_difference_of_the_wall_is_described_where_no_number_is_known(
    whole, beyond, said, tile, tmp_path, capsys
):
    found = replace(_twin(), psnr_db=whole, psnr_noise_free_db=beyond)
    _show(found, tmp_path)
    assert f"lit wall: {said}\n" in capsys.readouterr().out
    write_twin(found, DiagnosisTried(), TwinOf("/runs/one"), MadeBy("twin", {}, {}), tmp_path)
    assert f"<dd>{tile}</dd>" in (tmp_path / "twin.html").read_text("utf-8")


@pytest.mark.parametrize("diagnosed", [True, False])
@pytest.mark.parametrize("differs", [1.1, 9.0])
def test_the_page_says_once_that_the_probe_is_that_of_a_diagnosis(diagnosed, differs, tmp_path):
    regions = tuple(RegionFit(n, 9, 10.0, differs) for n in ("line_core", "wall"))
    of = TwinOf("/runs/one", (), diagnosed)
    write_twin(replace(_twin(), regions=regions), DiagnosisTried(), of, MadeBy("twin", {}, {}), tmp_path)
    page = (tmp_path / "twin.html").read_text("utf-8")
    assert page.count("with the probe as the diagnosis corrected it") == diagnosed
    assert twin_document(_twin(), DiagnosisTried(), of)["with_diagnosis"] == diagnosed


@pytest.mark.parametrize("found", [True, False])
def test_a_line_that_still_differs_is_unexplained_only_if_no_cause_was_found(found, tmp_path):
    worse = replace(_twin(), regions=(RegionFit("line_core", 9, 10.0, 2.5),), found=())
    tilt = Mismatch("laser_tilt", "line", "laser", (), (), 1e-9, 9.0, 0.9, "Laser tilt: pictures fit better.")
    gauge = GaugeTwin(np.array([2]), ("laser_tilt=0.6@40",), 9, 9.0, 0.9, 0.8, 2.0, 0.1, 0.09, 16.0, (True,))
    tried = DiagnosisTried(gauge, (tilt,)) if found else DiagnosisTried()
    write_twin(worse, tried, TwinOf("/runs/one", ()), MadeBy("twin", {}, {}), tmp_path)
    page = (tmp_path / "twin.html").read_text("utf-8")
    assert "differs by 1.6 times its noise" in page
    assert ("no law here explains" in page) != found
