"""Finding the ring without a start value: off centre, broken, beside glints, or absent."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from pipeline.adjustment.robust import basis_of, ring_harmonics
from pipeline.artefacts.measured import RingValidity
from stages.rings.sectors import cut_sectors
from stages.rings.trace import trace_ring
from tests.ring_images import exposed, off_centre, ring_light

SIZE, CENTRE, AZIMUTHS = (640, 480), (318.7, 241.3), 720


@pytest.fixture(scope="module")
def sectors():
    return cut_sectors(SIZE, np.array(CENTRE), AZIMUTHS)


def image_of(light, seed=0, **noise):
    return exposed(light, np.random.default_rng(seed), **noise)


def errors(trace, truth):
    return np.where(trace.validity == RingValidity.VALID, trace.fit.radius_px - truth, np.nan)


def test_every_pixel_belongs_to_the_sector_nearest_to_it(sectors):
    assert np.array_equal(np.sort(sectors.pixel), np.arange(SIZE[0] * SIZE[1]))
    sector = np.repeat(np.arange(AZIMUTHS), np.diff(sectors.start))
    du, dv = sectors.pixel % SIZE[0] - CENTRE[0], sectors.pixel // SIZE[0] - CENTRE[1]
    away = np.angle(np.exp(1j * (np.arctan2(dv, du) - sectors.azimuth_rad[sector])))
    assert np.abs(away).max() <= np.pi / AZIMUTHS * (1 + 1e-6)
    assert np.allclose(away, sectors.offset_rad, atol=1e-6)
    assert np.allclose(np.hypot(du, dv), sectors.radius_px, atol=1e-4)
    inside = np.diff(sector) == 0
    assert (np.diff(sectors.radius_px)[inside] >= 0).all()


def test_pixels_near_a_ring_are_those_at_its_distance(sectors):
    ring = off_centre(150.0, 20.0)(sectors.azimuth_rad)
    away = np.abs(sectors.radius_px - np.repeat(ring, np.diff(sectors.start)).astype(np.float32))
    assert np.array_equal(sectors.pixels_near(ring, 2.0, 5.0), sectors.pixel[(away >= 2.0) & (away < 5.0)])


def test_colours_near_a_ring_are_those_of_its_pixels(sectors):
    ring = off_centre(150.0, 20.0)(sectors.azimuth_rad)
    bgr = np.random.default_rng(7).integers(0, 256, (*SIZE[::-1], 3), np.uint8)
    bgr[..., 2] = bgr[..., 1] // 2 + bgr[..., 0] // 3
    mean, covariance = sectors.colours_near(bgr, ring, 2.0, 5.0)
    colours = bgr.reshape(-1, 3)[sectors.pixels_near(ring, 2.0, 5.0)]
    np.testing.assert_allclose(mean, colours.mean(0))
    np.testing.assert_allclose(covariance, np.cov(colours.T))


@pytest.mark.parametrize(("radius", "along"), [(150.0, 0.0), (120.0, 45.0), (200.0, 15.0)])
@pytest.mark.parametrize("width", [0.9, 1.6, 3.0])
def test_a_ring_is_found_at_any_place_and_thickness(sectors, radius, along, width):
    ring = off_centre(radius, along)
    trace = trace_ring(image_of(ring_light(SIZE, CENTRE, ring, width, 60.0)), sectors, 255.0)
    error = errors(trace, ring(sectors.azimuth_rad))
    assert np.isfinite(error).mean() > 0.97
    assert np.nanmax(np.abs(error)) < 0.5
    assert trace.width_px == pytest.approx(width, rel=0.05)


def test_a_gap_and_a_glint_are_not_taken_for_the_ring(sectors):
    ring = off_centre(150.0, 20.0)
    light = ring_light(SIZE, CENTRE, ring, 1.2, lambda psi: 80.0 * (np.abs(psi - 1.5) > 0.15))
    light[100:112, 300:330] += 230
    trace = trace_ring(image_of(light), sectors, 255.0)
    error = errors(trace, ring(sectors.azimuth_rad))
    gap = np.abs(sectors.azimuth_rad - 1.5) < 0.14
    assert np.isnan(error[gap]).all()
    assert np.isfinite(error[~gap]).mean() > 0.94
    assert np.nanmax(np.abs(error)) < 0.5


@pytest.mark.parametrize("read", [0.0, 1.0, 6.0])
def test_no_ring_is_found_in_an_empty_image(sectors, read):
    trace = trace_ring(image_of(np.zeros(SIZE[::-1]), read=read), sectors, 255.0)
    assert trace is None or trace.coverage < 0.01


def test_a_ring_that_steps_to_another_bore_is_followed(sectors):
    def stepped(psi):
        return np.where(np.abs(psi) < 0.8, 190.0, 150.0)

    first = trace_ring(image_of(ring_light(SIZE, CENTRE, lambda p: 150.0 + 0 * p, 1.2, 80.0)), sectors, 255.0)
    part = trace_ring(image_of(ring_light(SIZE, CENTRE, stepped, 1.2, 80.0), 1), sectors, 255.0, first)
    whole = trace_ring(
        image_of(ring_light(SIZE, CENTRE, lambda p: 190.0 + 0 * p, 1.2, 80.0), 2), sectors, 255.0, part
    )
    clear = np.abs(np.abs(sectors.azimuth_rad) - 0.8) > 0.03
    assert np.nanmax(np.abs(errors(part, stepped(sectors.azimuth_rad))[clear])) < 0.5
    assert np.isfinite(errors(part, 0.0)[clear]).mean() > 0.98
    assert np.nanmax(np.abs(errors(whole, 190.0))) < 0.5
    assert whole.coverage > 0.98


def test_a_sector_that_followed_a_reflection_returns_to_the_line(sectors):
    ring = off_centre(170.0, 8.0)
    light = ring_light(SIZE, CENTRE, ring, 1.2, 80.0)
    light += ring_light(SIZE, CENTRE, lambda psi: ring(psi) - 20.0, 1.2, 16.0)
    first = trace_ring(image_of(light), sectors, 255.0)
    strayed = first.fit.radius_px.copy()
    strayed[[40, 300, 301, 302, 500]] -= 20.0
    before = replace(first, fit=first.fit._replace(radius_px=strayed))
    error = errors(trace_ring(image_of(light, 1), sectors, 255.0, before), ring(sectors.azimuth_rad))
    assert np.nanmax(np.abs(error)) < 1.0
    assert np.isfinite(error[[40, 301, 500]]).all()


def test_sectors_narrower_than_a_pixel_use_the_line_and_not_its_neighbours():
    sectors, ring = cut_sectors(SIZE, np.array(CENTRE), 1440), off_centre(120.0, 3.0)
    light = ring_light(SIZE, CENTRE, ring, 0.7, 80.0)
    light += ring_light(SIZE, CENTRE, lambda psi: ring(psi) - 12.0, 0.7, 16.0)
    first = trace_ring(image_of(light), sectors, 255.0)
    error = errors(trace_ring(image_of(light, 1), sectors, 255.0, first), ring(sectors.azimuth_rad))
    assert np.isfinite(error).mean() > 0.99
    assert np.nanmax(np.abs(error)) < 0.5


def test_two_equally_bright_lines_are_ghosts(sectors):
    light = ring_light(SIZE, CENTRE, off_centre(150.0, 0.0), 1.2, 80.0)
    light += ring_light(SIZE, CENTRE, off_centre(158.5, 0.0), 1.2, lambda psi: 78.0 * (np.abs(psi) < 0.5))
    trace = trace_ring(image_of(light), sectors, 255.0)
    double = np.abs(sectors.azimuth_rad) < 0.48
    assert (trace.validity[double] != RingValidity.VALID).mean() > 0.9
    assert (trace.validity[double] == RingValidity.GHOST).mean() > 0.25
    assert (trace.validity[~double] == RingValidity.VALID).mean() > 0.95


def test_a_ring_partly_outside_the_image_is_recognised(sectors):
    ring = off_centre(235.0, 30.0, np.pi / 2)
    trace = trace_ring(image_of(ring_light(SIZE, CENTRE, ring, 1.2, 80.0)), sectors, 255.0)
    v = CENTRE[1] + ring(sectors.azimuth_rad) * np.sin(sectors.azimuth_rad)
    outside = (v > SIZE[1] - 1) | (v < 0)
    assert outside.sum() > 50
    assert (trace.validity[outside] != RingValidity.VALID).all()
    assert (trace.validity[(v < SIZE[1] - 5) & (v > 5)] == RingValidity.VALID).mean() > 0.98


def lit(gone, seed):
    """Return a ring that is missing in some sectors, in a lit pipe with a faint rim at its dark far end."""
    random = np.random.default_rng(seed)
    line = ring_light(SIZE, CENTRE, off_centre(150.0, 6.0), 1.5, lambda psi: np.where(gone(psi), 0.0, 60.0))
    v, u = np.mgrid[: SIZE[1], : SIZE[0]]
    away = np.hypot(u - CENTRE[0], v - CENTRE[1])
    rim = 15 * np.exp(-0.5 * ((away - 40.0) / 1.5) ** 2)
    texture = cv2.GaussianBlur(random.normal(size=SIZE[::-1]), (0, 0), 2.0) * 40
    return exposed(line + rim + np.clip(60 + texture, 0, None) * (away > 42), random)


@pytest.mark.parametrize("half_gone_rad", [0.15, 0.5, 1.0])
@pytest.mark.parametrize("followed", [False, True])
def test_where_the_line_is_missing_no_other_light_of_a_lit_pipe_is_taken_for_it(
    sectors, followed, half_gone_rad
):
    """The end of the light far down the pipe, in three successive rings, was a deposit of 12 mm at .98."""
    ring = off_centre(150.0, 6.0)(sectors.azimuth_rad)

    def gone(psi):
        return np.abs(psi - 1.0) < half_gone_rad

    before = trace_ring(lit(lambda psi: psi > 9, 0), sectors, 255.0) if followed else None
    error = errors(trace_ring(lit(gone, 1), sectors, 255.0, before), ring)
    assert np.isfinite(error[~gone(sectors.azimuth_rad)]).mean() > 0.9
    assert (np.abs(error) > 15.0).sum() <= 1, "one in a hundred, which its neighbours contradict later"


def stepped(psi):
    """Return a bore that is wider on 36 % of the circumference."""
    return np.where(np.abs(psi + 1.5) < 1.13, 180.0, 150.0)


def holed(psi):
    """Return a bore with a hole of 23 degrees."""
    return np.where(np.abs(psi + 1.5) < 0.2, 180.0, 150.0)


def glint():
    v, u = np.mgrid[: SIZE[1], : SIZE[0]]
    away = np.hypot(u - CENTRE[0] + 45.8, v - CENTRE[1] - 100.0)
    return 230 * np.exp(-0.5 * (away / 4.0) ** 2)


def reflection():
    return ring_light(
        SIZE,
        CENTRE,
        lambda psi: np.full_like(psi, 95.0),
        1.5,
        lambda psi: 60.0 * (np.abs(psi - 1.2) < 0.05),
    )


def mirrored():
    return ring_light(SIZE, CENTRE, lambda psi: np.full_like(psi, 95.0), 1.5, 50.0)


def texture():
    v, u = np.mgrid[: SIZE[1], : SIZE[0]]
    spots = cv2.GaussianBlur(np.random.default_rng(3).normal(size=SIZE[::-1]), (0, 0), 2.0) * 40
    return np.clip(60 + spots, 0, None) * (np.hypot(u - CENTRE[0], v - CENTRE[1]) > 42)


@pytest.mark.parametrize("followed", [False, True])
@pytest.mark.parametrize("other", [glint, reflection, mirrored, texture])
@pytest.mark.parametrize("wall", [stepped, holed])
def test_no_other_light_replaces_a_step_or_a_hole_of_the_wall(sectors, wall, other, followed):
    """One glint of σ 4 px replaced all samples of a step of the bore in a ring."""
    psi = sectors.azimuth_rad
    line = ring_light(SIZE, CENTRE, wall, 1.5, lambda p: np.where(wall(p) > 150, 45.0, 60.0))
    before = trace_ring(image_of(line, 4), sectors, 255.0) if followed else None
    trace = trace_ring(image_of(line + other(), 5), sectors, 255.0, before)
    off = (wall(psi) > 150) & (wall(psi - 0.03) > 150) & (wall(psi + 0.03) > 150)
    assert (np.abs(errors(trace, wall(psi)))[off] < 2.0).mean() > 0.8, "except for the ends of an arc"


@pytest.mark.parametrize("half_gone_rad", [0.15, 0.5, 1.0])
def test_light_that_continues_where_the_line_is_missing_is_not_the_line(sectors, half_gone_rad):
    line = ring_light(
        SIZE, CENTRE, off_centre(150.0, 6.0), 1.5, lambda p: 60.0 * (np.abs(p - 1.0) > half_gone_rad)
    )
    trace = trace_ring(image_of(line + mirrored(), 1), sectors, 255.0)
    error = errors(trace, off_centre(150.0, 6.0)(sectors.azimuth_rad))
    assert not (np.abs(error) > 15.0).any()


def test_samples_within_a_quarter_of_a_band_of_the_mean_course_are_within_a_band_of_the_robust_one():
    """Rings of which `other_light` finds no robust course: arcs and gaps pull both, but never so far."""
    random, psi = np.random.default_rng(8), np.linspace(-np.pi, np.pi, AZIMUTHS, endpoint=False)
    basis, apart = basis_of(psi), []
    for _ in range(200):
        middle, half, step = random.uniform(-3, 3), random.uniform(0.05, 1.5), random.uniform(-1, 1)
        radius = 150 + step * (np.abs(psi - middle) < half) + random.normal(0, 0.02, AZIMUTHS)
        radius[np.abs(psi - random.uniform(-3, 3)) < random.uniform(0, 1.4)] = np.nan
        seen = np.isfinite(radius)
        mean = np.linalg.lstsq(basis[seen], radius[seen])[0]
        far = [np.nanmax(np.abs(radius - basis @ c)) for c in (mean, ring_harmonics(radius[None], basis)[0])]
        apart.append(far[1] / far[0])
    assert max(apart) < 4
    assert max(apart) > 1.2, "control: the courses differ"
