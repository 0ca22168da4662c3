"""Defects on the true walls of the open recordings, on a half-millimetre grid with noise and an offset."""

import json

import numpy as np
import pytest

from pipeline.export.tables import write_defects
from stages.defects import DefectParameters, find_defects
from tests.quiet import quiet_context
from tests.shared_data import scorer, shared
from tests.synthetic_wall import bare_recording, grey_texture, smooth_noise, wall_of

# the shared scoring program does not close its files
pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]


@pytest.mark.parametrize(("name", "nominal_mm"), [("open-1-field", 101.6), ("open-2-field", 101.6),
                                                  ("open-3-field", 50.8)])  # fmt: skip
def test_the_demanded_defects_are_found_to_a_tenth_of_a_millimetre(name, nominal_mm, tmp_path):
    score = scorer()
    truth = score.truth_of(str(shared("recordings", name)))
    poses, s_true, psi_true, r_true = truth[:4]
    distance = np.arange(20.0, poses[-1][2, 3] + 40, 0.5)
    azimuth = -np.pi + np.arange(1080) * np.pi / 540
    s, psi = np.meshgrid(distance, azimuth, indexing="ij")
    true = [a.astype(float) for a in (s_true, psi_true, r_true)]
    radius = score.interp(*true, s.ravel(), psi.ravel()).reshape(s.shape)
    noise = smooth_noise(np.random.default_rng(5), s.shape, 0.03, 2.0)
    # a systematic offset of the size that a stated probe leaves
    wall = wall_of(distance, azimuth, radius + noise + 0.08, 0.03, 0.085)
    recording = bare_recording(nominal_mm, name=name)
    found = find_defects(recording, wall, grey_texture(wall), DefectParameters(), quiet_context())
    write_defects(found, tmp_path)
    result = score.defect_score(str(tmp_path), truth)
    assert result["missed"] == 0, json.dumps(result["detail"])
    assert result["unmatched"] <= 1
    assert result["worst_depth_error_mm"] <= 0.1, json.dumps(result["detail"])
