"""The texture of short cuts of the open recordings, made with true motion and wall, against the truth."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.export.pictures import write_unrolled
from pipeline.recording.base import FrameTable
from stages.texture import TextureParameters, photograph_wall
from tests.quiet import quiet_context
from tests.shared_data import scorer, shared
from tests.truth_run import true_radius_map, truth_run


# The scoring program does not close its files.
@pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")
@pytest.mark.parametrize(
    ("name", "frames", "to_mm"), [("open-1-field", 90, 70.0), ("open-3-field", 60, 48.0)]
)
def test_the_texture_of_a_cut_meets_the_demanded_limits(name, frames, to_mm, tmp_path):
    run = truth_run(name)
    table = run.recording.frames
    cut = replace(
        run.recording,
        frames=FrameTable(table.frame[:frames], table.time_s[:frames], table.illumination[:frames]),
    )
    wall = replace(run.wall, radius_map=true_radius_map(name, 26.0, to_mm))
    told = {}
    context = replace(quiet_context(), report=lambda key, value, unit="": told.__setitem__(key, value))
    texture = photograph_wall(cut, run.probe, run.trajectory, wall, TextureParameters(), context)
    write_unrolled(texture, tmp_path)
    known = {"axial_scale_error": 0.0, "axial_shift_mm": 0.0, "roll_shift_deg": 0.0}
    score = scorer().texture_score(
        str(tmp_path), str(shared("recordings", name)), known | {"radius": run.trajectory.radius_mm}
    )
    assert score["psnr_db"] >= 30
    assert score["registration_p95_mm"] <= 0.15
    assert score["textured"] >= 0.99
    assert told["rejected: lit frames too dark, clipped or unreadable"] == 0
    assert np.isfinite(told["photometric residual"])
