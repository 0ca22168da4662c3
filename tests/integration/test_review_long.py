"""The model of a long pipe is split into stretches; those next to the camera are shown in detail."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pipeline.review.model_stretches import StretchedModel, model_of
from pipeline.review.run_files import RunFiles
from tests.long_run import write_long_run
from tests.review_browser import chromium, tab
from tests.review_server import ReviewServer
from tests.shared_data import PROJECT_ROOT

LENGTH_MM = 2000.0
_TO_BE_MARKED = """(({ session, model: { marks } }) => {
  const { radius_mm: r } = session.run;
  return session.standing.filter(({ size: s }) =>
    s.distance_to_mm > marks.at - 2 * r && s.distance_from_mm < marks.at + 8 * r).length; })(boresight)"""


@pytest.fixture(scope="module")
def long(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sample's run repeated several times."""
    folder = tmp_path_factory.mktemp("long") / "run"
    write_long_run(sample, folder, LENGTH_MM, coarser=4)
    return folder


def positions(glb: bytes) -> tuple[np.ndarray, dict[str, object]]:
    length = struct.unpack_from("<I", glb, 12)[0]
    document, binary = json.loads(glb[20 : 20 + length]), glb[28 + length :]
    assert struct.unpack_from("<I", glb, 8)[0] == len(glb)
    accessor = document["accessors"][document["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]
    view = document["bufferViews"][accessor["bufferView"]]
    part = binary[view["byteOffset"] :][: view["byteLength"]]
    return np.frombuffer(part, np.float32).reshape(-1, 3), document


def z_span(model: StretchedModel, number: int) -> tuple[float, float]:
    z = 1000 * positions(model.stretch(number))[0][:, 2]
    return float(z.min()), float(z.max())


def test_stretches_have_no_gaps_and_cover_the_pipe(long: Path) -> None:
    model = model_of(RunFiles(long))
    stretches = model.stretches()
    assert len(stretches) > 15
    assert stretches[-1].to_mm - stretches[0].from_mm == pytest.approx(LENGTH_MM, rel=0.06)
    for k in (0, 7, len(stretches) - 1):
        assert z_span(model, k) == pytest.approx((stretches[k].from_mm, stretches[k].to_mm), abs=0.5)


def test_the_places_of_stretches_are_found_without_slow_imports(long: Path) -> None:
    """The first view waits for it, and SciPy and Numba would take longer to load than everything else."""
    told = (
        "import sys; from pathlib import Path; from pipeline.review.model_stretches import model_of;"
        "from pipeline.review.run_files import RunFiles;"
        "assert len(model_of(RunFiles(Path(sys.argv[1]))).stretches()) > 15; print(*sys.modules)"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", told, str(long)], cwd=PROJECT_ROOT, capture_output=True, text=True, check=True
    )
    assert not {"numba", "scipy"} & set(loaded.stdout.split())


def test_a_stretch_has_all_data_that_it_uses_and_no_other(sample: Path) -> None:
    model = model_of(RunFiles(sample))
    whole = sample / "model.glb"
    sizes = [len(model.stretch(k)) for k in range(len(model.stretches()))]
    assert sum(sizes) == pytest.approx(whole.stat().st_size, rel=0.02)
    _, document = positions(model.stretch(0))
    assert len(document["materials"]) == len(document["images"]) == 4
    assert len(document["bufferViews"]) == len(document["accessors"]) + 4
    assert document["buffers"][0]["byteLength"] >= max(
        v["byteOffset"] + v["byteLength"] for v in document["bufferViews"]
    )


def test_only_what_is_near_the_camera_is_loaded_in_detail(long: Path) -> None:
    with chromium() as browser, ReviewServer(long) as server:
        context = browser.new_context(viewport={"width": 1280, "height": 720})
        with tab(context, server.origin) as page:
            page.open(server.address)
            for distance in (1500, 400):
                page.js(f"boresight.session.moveTo([{distance}, 0])")
                page.until("boresight.model.isReady", 60)
                first, last = page.js("boresight.model.fine.span")
                assert first < distance < last
                assert last - first < LENGTH_MM / 2
                assert page.js("boresight.model.fine.held.size") <= 10
            seen = page.js("boresight.model.coarse.pieces.filter((p) => p.mesh.visible).length")
            assert seen > 0, "distant stretches are seen coarsely"
            page.until("boresight.model.coarse.pieces.some((p) => p.mesh.material[0].map)")
            marked = "document.querySelectorAll('.mark.finding').length"
            assert page.js(marked) == page.js(_TO_BE_MARKED), "of many stretches, those near the camera"
            page.js("boresight.session.moveTo([1200, -1])")
            at = page.js("[boresight.flat.x(1200), boresight.flat.size[0]]")
            assert 0 <= at[0] <= at[1], "the detailed wall follows the chosen place"
        context.close()
