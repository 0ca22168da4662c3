"""Units, signs and diameters that the pictures contradict."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from pipeline.errors import UnusableError
from pipeline.recording.base import BoreSection, Encoder, FrameTable, Illumination, PipeFacts
from stages.premises.backwards import runs_forwards
from stages.premises.losses import Steps
from stages.premises.scale import check_diameter, encoder_factor, in_mm, warn_of_oval
from tests.drawn_run import BASELINE, RADIUS
from tests.hand_pulled import pulled
from tests.premises_run import COUNT, STEP_MM, checked, ring_image
from tests.quiet import quiet_context
from tests.ring_images import MemorySource
from tests.spoiled_recordings import KeptFrames


@pytest.mark.parametrize(
    ("factor", "message"),
    [
        (1 / 25.4, "in inch"),
        (1 / 1000, "in m "),
        (-1.0, "its sign reversed"),
        (-0.1, "in cm instead of mm and"),
    ],
)
def test_encoder_readings_are_converted_to_mm_and_to_the_direction_of_motion(factor, message, good, run):
    encoder = Encoder(good.encoder.time_s, good.encoder.distance_mm * factor)
    found, told = checked(replace(good, encoder=encoder), run.probe)
    assert found.encoder_factor == pytest.approx(1 / factor)
    assert message in told[0]
    repaired = found.applied_to(replace(good, encoder=encoder)).encoder
    np.testing.assert_allclose(repaired.distance_mm, good.encoder.distance_mm)


@pytest.mark.parametrize(
    ("diameter_mm", "message"), [(2 * RADIUS / 25.4, "stated in inch"), (RADIUS, "the radius were stated")]
)
def test_a_diameter_that_the_ring_contradicts_ends_the_run(diameter_mm, message, good, run):
    with pytest.raises(UnusableError, match=message):
        checked(replace(good, pipe=PipeFacts(diameter_mm)), run.probe)


def test_a_joint_in_lit_pictures_is_not_taken_for_the_laser_ring(good, run):
    """Where pictures were cropped to less than the ring, a weld made the pipe's diameter 46.2 mm of 60.3."""
    joint = np.uint8(0.6 * ring_image(run.probe))
    size, (u, v) = good.source.image_size, run.probe.camera.centre_px
    nearer = cv2.warpAffine(joint, np.float32([[0.75, 0, u / 4], [0, 0.75, v / 4]]), size)
    lit = dict(zip(good.frames.frame, good.frames.illumination == Illumination.LED.value, strict=True))
    images = {
        k: cv2.add(image, nearer) if lit[k] else np.full_like(image, 4)
        for k, image in good.source.images.items()
    }
    _, told = checked(replace(good, source=MemorySource(images, size)), run.probe)
    assert not [t for t in told if "diameter" in t]


@pytest.mark.parametrize(("stretch", "told_of"), [(1.0, False), (1.03, True)])
def test_stretched_pictures_are_distinguished_from_an_oval_pipe(stretch, told_of, good, run):
    """Pixels 2 % too wide gave three warnings, and none said what was wrong."""
    (u, _), size = run.probe.camera.centre_px, good.source.image_size
    wider = np.float32([[stretch, 0, u * (1 - stretch)], [0, 1, 0]])
    images = {k: cv2.warpAffine(image, wider, size) for k, image in good.source.images.items()}
    _, told = checked(replace(good, source=MemorySource(images, size)), run.probe)
    assert any("% longer towards 3:00 in the picture" in t or "towards 9:00" in t for t in told) is told_of


def test_the_ovality_of_a_ring_with_gaps_is_that_of_its_visible_part():
    """A point in the very centre, and sectors without a line, ended gauge runs with a division by zero."""
    azimuth = np.linspace(-np.pi, np.pi, 72, endpoint=False)
    radius = 25 * (1 + 0.03 * np.cos(2 * (azimuth - np.pi / 2)))
    rings = np.tile(radius[:, None] * np.stack([np.cos(azimuth), np.sin(azimuth)], -1), (20, 1, 1))
    rings[::3, 5:12] = np.nan
    rings[1, 40], rings[2] = 0, np.nan
    told = []
    warn_of_oval(rings, replace(quiet_context(), warn=told.append))
    assert "6.0 % longer towards 6:00" in told[0] or "6.0 % longer towards 12:00" in told[0], told


def test_blocks_of_a_codec_on_the_line_are_not_an_oval():
    azimuth = np.linspace(-np.pi, np.pi, 128, endpoint=False)
    rings = np.tile(25 * np.stack([np.cos(azimuth), np.sin(azimuth)], -1), (20, 1, 1))
    rings[:, 60:70] *= 0.7
    rings[:, 120:128] *= 0.8
    told = []
    warn_of_oval(rings, replace(quiet_context(), warn=told.append))
    assert not told


def test_a_probe_file_all_in_inches_ends_the_run(good, run):
    """All lengths agree, except for the lamps, and the pipe was 25 times too small without a message."""
    laser = replace(run.probe.laser, baseline_mm=BASELINE / 25.4)
    encoder = Encoder(good.encoder.time_s, good.encoder.distance_mm / 25.4)
    inch = replace(good, pipe=PipeFacts(2 * RADIUS / 25.4), encoder=encoder)
    with pytest.raises(UnusableError, match="does not fit"):
        checked(inch, replace(run.probe, laser=laser))


def test_a_baseline_in_metres_ends_the_run(good, run):
    laser = replace(run.probe.laser, baseline_mm=BASELINE / 1000)
    with pytest.raises(UnusableError, match="baseline were stated in m"):
        checked(good, replace(run.probe, laser=laser))


def test_an_absurd_camera_ends_the_run(good, run):
    """A focal length of 1e-9 px was not refused, though it gives no pixel of the line a place."""
    camera = replace(run.probe.camera, focal_px=(1e-9, 1e-9))
    with pytest.raises(UnusableError, match=r"100 % of the laser line's pixels(.|\n)*focal_px"):
        checked(good, replace(run.probe, camera=camera))


def test_a_scale_that_fits_no_unit_does_not_reverse_the_encoder(good):
    place = np.arange(1, 40)
    # the encoder moves on by 1 mm a frame, what is taken for the wall back by a seventh
    steps = Steps(place - 1, place, np.full(len(place), -1 / 7))
    time_s = np.arange(40) / 30
    told: list[str] = []
    spoiled = replace(good, encoder=Encoder(time_s, np.arange(40.0)))
    context = replace(quiet_context(), warn=told.append)
    assert encoder_factor(spoiled, time_s, steps, 1.0, forwards=True, context=context) == 1.0
    assert "one of the encoder's scale, its clock and the probe's baseline is wrong" in told[0]


def test_another_diameter_and_another_clock_are_reported(good, run):
    table = replace(good.frames, time_s=good.frames.time_s * 1000)
    _, told = checked(replace(good, frames=table, pipe=PipeFacts(2.3 * RADIUS)), run.probe)
    assert any("diameter of 100" in t for t in told)
    assert any("check the unit (s) of time_s" in t for t in told)


@pytest.mark.parametrize(("diameter_mm", "warnings"), [(57.3, 0), (90.0, 1), (44.0, 1)])
def test_the_median_ring_of_a_gauge_may_lie_between_its_bores(diameter_mm, warnings):
    told: list[str] = []
    bores = tuple(BoreSection(38.0, d) for d in (76.2, 64.0, 52.0))
    check_diameter(
        diameter_mm / 2, PipeFacts(76.2, bore=bores), 9.5, replace(quiet_context(), warn=told.append)
    )
    assert len(told) == warnings


def scratches(size):
    """Return nine thin bright scratches on the window, as bright as the lamps make them."""
    drawn, random = np.zeros(size[::-1], np.uint8), np.random.default_rng(2)
    for _ in range(9):
        at, way = random.uniform(0.2, 0.8, 2) * size, random.uniform(-60, 60, 2)
        cv2.line(drawn, at.astype(int).tolist(), (at + way).astype(int).tolist(), 240, 3, cv2.LINE_AA)
    return drawn


def test_scratches_on_the_window_are_not_taken_for_the_wall(good, run, monkeypatch):
    """A wrong unit of the encoder is detected by the wall's motion; scratches stand still."""
    size, light = run.probe.camera.image_size, good.frames.illumination
    by_light = {"led": scratches(size), "laser": scratches(size) // 20}
    images = {n: cv2.add(image, by_light[light[n]]) for n, image in good.source.images.items()}
    encoder = Encoder(good.encoder.time_s, good.encoder.distance_mm / 25.4)
    scratched = replace(good, source=MemorySource(images, size), encoder=encoder)
    found, told = checked(scratched, run.probe)
    assert "scratches" in told[0]
    assert found.encoder_factor == 25.4
    assert found.applied_to(scratched).stays is not None
    monkeypatch.setattr("stages.premises.find_static_places", lambda *parts: None)
    assert checked(scratched, run.probe)[0].encoder_factor == 1, "control: scratches are tracked"


def turned_round(run, sense=1):
    """Return a drawn run whose pictures are stored last first, and its encoder, with another ``sense``."""
    last, steps = len(run.true_row) - 1, run.steps
    turned = Steps(last - steps.end[::-1], last - steps.start[::-1], -steps.size[::-1])
    return replace(run.encoder, distance_mm=sense * run.encoder.distance_mm), run.table.time_s, turned


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("encoder", [(100, 0.0), (10, 1.0)], ids=str)
@pytest.mark.parametrize("sense", [1, -1])
def test_pictures_stored_last_first_end_the_run(seed, encoder, sense):
    """The encoder's sign was reversed, and half of the radii were wrong by more than stated."""
    run = pulled(seed, encoder_hz=encoder[0], quantum_mm=encoder[1])
    with pytest.raises(UnusableError, match="last first"):
        runs_forwards(*turned_round(run, sense))
    sound = replace(run.encoder, distance_mm=sense * run.encoder.distance_mm)
    assert runs_forwards(sound, run.table.time_s, run.steps)


def test_at_constant_speed_a_reversed_video_cannot_be_detected(good, run):
    assert not runs_forwards(*turned_round(pulled(1, steady=True)))
    backwards = replace(good, encoder=replace(good.encoder, distance_mm=-good.encoder.distance_mm))
    assert "Check whether the video runs backwards" in checked(backwards, run.probe)[1][0]


def test_a_recording_whose_video_runs_backwards_is_refused(good, run):
    kept = np.r_[0:24:3, 24:COUNT]
    time_s = good.frames.time_s[: len(kept)]
    table = FrameTable(np.arange(len(kept)), time_s, good.frames.illumination[kept])
    forward = replace(
        good,
        source=KeptFrames(good.source, kept),
        frames=table,
        listed=None,
        encoder=Encoder(np.r_[-1, time_s, 9], STEP_MM * np.r_[0, kept, COUNT]),
    )
    last_first = {k: good.source.images[n] for k, n in enumerate(kept[::-1])}
    source = MemorySource(last_first, run.probe.camera.image_size)
    turned = replace(table, illumination=table.illumination[::-1])
    assert not checked(forward, run.probe)[1], "control: in its true order nothing is wrong"
    with pytest.raises(UnusableError, match="last first"):
        checked(replace(forward, source=source, frames=turned), run.probe)


@pytest.mark.parametrize("late_s", [-0.1, 0.02, 0.1])
def test_a_probe_that_drives_forth_and_back_is_not_refused_for_a_late_clock(late_s):
    """Where it turns just before the middle, a delay of a tenth of a second fits a reversed video."""
    time_s = np.arange(217) / 30
    turn_s = (time_s[-1] - late_s) / 2
    at = np.arange(0, 217, 4)
    size = np.diff(-np.abs(time_s[at] - turn_s)) + 0.002 * np.sin(at[1:])
    read_s = np.arange(-100, 900) / 100
    encoder = Encoder(read_s, -30 * np.abs(read_s - late_s - turn_s))
    runs_forwards(encoder, time_s, Steps(at[:-1], at[1:], size))


@pytest.mark.parametrize("late_s", [0.3, 0.5, 1.0])
@pytest.mark.parametrize("stop_s", [0.5, 1.0])
def test_a_probe_that_stops_and_goes_is_not_refused_for_a_late_clock(stop_s, late_s):
    """A probe pushed by rods was "stored last first" in up to 15 of 60 runs."""
    read_s = np.arange(-200, 2200) / 100
    for seed in range(12):
        random = np.random.default_rng(seed)
        turns = np.cumsum(stop_s * (1 + 0.02 * random.standard_normal(80))) - 10
        goes = np.searchsorted(turns, read_s) % 2
        way = np.cumsum(0.3 * goes)
        at = np.arange(0, 600, 2)
        size = np.diff(np.interp(at / 30, read_s, way)) / 50
        size += 0.002 * random.standard_normal(len(size))
        encoder = Encoder(read_s + late_s, way)
        runs_forwards(encoder, np.arange(600) / 30, Steps(at[:-1], at[1:], size))


def test_a_motion_that_shows_its_direction_is_not_called_too_steady(good):
    """An encoder with reversed sign was still reported as a video that may run backwards."""
    run, told = pulled(1), []
    turned = replace(run.encoder, distance_mm=-run.encoder.distance_mm)
    context = replace(quiet_context(), warn=told.append)
    for forwards in (runs_forwards(turned, run.table.time_s, run.steps), False):
        given = replace(good, encoder=turned), run.table.time_s, run.steps, 50.0
        assert encoder_factor(*given, forwards=forwards, context=context) == -1
    assert "runs backwards" not in told[0]
    assert "runs backwards" in told[1]


@pytest.mark.parametrize("unit_mm", [1.0, 25.4, 1000.0])
def test_an_encoder_of_either_sign_is_converted_to_mm(unit_mm):
    run = pulled(2)
    read = replace(run.encoder, distance_mm=-run.encoder.distance_mm / unit_mm)
    brought = in_mm(read, run.table.time_s, run.steps, 50.0)
    np.testing.assert_allclose(brought.distance_mm, -run.encoder.distance_mm)


def test_an_encoder_that_stands_beside_a_moving_wall_is_not_changed():
    """It ended the run with a division by zero."""
    run = pulled(2)
    stands = replace(run.encoder, distance_mm=np.full(len(run.encoder.time_s), 3.0))
    assert in_mm(stands, run.table.time_s, run.steps, 50.0) is stands
