"""The line's width over the image scale.

How it may change by blur at the picture's edge, and how it may not.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipeline.arrays import Float
from stages.diagnose.profile.cells import LineGeometry
from stages.diagnose.profile.width import width_findings
from tests.gauge_runs import stated_probe

FRAMES, SECTORS, LINE_MM = 120, 24, 0.12


def seen(edge_blur: float, gamma: float) -> tuple[bool, float]:
    """Return whether a response is found, and its exponent, in a run through three bores."""
    probe = stated_probe()
    random = np.random.default_rng(1)
    radius_mm = np.repeat([50.8, 42.0, 35.0], FRAMES // 3)[:, None] + random.normal(0, 1.5, (FRAMES, SECTORS))
    azimuth = np.linspace(-np.pi, np.pi, SECTORS, endpoint=False)
    line = np.stack([radius_mm, 0 * radius_mm, np.full_like(radius_mm, probe.laser.baseline_mm)], -1)
    back = line - [0.0, 0.0, 1.0]
    radius_px, further = (np.abs(probe.camera.project(p).uv[..., 0] - 799.0) for p in (line, back))
    px_per_mm = further - radius_px
    blur2 = 0.5 * (1 + edge_blur * (radius_px / 600) ** 2)
    variance: Float = (blur2 + (probe.laser.line_sigma_mm * px_per_mm) ** 2) / gamma
    width = np.sqrt(variance * (1 + random.normal(0, 0.01, variance.shape)))
    nothing = np.zeros_like(width)
    geometry = LineGeometry(
        azimuth, radius_px, width, nothing + 100, radius_mm, nothing, px_per_mm, nothing,
        np.ones(FRAMES, bool),
    )  # fmt: skip
    cells: Any = SimpleNamespace(block_of_frames=lambda count: np.arange(count) // 10)
    found, _ = width_findings(cells, geometry, probe)
    return found.found, found.sizes[0].value


@pytest.mark.parametrize("edge_blur", [0.0, 1.0, 3.0])
def test_a_lens_that_is_less_sharp_at_its_edge_is_not_an_error_of_response_or_line(edge_blur: float) -> None:
    """Such a lens made a sound probe a class of gamma and albedo bias at p = 6e-10."""
    assert not seen(edge_blur, 1.0)[0]


def test_a_response_that_no_blur_at_the_edge_can_explain_is_found() -> None:
    found, exponent = seen(0.0, 0.45)
    assert found
    assert exponent == pytest.approx(0.45, abs=0.05)
