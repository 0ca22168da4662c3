"""The effect of a correction on radius by clock position and depths of defects, and its sentence."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pipeline.api.diagnosis.apply import GeometryChange, consequence, geometry_change
from pipeline.recording.base import Encoder, FrameTable, PipeFacts, Recording
from stages.diagnose.compared import _beyond_probe
from stages.diagnose.correct import Correction, encoder_effects, with_true_readings
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.effects.vocabulary import VOCABULARY
from stages.diagnose.gauge.run import Term
from stages.diagnose.residual import AZIMUTHS, RingResidual, azimuths_rad, wall_distances_mm
from stages.diagnose.result import EffectFound, Value
from tests.unit.wall_points import plain_probe

AZIMUTH = np.radians(np.arange(-180.0, 180.0, 2.0))
DISTANCE = np.arange(0.0, 50.0, 0.5)


def run(folder, radius, depths):
    folder.mkdir()
    np.savez(folder / "radius_map.npz", distance_mm=DISTANCE, azimuth_rad=AZIMUTH, radius_mm=radius)
    defects = [
        {"kind": kind, "distance_from_mm": 20.0, "distance_to_mm": 24.0, "clock_from": hour - 0.3,
         "clock_to": hour + 0.3, "depth_mm": depth, "depth_sigma_mm": 0.02}
        for kind, hour, depth in depths
    ]  # fmt: skip
    (folder / "defects.json").write_text(json.dumps(defects))
    return folder


def test_the_radius_change_is_at_its_clock_position_and_the_largest_change_of_depth_is_reported(tmp_path):
    plain = np.full((len(DISTANCE), len(AZIMUTH)), 50.0)
    wider = plain + 0.2 * np.cos(AZIMUTH)
    wider[10, :5] = np.nan
    before = run(tmp_path / "a", plain, [("pit", 3.0, 0.80), ("corrosion", 9.0, 0.50)])
    after = run(tmp_path / "b", wider, [("pit", 3.1, 1.01), ("corrosion", 9.0, 0.49), ("pit", 6.0, 0.3)])
    change = geometry_change(before, after)
    assert change.mean_mm[3] == pytest.approx(0.2, abs=0.01)
    assert change.mean_mm[9] == pytest.approx(-0.2, abs=0.01)
    assert change.mean_mm[0] == pytest.approx(0.0, abs=0.01)
    assert [d.kind for d in change.defects] == ["pit", "corrosion"]
    assert consequence(change).startswith("Wall loss at 3 o'clock, 22 mm, was understated by 0.21 mm")


def test_maps_of_two_runs_are_compared_at_the_nearest_rows(tmp_path):
    rising = np.repeat(50.0 + DISTANCE[:, None], len(AZIMUTH), 1)
    before, after = run(tmp_path / "a", rising, []), run(tmp_path / "b", rising, [])
    map_of_after = dict(np.load(after / "radius_map.npz"))
    map_of_after["distance_mm"] = map_of_after["distance_mm"] + 0.3 * (DISTANCE[1] - DISTANCE[0])
    np.savez(after / "radius_map.npz", **map_of_after)
    assert np.nanmean(geometry_change(before, after).mean_mm) == pytest.approx(0.0, abs=1e-3)


def test_without_defects_the_change_of_radius_is_reported_and_without_change_nothing():
    at_four = np.where(np.arange(12) == 4, -0.12, 0.0)
    assert "radius was overstated by 0.12 mm at 4 o'clock" in consequence(
        GeometryChange(at_four, at_four, 0.03, ())
    )
    even, most = np.full(12, 0.1), np.where(np.arange(12) == 0, 0.3, 0.1)
    told = consequence(GeometryChange(even, most, 0.1, ()))
    assert "understated by 0.10 mm all round, and by up to 0.30 mm at 12 o'clock" in told
    assert "does not matter for depths" in consequence(GeometryChange(np.zeros(12), np.zeros(12), 0.001, ()))
    unseen = np.full(12, np.nan)
    assert consequence(GeometryChange(unseen, unseen, float("nan"), ())) == ""


def found(name, **sizes):
    return EffectFound(name, 1.0, {k: Value(v, 0.0) for k, v in sizes.items()}, "", "")


def recording(time_s, distance_mm):
    frames = FrameTable(np.arange(2), np.arange(2.0), np.array(["laser", "led"]))
    encoder = Encoder(time_s, distance_mm)
    return Recording("r", "inspection", None, frames, encoder, PipeFacts(50.0), 30.0, None, None, "key")


def test_encoder_readings_are_corrected():
    time_s = np.arange(0.0, 8.0, 0.01)
    true = 20 * time_s + 3 * np.sin(time_s)
    late = np.interp(time_s - 0.05, time_s, true, left=0.0)
    read = 1.02 * late + 4.0 * (time_s > 5.0)
    effects = (
        found("encoder_scale", relative=0.02), found("time_offset", delay_s=0.05),
        found("encoder_slip", slip_mm=4.0, time_s=5.0), found("laser_tilt", tilt_deg=0.5),
    )  # fmt: skip
    assert [e.name for e in encoder_effects(effects)] == ["encoder_scale", "time_offset", "encoder_slip"]
    mended = with_true_readings(recording(time_s, read), effects).encoder.distance_mm
    away = np.abs(time_s - 5.0) > 0.1
    inside = away & (time_s > 0.2) & (time_s < 7.8)
    assert mended[inside] == pytest.approx(true[inside], abs=0.05)


def test_pictures_late_by_half_an_exposure_and_late_readings_are_corrected_together():
    def way(time_s):
        return 20 * time_s + 3 * np.sin(time_s)

    time_s = np.arange(0.0, 8.0, 0.01)
    longer, late = found("motion_blur", exposure_s=0.06, late_s=0.03), found("time_offset", delay_s=-0.08)
    for effects, seconds in (((longer,), 0.03), ((late,), -0.08), ((longer, late), -0.05)):
        read = recording(time_s, way(time_s - seconds))
        assert encoder_effects(effects) == effects
        mended = with_true_readings(read, effects).encoder.distance_mm
        assert mended[20:-20] == pytest.approx(way(time_s)[20:-20], abs=0.02)
    # If no encoder shows that an exposure makes pictures late, nothing is corrected.
    read = recording(time_s, way(time_s))
    mended = with_true_readings(read, (found("motion_blur", exposure_s=0.06),)).encoder.distance_mm
    assert mended == pytest.approx(way(time_s), abs=1e-9)


def test_residuals_are_binned_where_they_lie():
    azimuth = azimuths_rad()
    none = np.zeros((AZIMUTHS, 2))
    rings = RingResidual(
        "field", np.full(AZIMUTHS, 7), azimuth, azimuth, np.full(AZIMUTHS, 3.1), none,
        np.cos(azimuth), 2 * np.cos(azimuth), np.arange(AZIMUTHS) != 5,
    )  # fmt: skip
    over = rings.over_frames(np.array([6, 7]))
    assert np.isnan(over[0]).all()
    assert np.isnan(over[1, 5])
    assert np.delete(over[1], 5) == pytest.approx(np.delete(np.cos(azimuth), 5))
    assert np.isfinite(rings.over_wall(wall_distances_mm(rings))).sum() == AZIMUTHS - 1
    assert rings.rms_px == pytest.approx(np.sqrt(2), rel=0.02)


def test_residuals_without_a_usable_ring_give_an_empty_picture_and_azimuths_wrap() -> None:
    """When lit and ring frames did not overlap, an error of SciPy's binning ended the diagnosis."""
    azimuth, ones = np.array([1.0, 1.0, 1.0 + 2 * np.pi]), np.ones(3)
    rings = RingResidual(
        "field", np.array([7, 7, 7]), azimuth, azimuth, 3.1 * ones, np.zeros((3, 2)), np.arange(3.0), ones,
        np.zeros(3, bool),
    )  # fmt: skip
    assert np.isnan(rings.over_frames(np.array([6, 7]))).all()
    assert np.isnan(rings.over_wall(wall_distances_mm(rings))).all()
    over = replace(rings, usable=ones > 0).over_frames(np.array([7]))
    assert over[np.isfinite(over)] == pytest.approx([1.0])


def test_what_a_probe_file_cannot_express_is_told_without_internal_names():
    """The page said "a probe file cannot express generic_line_1_2_hangs"."""
    found = "laser_tilt, step", "generic_line_1_2_hangs", "generic_line_0_3", "sheet_waviness 2, ramp"
    told = Correction(plain_probe(), (), found).beyond_probe
    assert told == "laser_tilt, step and a pattern without a known cause and sheet_waviness 2, ramp"


def test_what_keeps_its_azimuth_in_the_pipe_of_a_gauge_run_is_not_subtracted_in_the_inspection():
    """P has another roll in each recording: what hung at 90° in the gauge run may hang at −40° there."""
    patterns = {m.name: m for m, _ in VOCABULARY}
    models = (
        LIBRARY["tube_wedge"],
        *(patterns[n] for n in ("generic_line_1_2_hangs", "generic_wall_2_0", "generic_line_1_2")),
    )
    terms = [Term(m, (), np.ones(len(m.amplitudes))) for m in models]
    linear = _beyond_probe(terms, Correction(plain_probe(), (), tuple(m.name for m in models)))
    assert [m.name for m, *_ in linear] == ["tube_wedge", "generic_line_1_2"]
