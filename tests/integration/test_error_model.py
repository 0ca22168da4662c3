"""`boresight error-model`: its numbers and figures, and the page's model in node and in a browser."""

import json
import math
import re
import shutil
import subprocess
from dataclasses import asdict
from html import unescape
from importlib.resources import files
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from pipeline.commands.error_model import error_model, error_model_page, page_camera
from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.misalignment import MisalignedScan, allowed_tilt_deg, misalignment_error
from tests.patience import patience
from tests.shared_data import shared

KEYS = {
    "paper_equation_mm",
    "max_radial_mm",
    "max_euclidean_mm",
    "ring_centre_shift_mm",
    "ring_radius_change_mm",
}
CAMERA = KannalaBrandt((1600, 900), (366.0, 366.0), (797.0, 442.0), (-0.0118, 0.0008, -0.0008, 0.0))
SCANS = [
    MisalignedScan(101.6, 22.0, 0.6),
    MisalignedScan(101.6, 22.5, 0.05),
    MisalignedScan(50.8, 23.4, 1.1, -130.0, 179.6, 4.0, -3.0),
    MisalignedScan(76.2, 30.0, 0.3, 75.0, 180.8, -9.0, 6.5),
    MisalignedScan(101.6, 8.0, 0.4, 20.0, 180.0, 20.0, 10.0),
]
ACCURACY_MM = 0.15


def run(*arguments: str):
    app = typer.Typer()
    app.command()(error_model)
    return CliRunner().invoke(app, list(arguments))


def page_parameters() -> str:
    return json.dumps(
        [asdict(s) | {"accuracy_mm": ACCURACY_MM, "camera": page_camera(CAMERA)} for s in SCANS]
    )


def in_node(program: str) -> object:
    """Return the output of a JavaScript program in which the page's model is ``b``."""
    node = shutil.which("node") or pytest.skip("node is not installed")
    model = json.dumps(str(files("pipeline.pages") / "error_model.js"))
    told = f"const b = require({model}); console.log(JSON.stringify({program}))"
    done = subprocess.run(
        [node, "-e", told], capture_output=True, text=True, check=True, timeout=patience(60)
    )
    return json.loads(done.stdout)


def assert_same_as_python(computed: list[dict[str, float]]) -> None:
    assert len(computed) == len(SCANS)
    for scan, numbers in zip(SCANS, computed, strict=True):
        expected = asdict(misalignment_error(scan, CAMERA))
        allowed = allowed_tilt_deg(scan, ACCURACY_MM)
        expected["allowed_tilt_deg"] = None if math.isnan(allowed) else allowed
        for name, value in expected.items():
            wanted = None if value is None else pytest.approx(value, rel=1e-9, abs=1e-11)
            assert numbers[name] == wanted, (scan, name)
        shift = max(
            math.dist(*pair)
            for pair in zip(
                CAMERA.project(scan.wall_points(scan.azimuths())).uv,
                CAMERA.project(
                    MisalignedScan(
                        scan.diameter_mm, scan.baseline_mm,
                        offset_x_mm=scan.offset_x_mm, offset_y_mm=scan.offset_y_mm,
                    ).wall_points(scan.azimuths())
                ).uv,
                strict=True,
            )
        )  # fmt: skip
        assert numbers["max_image_shift_px"] == pytest.approx(shift, abs=1e-9)


def test_json_has_exactly_its_keys_and_the_numbers_of_the_paper():
    result = run("--json", "--diameter-mm", "101.6", "--tilt-deg", "0.6", "--baseline-mm", "22")
    numbers = json.loads(result.stdout)
    assert set(numbers) == KEYS
    assert numbers["paper_equation_mm"] == pytest.approx(1.199, abs=5e-4)
    assert numbers["max_radial_mm"] == pytest.approx(1.259, abs=5e-4)
    assert not list(Path.cwd().glob("error-model/*")), "--json alone writes no files"


def test_json_with_accuracy_adds_the_allowed_tilt():
    numbers = json.loads(run("--json", "--baseline-mm", "22.5", "--accuracy-mm", "0.1").stdout)
    assert set(numbers) == KEYS | {"allowed_tilt_deg"}
    assert numbers["allowed_tilt_deg"] == pytest.approx(0.05, abs=2e-4)


@pytest.mark.parametrize("option", ["--diameter-mm", "--baseline-mm"])
def test_a_negative_length_is_refused_with_its_name(option):
    result = run("--json", option, "-5")
    assert result.exit_code != 0
    assert option.strip("-").replace("-", "_") in str(result.exception)


def test_two_calls_write_the_same_figures_and_page(tmp_path):
    for name in ("a", "b"):
        assert run("-o", str(tmp_path / name)).exit_code == 0
    names = {p.name for p in (tmp_path / "a").iterdir()}
    assert names == {"fig4-ring.png", "fig4-ring.svg", "fig5-tilt.png", "fig5-tilt.svg", "error-model.html"}
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes(), name
    assert "baseline 22 mm" in (tmp_path / "a" / "fig5-tilt.svg").read_text("utf-8")


def test_the_page_is_one_file_that_loads_nothing():
    page = error_model_page(SCANS[0], CAMERA, "probe.yaml", 0.1)
    assert not re.search(r"""(?:src|href)\s*=\s*["'](?!#)|https?://|@import|url\((?!#)""", page)
    assert "</script>" not in page.split('id="start">')[1].split("</script>")[0]


def test_the_pages_model_in_node_agrees_with_python():
    assert_same_as_python(
        in_node(
            f"{page_parameters()}.map((p) => {{"
            "const o = b.compute(p); delete o.ring; delete o.image; return o; })"
        )
    )


def test_the_page_in_a_browser_agrees_with_python(tmp_path):
    browser = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if browser is None:
        pytest.skip("no chromium: the page was not tried in a browser")
    page = error_model_page(SCANS[0], CAMERA, "probe.yaml", 0.1)
    probe = (
        "<pre id='computed'></pre><script>document.getElementById('computed').textContent ="
        f"JSON.stringify({page_parameters()}.map((p) => {{ const o = window.boresight.compute(p);"
        "delete o.ring; delete o.image; return o; }));"
        "const tilt = document.getElementById('in-tilt_deg'); tilt.value = 1.2;"
        "tilt.dispatchEvent(new Event('input'));"
        "document.querySelector('[data-diameter=\"76.2\"]').click();</script></body>"
    )
    (tmp_path / "page.html").write_text(page.replace("</body>", probe), "utf-8")
    done = subprocess.run(
        [
            browser, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}",
            "--dump-dom", (tmp_path / "page.html").as_uri(),
        ],
        capture_output=True, text=True, check=True, timeout=patience(120),
    )  # fmt: skip
    computed = re.search(r'<pre id="computed">(.*?)</pre>', done.stdout, re.DOTALL)
    assert_same_as_python(json.loads(unescape(computed.group(1))))
    shown = re.search(r"Largest radial error, exact</dt><dd>([0-9.]+) mm", done.stdout)
    moved = misalignment_error(MisalignedScan(76.2, 22.0, 1.2)).max_radial_mm
    assert float(shown.group(1)) == pytest.approx(moved, abs=5e-4), "slider and button change the numbers"
    assert done.stdout.count("<path") > 10, "charts are drawn"


def test_page_reads_the_probe_file_as_python_does():
    probe = shared("recordings", "open-1-field", "probe.yaml")
    read = in_node(f"b.parseProbe(require('fs').readFileSync({json.dumps(str(probe))}, 'utf8'))")
    numbers = json.loads(run(str(probe), "--json").stdout)
    scan = MisalignedScan(101.6, read["laser"]["baseline_mm"], 0.6)
    assert numbers["paper_equation_mm"] == pytest.approx(misalignment_error(scan).paper_equation_mm)
    assert read["camera"]["focal_px"] == [366.0747, 366.0747]
    assert read["camera"]["distortion"] == [-0.011789, 0.000796, -0.000835, 0.0]


def test_any_other_camera_becomes_a_table_with_which_the_page_projects():
    class Other(KannalaBrandt):
        model = "other"

    camera = page_camera(Other(CAMERA.image_size, (366.0, 364.0), CAMERA.centre, CAMERA.distortion))
    told = in_node(f"b.project({json.dumps(camera)}, 30.1, -40.3, 21.7)")
    exact = KannalaBrandt(CAMERA.image_size, (366.0, 364.0), CAMERA.centre, CAMERA.distortion).project(
        (30.1, -40.3, 21.7)
    )
    assert told == pytest.approx(exact.uv.tolist(), abs=0.02)
