"""The light of the LEDs computed tile by tile against the plain method, which marches along every ray."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.geometry.axis import PipeAxis, frames_at
from pipeline.simulator.render import renderer_of, view_of
from pipeline.simulator.truth import SceneTruth
from pipeline.simulator.wall import bent_axis
from pipeline.simulator.wall.description import Bend
from pipeline.simulator.wall_light import lamps_of
from pipeline.simulator.wall_tiles import add_wall
from tests.unit.simulated_pipe import RADIUS, small_truth


def rough_truth(axis: PipeAxis | None = None) -> SceneTruth:
    """Return a rough, glossy pipe with a step to a wider bore and a dent on one side."""
    truth = small_truth()
    wall, grid = truth.wall, truth.wall.shape
    s, psi = grid.distance_mm[:, None], grid.azimuth_rad[None, :]
    rough = 0.02 * np.sin(s / 1.7) * np.sin(9 * psi + s / 3) + 0.02 * np.cos(s / 2.9 + 14 * psi)
    dent = -2.0 * np.exp(-0.5 * ((s - 45) / 5) ** 2 - 0.5 * ((psi - 0.6) / 0.15) ** 2)
    radius = RADIUS + rough + dent + 4.0 * (s > 70)
    grain = 0.4 * np.exp(0.3 * np.sin(3 * s / 2) * np.sin(31 * psi))[..., None]
    wall = replace(
        wall, radius_mm=radius.astype(np.float32), gloss=0.2, axis=axis or wall.axis,
        albedo_bgr=np.repeat(grain, 3, -1).astype(np.float32),
    )  # fmt: skip
    return replace(truth, wall=wall)


def both_ways(truth: SceneTruth, **surface: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the light (H, W) tile by tile, with tables of the surface replaced, and by the plain method."""
    renderer = renderer_of(truth)
    shot = renderer.shot(1)
    view = view_of(renderer.scenery, shot)
    plain = view._replace(clear_mm=np.zeros_like(view.clear_mm))
    changed = view._replace(surface=view.surface._replace(**surface))
    if surface:
        changed = changed._replace(clear_mm=np.full_like(view.clear_mm, np.inf))
    images = []
    for each in (changed, plain):
        image = np.zeros((300, 400, 3), np.float32)
        add_wall(each, lamps_of(shot.instrument.light), np.ones(3), truth.rendering.wall_samples, image)
        images.append(image[..., 1].astype(float))
    return images[0], images[1]


def bent() -> PipeAxis:
    return bent_axis((-20.0, 130.0), (Bend(distance_mm=5, length_mm=80, curvature_per_mm=0.002),))


@pytest.mark.parametrize("axis", [None, bent()], ids=["straight", "bent"])
def test_tiles_agree_with_the_plain_method_far_below_the_noise(axis):
    tiles, plain = both_ways(rough_truth(axis))
    assert (plain > 0).mean() > 0.4
    # noise of a pixel at 10,000 electrons full scale is 1 % of full scale and more
    assert np.abs(tiles - plain).max() < 2e-3
    assert np.sqrt(np.mean((tiles - plain) ** 2)) < 1e-4


def test_a_wall_declared_calm_everywhere_is_rendered_wrongly():
    """Negative control: the comparison notices hits behind the dent and lamps that it should hide."""
    calm = np.zeros_like(renderer_of(rough_truth()).scenery.surface.steepest)
    tiles, plain = both_ways(rough_truth(), steepest=calm)
    assert np.abs(tiles - plain).max() > 0.05


def test_parts_of_pixels_and_a_moving_camera_agree_too():
    truth = rough_truth()
    finer = truth.rendering.model_copy(update={"wall_samples": 2, "time_samples": 2})
    shutter = replace(truth.instrument.shutter, kind="rolling", readout_s=0.02, exposure_s=0.05)
    tiles, plain = both_ways(
        replace(truth, rendering=finer, instrument=replace(truth.instrument, shutter=shutter))
    )
    assert np.abs(tiles - plain).max() < 2e-3


def test_a_coarse_axis_is_refined_without_moving():
    """An axis of few points, as measured by a run, gives the wall that `frames_at` describes."""
    fine = bent()
    coarse = PipeAxis(fine.distance_mm[::40], fine.origin_p[::40], fine.R_pa[::40])
    surface = renderer_of(rough_truth(coarse)).scenery.surface
    assert np.allclose(np.diff(surface.axis_s), surface.axis_s[1] - surface.axis_s[0])
    origin, turn = frames_at(coarse, surface.axis_s)
    np.testing.assert_allclose(surface.axis_o, origin, atol=1e-9)
    np.testing.assert_allclose(surface.axis_turn, turn, atol=1e-9)


def test_shadows_are_computed_wherever_an_led_of_a_wide_ring_is_hidden():
    truth = rough_truth()
    renderer = renderer_of(truth)
    shot = renderer.shot(1)
    view = view_of(renderer.scenery, shot)
    lamps = lamps_of(replace(shot.instrument.light, radius_mm=38.0))
    images = []
    # at 1000 mm the wall is searched from every hit, at 11 mm as if the ring were a narrow one
    for radius_mm in (lamps.radius_mm, 1000.0, 11.0):
        image = np.zeros((300, 400, 3), np.float32)
        add_wall(view, lamps._replace(radius_mm=radius_mm), np.ones(3), 1, image)
        images.append(image)
    own, searched, narrow = images
    assert np.abs(own - searched).max() < 1e-6
    assert np.abs(narrow - searched).max() > 1e-2
