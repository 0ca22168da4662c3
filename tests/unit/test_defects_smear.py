"""A noise filter shows each ring with a part of those before it: σ of a depth holds what that took off."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest
from scipy.signal import lfilter

from pipeline.adjustment.shared_light import NOTHING_HELD, HeldOver
from pipeline.arrays import Float
from pipeline.artefacts.findings import Defect
from stages.defects import DefectParameters, find_defects
from stages.defects.depth import Depth
from stages.defects.segment import Region
from stages.defects.smear import flattened
from tests.quiet import quiet_context
from tests.synthetic_wall import DrawnDefect, bare_recording, grey_texture, relief, smooth_noise, wall_of

if TYPE_CHECKING:
    from stages.defects.surface import Surface

RADIUS, HELD = 38.0, 0.8
DISTANCE = np.arange(0, 80, 0.5)
AZIMUTH = -np.pi + np.arange(480) * 2 * np.pi / 480


def found_on(wall_mm: np.ndarray, held: HeldOver) -> Defect:
    """Return the one finding on a noisy wall that departs so far from its bore."""
    noise = smooth_noise(np.random.default_rng(1), wall_mm.shape, 0.02, 2.0)
    wall = replace(wall_of(DISTANCE, AZIMUTH, RADIUS + wall_mm + noise, 0.02), held=held)
    found = find_defects(
        bare_recording(2 * RADIUS), wall, grey_texture(wall), DefectParameters(), quiet_context()
    )
    (defect,) = (*found.items, *found.unconfirmed)
    return defect


@pytest.mark.parametrize(("kind", "depth_mm"), [("pit", 1.0), ("weld", -0.9)])
def test_the_true_depth_lies_within_twice_the_sigma_of_a_flattened_one(kind: str, depth_mm: float) -> None:
    """Of a pit of 1.12 mm, behind a filter that mixes pictures, .78 ± .05 mm was told."""
    drawn = DrawnDefect(kind, 40.0, 1.0, 7.0, 7.0, depth_mm)
    true = relief(drawn, DISTANCE, AZIMUTH, RADIUS, np.random.default_rng(0))
    filtered = lfilter([1 - HELD], [1, -HELD], true, axis=0)
    told = found_on(filtered, HeldOver(HELD ** np.arange(12)))
    sharp = found_on(true, NOTHING_HELD)
    short = abs(sharp.depth_mm - told.depth_mm)
    assert short > 4 * sharp.depth_sigma_mm
    assert short < 2 * told.depth_sigma_mm
    assert told.depth_sigma_mm < 0.5 * abs(depth_mm)


def test_rings_that_share_as_much_as_usual_widen_nothing() -> None:
    drawn = DrawnDefect("pit", 40.0, 1.0, 7.0, 7.0, 1.0)
    true = relief(drawn, DISTANCE, AZIMUTH, RADIUS, np.random.default_rng(0))
    usual, none = found_on(true, HeldOver(0.16 ** np.arange(5))), found_on(true, NOTHING_HELD)
    assert usual.depth_sigma_mm == none.depth_sigma_mm


def told_sigma(seen_mm: Float, held: HeldOver, spacing_mm: float = 0.5) -> float:
    """Return the σ that a depth of ± .03 mm gets, of which ``seen_mm`` (H,) is seen every .5 mm."""
    region = Region(0, 0, np.ones((len(seen_mm), 1), bool), 1.0)
    surface = SimpleNamespace(
        local_mm=seen_mm[:, None],
        relief=SimpleNamespace(cell_mm=(0.5, 0.5)),
        points=SimpleNamespace(spacing_mm=spacing_mm),
    )
    depth = Depth(float(seen_mm.max()), 0.03, 0.0, (0, 0))
    return flattened(depth, region, cast("Surface", surface), held).sigma_mm


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize("share", [0.6, 0.8, 0.9, 0.95])
@pytest.mark.parametrize("bell_mm", [0.5, 1.0, 1.5, 2.5, 5.0])
def test_sigma_holds_what_bells_of_any_size_lost_to_filters_of_any_strength(
    bell_mm: float, share: float, backwards: bool
) -> None:
    """No more than a third was held: of 1 mm, .37 ± .13 and .35 ± .12 mm were told of narrow ones."""
    bell = np.exp(-0.5 * (np.arange(-200, 201) * 0.5 / bell_mm) ** 2)
    seen = lfilter([1 - share], [1, -share], bell)[:: -1 if backwards else 1]
    height = float(seen.max())
    found = seen[seen > 0.3 * height]
    sigma = told_sigma(found, HeldOver(share ** np.arange(12)))
    assert 1 - height < 1.3 * sigma
    assert sigma < 1.3 * (1 - height) + 0.03
