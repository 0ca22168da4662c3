"""Every geometric effect is rendered where its traced rays are, and other effects do not move the ring."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from pipeline.arrays import Float
from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.recording.base import FrameTable
from pipeline.simulator.effects import switch_on
from pipeline.simulator.effects.switch import Switch, parse_switch, parse_switches, typical_switch
from pipeline.simulator.instrument import LineProfile
from pipeline.simulator.laws import bench_truth, trace_ring
from pipeline.simulator.motion import Motion, Signal, constant
from pipeline.simulator.render import renderer_of
from pipeline.simulator.sensor import through_lens
from pipeline.simulator.truth import SceneTruth

FOCAL_PX, SIZE = 100.0, (256, 256)
TIME_S = 0.0472  # the crest of a wave of 5.3 Hz
AROUND = 48

GEOMETRIC = (
    "laser_tilt=0.3@40", "laser_cone=0.2", "baseline=0.2", "beam_decentre=0.2@40", "sheet_waviness=3x2@30",
    "sheet_waviness=3x5@30", "laser_rocking=5@40/5.3Hz", "principal_point=0.5@40", "focal_scale=0.005",
    "radial_distortion=0.003", "sensor_tilt=0.001@40", "pixel_aspect=0.005", "pupil_shift=1",
    "rolling_shutter=0.08", "baseline_drift=1/0.5s", "focal_drift=0.02/0.5s", "centre_drift=5@40/0.5s",
    "housing_glass=2", "tube_wedge=0.5@40", "tube_tilt=10@40", "dome_axial=2", "dome_lateral=2@40",
    "outside_index=0.333", "ovality=0.3@20", "probe_vibration=0.3@40/5.3Hz",
)  # fmt: skip


def small_truth() -> SceneTruth:
    """Return the test scene in a small picture, with the probe moving sideways, at one moment."""
    truth = bench_truth(50.8)
    model = KannalaBrandt(SIZE, (FOCAL_PX, FOCAL_PX), (127.3, 127.8))
    sideways = Signal(np.array([-1.0, 1.0]), np.array([-6.0, 6.0]))
    return replace(
        truth,
        stated=replace(truth.stated, camera=model),
        instrument=replace(
            truth.instrument,
            camera=replace(truth.instrument.camera, model=model),
            # wide enough for pixels of 1.4 mm not to undersample it
            laser=replace(truth.instrument.laser, profile=LineProfile(0.5)),
        ),
        motion=Motion(constant(0.0), x_mm=sideways),
        frames=FrameTable(np.arange(1), np.array([TIME_S]), np.array(["laser"])),
    )


def at_start(truth: SceneTruth) -> SceneTruth:
    """Return the scene for an effect whose clock begins at time 0."""
    return replace(truth, frames=replace(truth.frames, time_s=np.zeros(1)))


def rendered_radii(truth: SceneTruth) -> Float:
    """Return centroids along the picture's radii, px."""
    sensor = truth.instrument.sensor
    light = through_lens(renderer_of(truth).light(0), sensor, None)[..., 1].astype(float)
    psi = -np.pi + 2 * np.pi * np.arange(AROUND) / AROUND
    rho = np.arange(85.0, 127.0, 0.1)
    u, v = (
        c + rho * f(psi)[:, None]
        for c, f in zip(truth.stated.camera.centre_px, (np.cos, np.sin), strict=True)
    )
    grey = map_coordinates(light, [v, u], order=3, mode="nearest")
    return np.asarray(np.sum(rho * grey, 1) / np.sum(grey, 1))


def traced_radii(truth: SceneTruth) -> Float:
    uv = trace_ring(truth, TIME_S, AROUND).uv
    return np.asarray(np.linalg.norm(uv - truth.stated.camera.centre_px, axis=1))


def switched(*switches: Switch) -> SceneTruth:
    return replace(switch_on(at_start(small_truth()), switches), frames=small_truth().frames)


@pytest.fixture(scope="module")
def plain() -> tuple[Float, Float]:
    """Rendered and traced radii without any effect; their difference is due to the finite line width."""
    return rendered_radii(small_truth()), traced_radii(small_truth())


@pytest.mark.parametrize("text", GEOMETRIC)
def test_a_geometric_effect_is_rendered_where_its_rays_go(text: str, plain: tuple[Float, Float]) -> None:
    truth = switched(parse_switch(text))
    moved = traced_radii(truth) - plain[1]
    assert np.abs(moved).max() > 0.03  # the effect is visible at all
    # a hundredth of a pixel, and the effect of the line's width on a displaced ring
    tolerance = 0.01 + 0.01 * np.abs(moved).max()
    np.testing.assert_allclose(rendered_radii(truth) - plain[0], moved, atol=tolerance)


def test_combined_effects_are_rendered_where_their_rays_go(plain: tuple[Float, Float]) -> None:
    texts = [
        "laser_tilt=0.3@40",
        "focal_scale=0.004",
        "housing_glass=2",
        "dome_lateral=1@10",
        "ovality=0.3@20",
    ]
    truth = switched(*parse_switches(texts))
    moved = traced_radii(truth) - plain[1]
    np.testing.assert_allclose(
        rendered_radii(truth) - plain[0], moved, atol=0.01 + 0.01 * np.abs(moved).max()
    )


@pytest.mark.parametrize("name", ["encoder_scale", "encoder_slip", "encoder_backlash", "time_offset"])
def test_effects_of_the_encoder_do_not_change_the_picture(name: str) -> None:
    light = renderer_of(switched(typical_switch(name))).light(0)
    np.testing.assert_array_equal(light, renderer_of(small_truth()).light(0))
