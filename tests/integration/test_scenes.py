"""Every shipped inspection in small, rendered and run by the whole pipeline; errors agree with their σ.

How well scenes of full size are measured is shown by ``python -m tests.benchmarks.bench_scenes``. The gauges
are not run here: this small camera cannot resolve their fiducials, and they are inputs of calibrate, not of
run.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from scipy.optimize import brentq

from pipeline.simulator.scene import Scene
from tests.scene_runs import run_scene
from tests.simulated import SCENES, shipped, smaller

pytestmark = pytest.mark.slow
NAMES = sorted(file.stem for file in SCENES.glob("*.yaml") if not file.stem.startswith("gauge"))
IN_WATER = "water-filled-3-inch"
# A camera with a sixteenth of the pixels, and a few centimetres of pipe; maps as coarse as its rings.
SHRINK, FRAMES = 4, 40
COARSE = ("accumulate.distance_step_mm=1.0", "accumulate.azimuth_samples=240", "mesh.texel_mm=0.5")
# The feature of each scene lies within these frames, and is large enough for this camera.
CHANGES: dict[str, dict[str, Any]] = {
    "hot-4-inch": {"effects": {"baseline_drift": {"drift_mm": 0.03, "time_s": 0.5}}},
    "mixed-light-2-inch": {"light": {"level": 0.5}},
    "slipping-4-inch": {"effects": {"encoder_slip": {"slip_mm": -4.0, "time_s": 0.7}}},
}
# Warming starts with the first frame.
LEGS = {"hot-4-inch": [{"duration_s": 2.0, "speed_mm_s": 16.0}]}
# Steep walls, at welds and pits, are known to about a ring's spacing along the pipe, not to their 1 σ.
LEAST_INSIDE = 0.85


def small(name: str) -> Scene:
    scene, changes = shipped(name), dict(CHANGES.get(name, {}))
    if name in LEGS:
        changes["motion"] = scene.motion.model_dump(mode="json", exclude_defaults=True) | {"legs": LEGS[name]}
    return smaller(scene, SHRINK, FRAMES, **changes)


@pytest.mark.parametrize("name", [n for n in NAMES if n != IN_WATER])
def test_a_shipped_scene_is_measured_within_the_stated_sigma(name: str, tmp_path: Path) -> None:
    found = run_scene(small(name), tmp_path, COARSE)
    assert abs(found.median_mm) <= 2 * found.stated_mm
    assert found.inside_95 >= LEAST_INSIDE
    assert abs(found.distance_percent) <= 3 * found.distance_sigma_percent
    assert found.coverage > 0.65


def test_with_water_behind_the_window_radii_are_off_as_snells_law_predicts(tmp_path: Path) -> None:
    scene = small(IN_WATER)
    found = run_scene(scene, tmp_path, COARSE)
    true, baseline = scene.pipe.diameter_mm / 2, scene.probe["laser"]["baseline_mm"]
    apparent = _through_water(true, baseline, 1 + scene.effects["outside_index"]["index_excess"])
    # the estimated motion partly adapts to the wrong medium, which takes half a millimetre back
    assert found.radius_mm == pytest.approx(apparent, abs=0.1 * (true - apparent))
    # rings and texture contradict each other in water, which widens σ to a part of the error
    assert found.inside_95 < 0.5


def _through_water(radius_mm: float, baseline_mm: float, index: float) -> float:
    """Return the apparent radius of a ray refracted at a sealed tube of 15 mm, by the exact law of Snell."""
    tube = 15.0

    def ahead(inside: float) -> float:
        return (radius_mm - tube) * math.tan(inside) + tube * math.tan(math.asin(index * math.sin(inside)))

    inside = brentq(lambda angle: ahead(angle) - baseline_mm, 1e-3, math.asin(0.999 / index))
    return baseline_mm / math.tan(math.asin(index * math.sin(inside)))
