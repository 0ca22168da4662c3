"""Parts of the twin on synthetic pictures: rays and wall, noise, dirt, exposure, and the written results."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.artefacts.measured import RingValidity
from pipeline.recording.base import Illumination
from stages.twin import _spread
from stages.twin.cannot_tell import cannot_tell
from stages.twin.compare import BLOCK_PX, Comparison, block_ratios, exposure_of
from stages.twin.lamp_light import Figure
from stages.twin.locate import ImagePlace
from stages.twin.name import _not_sharp, clipped, left_over
from stages.twin.noise import CameraNoise, black_and_white
from stages.twin.on_wall import unnamed
from stages.twin.rays import wall_seen
from stages.twin.reference import BlockSamples, in_image
from stages.twin.render import Region, TwinFrame
from stages.twin.state import PhotometricState, black_of_photo, clipped_line
from stages.twin.sums import Sums
from tests.synthetic_wall import plain_bore

BLACK = Figure(16.0, 0.1)
NOISE = CameraNoise(BLACK, 255.0, Figure(4.0, 0.1), Figure(0.0, 0.0), Figure(0.0, 0.0), Figure(1.0, 0.1))


def _rays(count=200):
    theta = np.linspace(0.5, 1.5, count)
    phi = np.linspace(-3.0, 3.0, count)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)


@pytest.mark.parametrize("bump_mm", [0.0, 1.5])
def test_rays_meet_the_wall_at_its_place(bump_mm):
    T_pc = np.eye(4)
    T_pc[:3, 3] = 2.0, -1.0, 80.0
    surface, rays = plain_bore(bump_mm=bump_mm), _rays()
    seen = wall_seen(surface, T_pc, rays)
    assert seen.seen.all()
    at = T_pc[:3, 3] + seen.xyz_c
    column = np.mod((seen.azimuth_rad + np.pi) / (2 * np.pi), 1) * 360
    inside = np.interp(column, np.arange(360), surface.radius_mm[0])
    np.testing.assert_allclose(np.hypot(at[:, 0], at[:, 1]), inside, atol=0.01)
    np.testing.assert_allclose(seen.distance_mm, at[:, 2], atol=1e-3)
    np.testing.assert_allclose(np.cross(seen.xyz_c, rays), 0, atol=1e-6)


def test_an_invalid_ray_meets_nothing():
    rays = _rays(3)
    rays[1] = np.nan
    np.testing.assert_array_equal(wall_seen(plain_bore(), np.eye(4), rays).seen, [True, False, True])


def _frame(level, region=Region.WALL):
    unknown = np.full(level.shape, np.nan, np.float32)
    return TwinFrame(
        level, np.full(level.shape, 4.0, np.float32), np.full(level.shape, region, np.uint8), unknown, unknown
    )


def _level():
    return np.tile(np.linspace(40, 160, 160, dtype=np.float32), (120, 1))


def _samples(change, frames=8, still=False):
    """Blocks of a camera that moves by two blocks a frame.

    ``change`` is a function of frame, row, column, wall row.
    """
    random = np.random.default_rng(6)
    frame, row, column = (a.ravel() for a in np.mgrid[0:frames, 0:40, 0:60])
    along = row + (0 if still else 2 * frame)
    value = 0.01 * random.standard_normal(len(frame)) + change(frame, row, column, along)
    return BlockSamples(
        value, 4 + 0 * value, 32 + 0 * value, frame, row, column, along, column, 100.0, 2.5,
        np.arange(frames), row / 40, 0 * value,
    )  # fmt: skip


def _near(a, b, c, d):
    return 0.2 * (np.hypot(a - b, c - d) < 2.5)


def test_errors_fixed_to_image_wall_and_rows_are_distinguished():
    place = (ImagePlace(20.5 * BLOCK_PX, 20.5 * BLOCK_PX, 16.0, 0.2, 0.01, 0.0),)
    on_window = _samples(lambda f, r, c, s: _near(r, 20, c, 20))
    assert in_image(on_window, place) == ("image",)
    assert unnamed(on_window, plain_bore(), 0.5, 1.1) == ()
    on_wall = _samples(lambda f, r, c, s: _near(s, 24, c, 20))
    assert in_image(on_wall, place) != ("image",)
    (region,) = unnamed(on_wall, plain_bore(), 0.5, 1.1)
    assert region.fixed_to == "wall"
    assert region.place[0].value == pytest.approx(100 + 24.5 * 2.5, abs=1.5)
    assert region.parameters[0].value == pytest.approx(0.2, abs=0.03)
    (bands,) = unnamed(_samples(lambda f, r, c, s: 0.03 * np.sin(r / 3 + 2.1 * f)), plain_bore(), 0.5, 1.1)
    assert (bands.name, bands.fixed_to) == ("banding", "rows")


def test_the_size_of_bands_does_not_include_noise_of_the_rows():
    """Bands of .071 were .076 ± .0005: errors of the wall's photo within a row counted as bands."""
    noise = np.repeat(0.08 * np.random.default_rng(8).standard_normal((8, 40, 30)), 2, 2).ravel()
    bands = _samples(lambda f, r, c, s: 0.03 * np.sqrt(2) * np.sin(r / 3 + 2.1 * f) + noise)
    (found,) = unnamed(bands, plain_bore(), 0.5, 1.1)
    (size,) = found.parameters
    assert found.name == "banding"
    assert abs(size.value - 0.03) < 3 * size.sd < 0.004


def test_a_drop_whose_appearance_varies_from_frame_to_frame_is_not_fixed_to_rows():
    place = (ImagePlace(20.5 * BLOCK_PX, 20.5 * BLOCK_PX, 16.0, 0.2, 0.01, 0.0),)
    fragments = _samples(lambda f, r, c, s: _near(r, 20, c, 20) * np.where(f % 2, 1, -1))
    assert in_image(fragments, place) == ("",)


def test_without_motion_image_and_wall_cannot_be_distinguished():
    place = (ImagePlace(20.5 * BLOCK_PX, 20.5 * BLOCK_PX, 16.0, 0.2, 0.01, 0.0),)
    still = _samples(lambda f, r, c, s: _near(r, 20, c, 20), still=True)
    assert in_image(still, place) == ("image or wall",)


def test_noise_is_fixed_neither_to_image_nor_to_wall():
    place = (ImagePlace(20.5 * BLOCK_PX, 20.5 * BLOCK_PX, 16.0, 0.2, 0.01, 0.0),)
    noise = _samples(lambda f, r, c, s: 0.0)
    assert unnamed(noise, plain_bore(), 0.5, 1.1) == ()
    assert in_image(noise, place) == ("",)


def test_exposure_and_blocks_are_relative_to_the_rendered_frame():
    level, random = _level(), np.random.default_rng(1)
    recorded = (1.1 * level + 2 * random.standard_normal(level.shape)).astype(np.float32)
    assert exposure_of(recorded, _frame(level)) == pytest.approx(np.log(1.1), abs=1e-3)
    np.testing.assert_allclose(block_ratios(recorded, _frame(level), 1e9), 1.1, atol=0.05)
    assert np.isnan(block_ratios(recorded, _frame(level, Region.UNSEEN), 1e9)).all()


def test_pixels_that_a_codec_leaves_above_full_scale_count_as_clipped():
    """Frames rendered again to judge names counted what the codec scatters there as light."""
    one = Figure(1.0, 0.0)
    camera = CameraNoise(Figure(16.0, 0.0), 235.0, one, one, one, one)
    seen = camera.above_black(np.array([[16, 120, 235, 241]], np.uint8))
    assert seen.tolist() == [[0.0, 104.0, 219.0, 219.0]]
    assert camera.full_scale == 219.0


def test_chi_square_is_one_for_noise_and_more_for_a_difference():
    level, random = _level(), np.random.default_rng(1)
    recorded = (level + 2 * random.standard_normal(level.shape)).astype(np.float32)
    comparison = Comparison()
    wrong = _frame(1.05 * level)
    comparison.add(7, Illumination.LED, recorded, wrong, _frame(level), NOISE)
    fit = next(r for r in comparison.regions() if r.name == "wall")
    assert fit.pixels == level.size
    assert fit.chi2_after == pytest.approx(1.0, abs=0.03)
    assert fit.chi2_before > 3
    assert comparison.psnr_db(False) == pytest.approx(20 * np.log10(255 / 2), abs=0.1)


def test_the_edge_is_left_out_and_so_is_the_dark_where_its_noise_is_cut_off():
    level = np.zeros((40, 50), np.float32)
    above = np.abs(2 * np.random.default_rng(2).standard_normal(level.shape)).astype(np.float32)
    above[0, :5] = 30.0
    for black, compared in ((16.0, True), (0.0, False)):
        comparison = Comparison()
        frame = _frame(level, Region.DARK)
        frame.region[:, :10] = Region.EDGE
        comparison.add(7, Illumination.LED, above, frame, frame, replace(NOISE, black=Figure(black, 0.1)))
        fits = {r.name: r for r in comparison.regions()}
        assert fits["edge"].pixels == 400
        assert np.isnan(fits["edge"].chi2_after)
        assert np.isfinite(fits["dark"].chi2_after) == compared


def test_wall_at_the_edge_or_too_dark_is_known_but_not_compared():
    level = np.full((40, 50), 20.0, np.float32)
    level[:4], level[36:] = 2.0, 0.0  # dim wall, and pixels outside the view
    frame, comparison = _frame(level), Comparison()
    frame.region[:4], frame.region[36:], frame.region[4:8] = Region.DARK, Region.DARK, Region.EDGE
    frame.region[8:12], frame.region[36:, 25:] = Region.UNSEEN, Region.EDGE  # half of an edge sees no wall
    comparison.add(7, Illumination.LED, level, frame, frame, NOISE)
    assert comparison.compared_share == pytest.approx(24 / 32)


def test_light_in_the_dark_is_counted():
    above = np.zeros((40, 50), np.float32)
    above[:4] = 30.0
    comparison, frame = Comparison(), _frame(np.zeros_like(above), Region.DARK)
    comparison.add(7, Illumination.LED, above, frame, frame, NOISE)
    assert comparison.stray_share == pytest.approx(0.1)


@pytest.mark.parametrize(("noise", "silent"), [(2.0, False), (0.0, True)])
def test_where_dark_pixels_are_clipped_the_loss_of_faint_light_is_reported(noise, silent):
    """Reflected light of the line of half a grey level was searched, and the loss was not mentioned."""
    above = np.rint(noise * np.random.default_rng(2).standard_normal((40, 50))).astype(np.float32)
    comparison, frame = Comparison(), _frame(np.zeros_like(above), Region.DARK)
    comparison.add(7, Illumination.LASER, above, frame, frame, NOISE)
    assert comparison.silent == silent
    state = PhotometricState(None, None, None, *(np.zeros(1) for _ in range(5)))
    assert any("rounded away" in said for said in cannot_tell(state, comparison.silent)) == silent


def test_clipping_is_counted_and_a_wide_line_is_compared_with_a_focused_lens():
    rings = SimpleNamespace(validity=np.array([RingValidity.SATURATED] * 2 + [RingValidity.VALID] * 8))
    line, wall = clipped(rings, 0.0, 0.3)
    assert (line.fixed_to, line.parameters[0].value) == ("line", 0.2)
    assert (wall.fixed_to, wall.parameters[0].value) == ("image", 0.3)
    sound = SimpleNamespace(validity=np.array([RingValidity.VALID]))
    assert not clipped(sound, 0.0, 0.001)
    (colour,) = clipped(sound, 0.4, 0.0)
    assert (colour.fixed_to, colour.parameters[0].value) == ("line", 0.4)
    whole = SimpleNamespace(frames_of=lambda law: np.arange(8))
    assert not _not_sharp(None, whole)
    for blur, told in ((0.8, 0), (2.2, 1)):
        line_light = SimpleNamespace(blur_px=Figure(blur, 0.1 * blur))
        assert len(_not_sharp(line_light, whole)) == told


def test_a_clipped_line_shows_nothing_of_the_laser_and_this_is_reported():
    cells = SimpleNamespace(cells=lambda: "some")
    for share, seen in ((0.1, "some"), (0.8, None)):
        state = PhotometricState(
            None, None, None, np.zeros(1), np.zeros(1), np.zeros(1), np.zeros(1), np.zeros(1), share
        )
        assert Sums.cells(SimpleNamespace(_state=state, lit=cells, line=cells)) == ("some", seen)
        assert any("80 %" in said for said in cannot_tell(state)) == (seen is None)


def test_a_photo_that_contains_the_black_level_shows_no_response():
    ramp = np.arange(100, dtype=np.uint8).reshape(10, 10).repeat(4, 0).repeat(4, 1)[..., None].repeat(3, 2)
    assert black_of_photo([(0, ramp), (1, None)]) == 4.5, "the median of 0 to 9, the darkest tenth"
    assert black_of_photo([(0, ramp), (1, ramp + 9), (2, ramp + 8)]) == 12.5
    state = PhotometricState(None, None, None, *(np.zeros(1) for _ in range(5)), photo_black=12.0)
    assert state.black_in_photo
    assert any("12 grey levels" in said for said in cannot_tell(state))
    assert not replace(state, photo_black=0.4).black_in_photo


def test_a_black_level_that_no_frame_shows_may_be_in_the_photo():
    black = black_of_photo([(0, None)])
    state = PhotometricState(None, None, None, *(np.zeros(1) for _ in range(5)), photo_black=black)
    assert state.black_in_photo
    assert any("black level" in said and "is unknown" in said for said in cannot_tell(state))


def test_a_line_clips_where_its_strongest_channel_does_whatever_its_grey_level():
    row = column = np.arange(40)
    sight = SimpleNamespace(row=row, column=column, offset_px=np.where(row < 20, 0.0, 9.0))
    scene = SimpleNamespace(pose=lambda frame: None, line=lambda pose: sight)
    picture = np.zeros((40, 40, 3), np.uint8)
    picture[row, column] = [(60, 255, 3 * k) if k < 8 else (60, 200, 3 * k) for k in row]
    assert clipped_line(scene, [(1, picture), (2, None)]) == pytest.approx(8 / 20)
    assert clipped_line(scene, []) == 0.0


def test_an_unnamed_map_is_reported_only_if_it_improves_other_frames():
    uneven = _samples(lambda f, r, c, s: 0.03 * np.sin(r / 4) * np.cos(c / 5))
    fall, figures = left_over(uneven)
    assert fall > 0
    assert figures[0].name == "unnamed_gain"
    assert left_over(_samples(lambda f, r, c, s: 0.0)) == (0.0, ())
    assert left_over(_samples(lambda f, r, c, s: 0.03 * np.sin(r / 4 + 2.1 * f))) == (0.0, ())


def test_light_lost_at_the_window_is_not_reported_again_as_a_map():
    gain = np.ones((40 * BLOCK_PX, 60 * BLOCK_PX), np.float32)
    gain[: 20 * BLOCK_PX] = 0.5
    dark = _samples(lambda f, r, c, s: np.where(r < 20, -0.5, 0.0))
    assert left_over(dark)[0] > 0
    seen = dark.seen_through(gain)
    assert abs(seen.change.mean()) < 0.01
    np.testing.assert_allclose(np.exp(seen.log_level - dark.log_level)[dark.row < 20], 0.5)
    assert dark.seen_through(None) is dark


def test_clipped_wall_is_recognised_behind_a_codec_and_bright_wall_is_not():
    random = np.random.default_rng(4)
    light = np.clip(120 + 60 * random.standard_normal((400, 300)), 0, 400)
    exact = np.minimum(light, 219).astype(np.float32) + 16
    coded = exact + 1.5 * random.standard_normal(light.shape).astype(np.float32)
    assert black_and_white([exact] * 2)[1] == 235
    assert 228 <= black_and_white([coded] * 2)[1] <= 235
    bright = (16 + np.minimum(0.6 * light, 200)).astype(np.float32)
    assert black_and_white([bright + random.standard_normal(light.shape).astype(np.float32)])[1] == np.inf


def test_as_many_laser_frames_are_examined_as_there_are_up_to_the_limit():
    """Of 10 frames, 5 were examined, and a second ring needs 6: every second one was left out for 8."""
    assert [len(_spread(np.arange(n), 8)) for n in (0, 3, 10, 23)] == [0, 3, 8, 8]
    assert _spread(np.arange(5, 15), 3).tolist() == [5, 9, 14]
