"""A pit in a wider patch keeps its depth; what one ring alone shows is reported as a lower bound."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import uniform_filter

from stages.defects import DefectParameters, find_defects
from stages.defects.corroborate import Evidence, Witnesses
from stages.defects.depth import Depth
from stages.defects.grow import millimetre_mean
from stages.defects.judge import Found
from stages.defects.neighbours import frames_at_peak
from tests.quiet import quiet_context
from tests.synthetic_wall import bare_recording, grey_texture, smooth_noise, wall_of

RADIUS, NOISE_MM, MIDDLE = 38.0, 0.03, 60.0
AZIMUTH = -np.pi + np.arange(360) * np.pi / 180


def patch_with_pit(step_mm, patch_mm, pit_mm, wide_mm, seed, shift=(0.0, 0.0)):
    """Return the one finding of a patch 30 mm wide with a half ellipsoid in it, and its true 1 mm mean."""
    distance = np.arange(MIDDLE - 30, MIDDLE + 30, step_mm)
    along = (distance - MIDDLE)[:, None]
    around = (AZIMUTH * RADIUS)[None]
    out = np.hypot(along / 15, around / 15)
    into = np.hypot(along - shift[0], around - shift[1]) / (wide_mm / 2)
    height = patch_mm * np.where(out < 1, 1 - out**4, 0) + pit_mm * np.sqrt(np.maximum(1 - into**2, 0))
    noise = smooth_noise(np.random.default_rng(seed), height.shape, NOISE_MM, 1.5)
    wall = wall_of(distance, AZIMUTH, RADIUS + height + noise, NOISE_MM)
    told = find_defects(
        bare_recording(2 * RADIUS), wall, grey_texture(wall), DefectParameters(draws=20), quiet_context()
    )
    (finding,) = told.items
    return finding, float(np.nanmax(millimetre_mean(height, (step_mm, RADIUS * np.pi / 180))))


@pytest.mark.parametrize(
    ("step_mm", "patch_mm", "pit_mm", "wide_mm"),
    [(0.5, 0.5, 1.5, 4.0), (0.5, 0.8, 2.0, 4.0), (1.0, 0.6, 1.8, 3.0), (0.5, 0.47, 2.0, 3.45)],
)
def test_a_pit_on_many_rings_in_a_wider_patch_has_the_right_depth(step_mm, patch_mm, pit_mm, wide_mm):
    """1.95 mm was reported as 0.78 ± 0.25.

    A pit narrower than a fifth of the patch did not count in any ring.
    """
    finding, true = patch_with_pit(step_mm, patch_mm, pit_mm, wide_mm, seed=5)
    assert abs(finding.depth_mm - true) < 1.96 * finding.depth_sigma_mm
    assert finding.depth_sigma_mm < 0.2 * true
    assert "at least" not in finding.statement


@pytest.mark.parametrize(
    ("step_mm", "wide_mm", "pit_mm"), [(1.0, 1.8, 1.7), (0.5, 1.2, 1.7), (1.0, 1.8, 3.2)]
)
def test_the_range_of_a_pit_on_one_ring_includes_its_depth(step_mm, wide_mm, pit_mm):
    """2.2 mm was 0.63 ± 0.03; the pit may be a glint, but the corrosion around it stays confirmed."""
    finding, true = patch_with_pit(step_mm, 0.6, pit_mm, wide_mm, seed=5)
    assert abs(finding.depth_mm - true) < 1.96 * finding.depth_sigma_mm


@pytest.mark.parametrize("end_mm", [15.0, 16.0])
def test_a_glint_on_one_ring_at_the_end_of_corrosion_leaves_it_its_depth(end_mm):
    """No ring beyond the glint shows the corrosion: it was 1.13 ± .76 mm, and often unconfirmed."""
    finding, _ = patch_with_pit(1.0, 0.5, 2.0, 1.8, 5, (end_mm, 0.0))
    assert finding.peak_distance_mm < MIDDLE + 12
    assert abs(finding.depth_mm - 0.5) < 0.1
    assert "single rings show up to" in finding.statement


def test_a_glint_is_left_out_of_corrosion_on_which_four_rings_show_a_spot_of_the_wall(monkeypatch):
    """Rings left out for a spot counted as glints, of which at most four are left out."""
    monkeypatch.setattr(Witnesses, "spots_in", lambda *_: [24, 27, 30, 33])
    finding, _ = patch_with_pit(1.0, 0.5, 2.0, 1.8, 5, (15.0, 0.0))
    assert abs(finding.depth_mm - 0.5) < 0.1
    assert "single rings show up to" in finding.statement


def test_single_rings_beside_the_peak_of_a_narrow_finding_do_not_confirm_it():
    """Glints 0.9 mm wide were confirmed by rings whose noise reached half as much within 1 mm."""
    cells = SimpleNamespace(relief=SimpleNamespace(cell_mm=(0.5, 0.45)))
    narrow = SimpleNamespace(mask=np.ones((4, 2), bool))
    assert not frames_at_peak(Depth(-0.22, 0.07, 0.0, (1, 1)), narrow, cells).size


def test_the_depth_on_single_rings_is_written_without_a_sign():
    """A deposit's depth is negative: the sentence was "single rings show up to -2.30 mm"."""
    deposit = Found(None, None, None, None, 1.0, contradicted_mm=-2.3)
    assert "show up to 2.30 mm" in deposit._at_least()
    assert not deposit.flattened


def fine_mean(patch_mm, pit_mm, wide_mm):
    """Return the largest mean over a millimetre of a pit in a patch; it may lie between rings."""
    x = np.arange(-4, 4, 0.05)
    off = np.hypot(x[:, None], x[None]) / (wide_mm / 2)
    return float(uniform_filter(patch_mm + pit_mm * np.sqrt(np.maximum(1 - off**2, 0)), 20).max())


@pytest.mark.parametrize(
    ("step_mm", "pit_mm", "wide_mm", "shift"),
    [(1.0, 1.9, 2.1, (0.5, 0.0)), (1.0, 1.6, 2.0, (0.5, 1.0)), (0.5, 1.6, 1.3, (0.25, 0.0))],
)
def test_the_sigma_of_a_pit_on_two_rings_includes_what_may_lie_between_them(step_mm, pit_mm, wide_mm, shift):
    """2.43 mm was 2.11 ± 0.08.

    No bell is fitted in a wide patch, and the deepest place lies between rings.
    """
    finding, _ = patch_with_pit(step_mm, 0.6, pit_mm, wide_mm, 5, shift)
    assert abs(finding.depth_mm - fine_mean(0.6, pit_mm, wide_mm)) < 1.96 * finding.depth_sigma_mm
    assert finding.depth_sigma_mm < 0.35 * finding.depth_mm


@pytest.mark.parametrize(("sigma_mm", "vague"), [(0.3, False), (5.0, True)])
def test_a_glint_on_one_ring_neither_widens_a_depth_nor_confirms_an_uncertain_one(sigma_mm, vague):
    """A deep ring that others contradict had confirmed a finding, however large its σ was."""
    defect = SimpleNamespace(depth_mm=0.6, depth_sigma_mm=float(np.hypot(sigma_mm, 2.6)))
    found = Found(None, defect, None, None, 1.0, contradicted_mm=3.2, sigma_without_them_mm=sigma_mm)
    assert found.vague is vague


@pytest.mark.parametrize(("contradicted_mm", "score"), [(16.6, 3.5), (None, 37.9)])
def test_a_single_ring_that_others_contradict_does_not_make_a_finding_strong(contradicted_mm, score):
    """Beside a strut one wild ring gave .23 mm a score of 37.9: "corrosion", confirmed with .98."""
    by_others = SimpleNamespace(depth_mm=0.234, depth_sigma_mm=0.067)
    evidence = Evidence(5, False, 37.9)
    found = Found(None, None, by_others, evidence, 1.0, contradicted_mm=contradicted_mm)
    assert found.uncontradicted.score == pytest.approx(score, abs=0.05)
