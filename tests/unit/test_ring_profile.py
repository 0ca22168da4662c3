"""The matched fit on exact lines: bias, σ against the Cramér–Rao bound, coverage, clipping."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from pipeline.recording.one_field import even_rows
from stages.rings.kernels import bell
from stages.rings.noise import QUANTISATION_VARIANCE, noise_response
from stages.rings.picture import Mixture
from stages.rings.profile import WINDOW_WIDTHS, ProfileFit, Response, fit_line
from stages.rings.sectors import cut_sectors
from stages.rings.sectors import with_even_rows_taken as one_field
from stages.rings.trace import fitted_in, trace_ring
from tests.ring_images import exposed, off_centre, ring_light

SIZE, CENTRE, AZIMUTHS = (640, 480), (318.7, 241.3), 720
WIDTH, AMPLITUDE, BLACK = 1.2, 90.0, 16.0


def test_the_bell_is_a_gaussian():
    x = np.linspace(-30, 30, 4001)
    np.testing.assert_allclose([bell(v) for v in x], np.exp(-0.5 * x * x), atol=1e-8, rtol=1e-7)


@pytest.fixture(scope="module")
def sectors():
    return cut_sectors(SIZE, np.array(CENTRE), AZIMUTHS)


def fitted(sectors, radius, amplitude, read, shot, seed, width=WIDTH, clip_level=np.inf):
    random = np.random.default_rng(seed)
    image = exposed(ring_light(SIZE, CENTRE, radius, width, amplitude), random, read=read, shot=shot)
    image = np.minimum(image, np.uint8(min(clip_level, 255)))
    truth = radius(sectors.azimuth_rad)
    response = Response(BLACK, read**2 + 1 / 12, shot, clip_level)
    seed_px = truth + random.uniform(-0.5, 0.5, truth.size)
    return fit_line(image, sectors, seed_px, width, response), truth


def bound(sectors, a, r, slope, read, shot):
    """Return the Cramér–Rao 1 σ of the position with height, width and a constant background unknown."""
    own = slice(sectors.start[a], sectors.start[a + 1])
    x = (sectors.radius_px[own] - r - slope * sectors.offset_rad[own]) / WIDTH
    x = x[np.abs(x) < 8]
    e = np.exp(-0.5 * x * x)
    variance = read**2 + 1 / 12 + shot * AMPLITUDE * e
    design = np.stack([AMPLITUDE * e * x / WIDTH, AMPLITUDE * e * x * x, e, np.ones_like(e)], 1)
    return np.sqrt(np.linalg.inv(design.T @ (design / variance[:, None]))[0, 0])


@pytest.mark.parametrize(("read", "shot"), [(0.7, 0.0), (1.0, 0.1), (2.0, 0.4), (4.0, 1.0)])
def test_sigma_is_right_and_near_the_cramer_rao_bound(sectors, read, shot):
    radius = off_centre(170.0, 6.0)
    slope = np.gradient(radius(sectors.azimuth_rad), sectors.azimuth_rad)
    z, error, sigma = [], [], []
    for seed in range(6):
        fit, truth = fitted(sectors, radius, AMPLITUDE, read, shot, seed)
        assert np.isfinite(fit.radius_px).all()
        error.append(fit.radius_px - truth)
        sigma.append(fit.sigma_px)
        z.append(error[-1] / sigma[-1])
    bounds = [bound(sectors, a, truth[a], slope[a], read, shot) for a in range(AZIMUTHS)]
    assert np.sqrt(np.mean(np.square(error)) / np.mean(np.square(bounds))) < 1.1
    assert np.median(np.array(sigma) / bounds) < 1.1
    assert 0.93 < np.mean(np.abs(z) < 1.96) < 0.97
    assert abs(np.mean(error)) < 0.01


def test_bias_is_below_a_hundredth_of_a_pixel_at_every_pixel_phase(sectors):
    fits = [
        fitted(sectors, off_centre(160.0 + d, 9.0), AMPLITUDE, 0.5, 0.05, 7) for d in np.arange(0, 1, 0.1)
    ]
    error = np.concatenate([fit.radius_px - truth for fit, truth in fits])
    phase = np.concatenate([truth for _, truth in fits]) % 1
    binned = [error[(phase >= low) & (phase < low + 0.1)].mean() for low in np.arange(0, 1, 0.1)]
    assert np.max(np.abs(binned)) < 0.01


def test_a_sloping_background_does_not_pull_the_line(sectors):
    v, u = np.mgrid[: SIZE[1], : SIZE[0]]
    slant = 1.5 * (np.hypot(u - CENTRE[0], v - CENTRE[1]) - 170) + 60
    radius = off_centre(170.0, 0.0)
    light = ring_light(SIZE, CENTRE, radius, WIDTH, 80.0) + np.clip(slant, 0, 120)
    image = exposed(light, np.random.default_rng(3), read=0.5, shot=0.0)
    fit = fit_line(image, sectors, np.full(AZIMUTHS, 170.3), WIDTH, Response(BLACK, 0.33, 0.0, np.inf))
    assert abs(np.mean(fit.radius_px - 170)) < 0.01


def test_the_fit_is_the_weighted_least_squares_optimum(sectors):
    radius = off_centre(150.0, 4.0)
    random = np.random.default_rng(11)
    image = exposed(ring_light(SIZE, CENTRE, radius, WIDTH, AMPLITUDE), random, read=1.0, shot=0.1)
    truth = radius(sectors.azimuth_rad)
    slope = np.gradient(truth, sectors.azimuth_rad)
    fit = fit_line(image, sectors, truth, WIDTH, Response(BLACK, 1.0, 0.1, np.inf))
    for a in range(0, AZIMUTHS, 45):
        own = slice(sectors.start[a], sectors.start[a + 1])
        near = np.abs(sectors.radius_px[own] - truth[a]) <= WINDOW_WIDTHS * WIDTH
        rho, delta = sectors.radius_px[own][near], sectors.offset_rad[own][near]
        grey = image.ravel()[sectors.pixel[own][near]].astype(float)
        weight = 1 / np.sqrt(1 + 0.1 * np.maximum(fit.amplitude[a] * np.exp(
            -0.5 * ((rho - fit.radius_px[a]) / fit.width_px[a]) ** 2), 0))  # fmt: skip

        def residual(p, rho=rho, delta=delta, grey=grey, weight=weight, a=a):
            x = (rho - p[0] - slope[a] * delta) / np.exp(p[1])
            model = p[2] * np.exp(-0.5 * x * x) + p[3] + p[4] * (rho - truth[a])
            return np.append((grey - model) * weight, (p[1] - np.log(WIDTH)) / 0.3)

        best = least_squares(residual, [truth[a], np.log(WIDTH), AMPLITUDE, BLACK, 0.0])
        assert fit.radius_px[a] == pytest.approx(best.x[0], abs=0.2 * fit.sigma_px[a])
        spread = np.sqrt(np.linalg.inv(best.jac.T @ best.jac)[0, 0])
        assert fit.sigma_px[a] == pytest.approx(spread, rel=0.1)


def test_clipped_peaks_are_fitted_by_their_flanks(sectors):
    radius = off_centre(165.3, 8.0)
    fit, truth = fitted(sectors, radius, 180.0, 1.0, 0.1, 5, clip_level=120.0)
    blind, _ = fitted(sectors, radius, 180.0, 1.0, 0.1, 5)
    settled = np.isfinite(fit.radius_px)
    error = (fit.radius_px - truth)[settled]
    assert settled.mean() > 0.99
    assert (fit.clipped[settled] > 0).all()
    assert abs(error.mean()) < 0.01
    assert np.mean(np.abs(error / fit.sigma_px[settled]) < 1.96) > 0.93
    assert np.median(fit.sigma_px[settled]) > 1.2 * np.median(blind.sigma_px)
    assert np.median(fit.amplitude[settled]) == pytest.approx(180, rel=0.05)


def test_a_seed_that_is_nan_is_left_out(sectors):
    radius = off_centre(170.0, 0.0)
    image = exposed(ring_light(SIZE, CENTRE, radius, WIDTH, AMPLITUDE), np.random.default_rng(0))
    seed = np.full(AZIMUTHS, 170.0)
    seed[::2] = np.nan
    fit = fit_line(image, sectors, seed, WIDTH, Response(BLACK, 1.0, 0.1, np.inf))
    assert np.isnan(fit.radius_px[::2]).all()
    assert np.isfinite(fit.radius_px[1::2]).all()


def test_with_one_field_the_line_is_fitted_to_recorded_rows_only(sectors):
    """Interpolated rows broadened the line at top and bottom: false findings as long as the run."""
    radius = off_centre(170.0, 6.0)
    truth = radius(sectors.azimuth_rad)
    image = even_rows(np.rint(BLACK + ring_light(SIZE, CENTRE, radius, WIDTH, 200.0)).astype(np.uint8))
    response = Response(BLACK, 1.0, 0.0, np.inf)
    fits = [fit_line(image, s, truth, WIDTH, response).radius_px for s in (sectors, one_field(sectors))]
    all_rows, taken = (np.sqrt(np.nanmean((radius_px - truth) ** 2)) for radius_px in fits)
    assert taken < 0.02 < 0.05 < all_rows
    assert np.isnan(fits[1]).mean() < 0.01


def test_with_one_field_all_sectors_beside_the_centre_keep_their_pixels(sectors):
    taken, flat = one_field(sectors).taken, np.abs(np.sin(sectors.azimuth_rad)) < 0.7
    np.testing.assert_array_equal(np.diff(taken.start)[flat], np.diff(sectors.start)[flat])
    assert np.all(np.diff(taken.start) > 0)


def test_a_mixture_is_fitted_like_the_picture_of_its_grey_levels(sectors):
    random, radius = np.random.default_rng(5), off_centre(150.0, 10.0)
    light = ring_light(SIZE, CENTRE, radius, WIDTH, AMPLITUDE)
    bgr = np.dstack([exposed(share * light, random, read=1.0, shot=0.0) for share in (0.2, 1.0, 0.3)])
    mixture = Mixture(bgr, np.array([-0.5, 1.0, -0.4]))
    response = Response(0.1 * BLACK, 1.5, 0.0, np.inf)
    seed_px = radius(sectors.azimuth_rad)
    ours, plain = (fit_line(i, sectors, seed_px, WIDTH, response) for i in (mixture, mixture.everywhere()))
    np.testing.assert_allclose(ours, plain, rtol=1e-4, atol=1e-4)
    noise, plain_noise = (
        noise_response(i, sectors, plain, response) for i in (mixture, mixture.everywhere())
    )
    np.testing.assert_allclose(noise, plain_noise, rtol=1e-4)


def test_sectors_that_are_left_out_do_not_change_the_fit_of_the_others(sectors):
    radius = off_centre(150.0, 40.0)
    image = exposed(ring_light(SIZE, CENTRE, radius, WIDTH, AMPLITUDE), np.random.default_rng(6))
    seed_px, response = radius(sectors.azimuth_rad), Response(BLACK, 1.0, 0.0, np.inf)
    every, few = (fit_line(image, sectors, seed_px, WIDTH, response, n).radius_px for n in (1, 5))
    assert np.array_equal(few[::5], every[::5])
    assert np.isfinite(few).sum() == np.isfinite(every[::5]).sum() > 100


def test_a_mixture_in_which_the_line_is_dark_is_not_used(sectors):
    light = ring_light(SIZE, CENTRE, off_centre(150.0, 10.0), WIDTH, AMPLITUDE)
    image = exposed(light, np.random.default_rng(7), read=1.0, shot=0.0)
    trace = trace_ring(image, sectors, np.inf)
    assert trace is not None
    inverted = Mixture(np.repeat((255 - image)[..., None], 3, 2), np.array([0.0, 1.0, 0.0]))
    assert fitted_in(inverted, trace, sectors) is None


def test_a_picture_that_a_codec_left_without_noise_has_that_of_rounding(sectors):
    """Where the laser was off for a while, the stage ended with "array must not contain infs or NaNs"."""
    dark = np.full(SIZE[::-1], 3, np.uint8)
    radius, width, none, level = (np.full(AZIMUTHS, v) for v in (100.0, WIDTH, 0.0, 3.0))
    fit = ProfileFit(radius, width, none, level, *(none,) * 6)
    found = noise_response(dark, sectors, fit, Response(0.0, 1.0, 0.0, np.inf))
    assert 1 <= (found.variance + 4 * found.variance_per_level) / QUANTISATION_VARIANCE < 2.1
