"""What cannot lie on the wall of the stated pipe is left out, counted, and ends the run where it prevails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.errors import UnusableError
from pipeline.recording.base import BoreSection, PipeFacts
from stages.triangulate import TriangulateParameters, triangulate_rings
from stages.triangulate.possible import farthest_wall_mm, rings_at_an_end
from tests.quiet import quiet_context
from tests.unit.test_triangulate import AZIMUTH, PROBE, samples

PIPE = PipeFacts(50.8)
# Radius in the picture of a wall 25 mm away, and of one 100 mm away: more than 1.5 times the pipe's width.
NEAR_PX, FAR_PX = (
    float(np.linalg.norm(PROBE.camera.project(np.array([[r, 0, 23.4]])).uv[0] - PROBE.camera.centre_px))
    for r in (25.0, 100.0)
)


def triangulated(radius_px, pipe=PIPE):
    """Return the points of rings, the numbers that were reported, and the warnings."""
    told, warned = {}, []
    context = replace(
        quiet_context(), report=lambda name, value, unit="": told.update({name: value}), warn=warned.append
    )
    points = triangulate_rings(samples(radius_px), PROBE, TriangulateParameters(), context, pipe)
    return points, told, warned


def rings(count):
    return np.full((count, AZIMUTH.size), NEAR_PX)


def test_samples_farther_away_than_the_pipe_is_wide_are_left_out_and_counted():
    """Wall up to 12 m from the axis of a pipe of 51 mm came out, where the pipe's end was in view."""
    radius = rings(20)
    radius[5:7, :15] = FAR_PX
    points, told, warned = triangulated(radius)
    assert np.isnan(points.xyz_c[5:7, :15]).all()
    assert np.isnan(points.noise_direction[5:7, :15]).all()
    assert np.isfinite(points.xyz_c[..., 0]).sum() == radius.size - 30
    assert told["rejected: farther away than the stated pipe is wide"] == 30
    assert len(warned) == 1
    assert "in 2 frames from 5 to 6. Probably the end of the pipe" in warned[0]
    points, _, warned = triangulated(radius, None)
    assert np.isfinite(points.xyz_c).all(), "control: without a stated pipe all is possible"
    assert not warned


def test_a_ring_that_mostly_lies_too_far_away_is_left_out_whole():
    radius = rings(20)
    radius[5, :40], radius[6, :30] = FAR_PX, FAR_PX
    points, told, _ = triangulated(radius)
    assert np.isnan(points.xyz_c[5]).all()
    assert np.isfinite(points.xyz_c[6, 30:]).all()
    assert told["rejected: farther away than the stated pipe is wide"] == AZIMUTH.size + 30


def test_a_run_whose_samples_mostly_lie_too_far_away_ends():
    radius = rings(20)
    radius[8:] = FAR_PX
    with pytest.raises(UnusableError, match="end of the pipe or an opening is in view") as caught:
        triangulated(radius)
    assert caught.value.frames == tuple(range(8, 20))
    radius[8:11] = NEAR_PX
    assert np.isfinite(triangulated(radius)[0].xyz_c).any(), "control: with 9 of 20 it does not"


def test_a_sound_run_is_not_warned_of_and_keeps_all():
    points, told, warned = triangulated(rings(20))
    assert np.isfinite(points.xyz_c).all()
    assert not warned
    assert told["rejected: farther away than the stated pipe is wide"] == 0


def test_the_widest_stated_bore_counts():
    assert farthest_wall_mm(PipeFacts(50.0, bore=(BoreSection(10, 80.0), BoreSection(10, 40.0)))) == 120
    assert farthest_wall_mm(None) == np.inf


@pytest.mark.parametrize("end", [slice(0, 10), slice(10, 20)], ids=["first", "last"])
def test_pieces_of_rings_behind_the_end_of_a_pipe_are_not_taken_for_wall(end):
    """40 rings of noise, and of the rim of a pipe's end, a seventh of the circle each, became wall."""
    radius = rings(20)
    radius[end, 10:] = np.nan
    points, _, warned = triangulated(radius)
    assert np.isnan(points.xyz_c[end]).all()
    assert np.isfinite(points.xyz_c[..., 0]).sum() == 10 * AZIMUTH.size
    assert len(warned) == 1
    assert f"from frame {end.start} to {end.stop - 1} no ring shows" in warned[0]


def test_a_few_bad_rings_or_a_gap_within_the_run_are_no_end():
    xyz = np.zeros((40, 72, 3), np.float32)
    xyz[:8], xyz[12:30] = np.nan, np.nan
    assert rings_at_an_end(xyz) == []
    xyz[:9] = np.nan
    assert rings_at_an_end(xyz) == [slice(0, 9)]
    assert rings_at_an_end(np.full((40, 72, 3), np.nan, np.float32)) == [], "motion refuses such a run"
