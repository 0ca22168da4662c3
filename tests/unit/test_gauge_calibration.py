"""Gauge calibration on simulated runs: estimates, derivatives, outliers, choice of the sheet, refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.errors import InputError, UnusableError
from pipeline.geometry.rigid import transform
from pipeline.recording.base import BoreSection, Illumination
from stages.calibrate.gauge import premises
from stages.calibrate.gauge.geometry import BoreRings, gauge_of
from stages.calibrate.gauge.result import warn_of_bores, warn_of_misfit
from stages.calibrate.gauge.solve import RingSource
from stages.calibrate.gauge.state import SheetModel, Unknowns
from stages.calibrate.gauge.terms import Equations, edge_equations, expected_ring, ring_equations
from tests.gauge_runs import (
    USUAL,
    GaugeRun,
    calibrated,
    driven_as,
    facts,
    in_sigma,
    made_run,
    measured_run,
    rings_of,
)
from tests.quiet import quiet_context


@pytest.fixture(scope="module")
def run() -> GaugeRun:
    return made_run(1)


def _unknowns(run: GaugeRun) -> tuple[Unknowns, RingSource]:
    given = measured_run(run)
    return given.start, given.source


def _where_expected(state: Unknowns, rings: BoreRings) -> BoreRings:
    """Return ring points without any noise."""
    for _ in range(4):
        rings = replace(rings, uv=expected_ring(state, rings)[1])
    return rings


@pytest.mark.parametrize("kind", ["edges", "rings"])
def test_derivatives_agree_with_finite_differences(run: GaugeRun, kind: str) -> None:
    state, source = _unknowns(run)
    on_bore = _where_expected(state, source.on_bore(state.T_pc, run.stated, USUAL))

    def equations(at: Unknowns) -> Equations:
        return edge_equations(at, run.edges) if kind == "edges" else ring_equations(at, on_bore)

    frames, border = np.zeros((len(state.T_pc), 7)), np.zeros(state.border_size)
    rows = equations(state).rows
    for unknown in (0, 2, 3, 4):
        step = frames.copy()
        step[:, unknown] = 1e-5
        slope = (equations(state.step(step, border)).rows.residual - rows.residual) / 1e-5
        assert np.allclose(slope, rows.by_frame[:, 0, unknown], rtol=2e-3, atol=2e-3 * np.abs(slope).max())
    at = state.layout
    for unknown in (*range(3, 6), at.marker.start + 5, *range(at.instrument.start, at.size)):
        change = border.copy()
        change[unknown] = 1e-4
        slope = (equations(state.step(frames, change)).rows.residual - rows.residual) / 1e-4
        scale = max(np.abs(slope).max(), 1e-9)
        assert np.allclose(slope, rows.by_border[:, unknown], rtol=5e-3, atol=5e-3 * scale)


def test_derivatives_of_rings_do_not_contain_the_noise_of_the_measurement(run: GaugeRun) -> None:
    """Otherwise their product with the residual has a mean, which moved the baseline by 0.5 σ."""
    state, source = _unknowns(run)
    rings = _where_expected(state, source.on_bore(state.T_pc, run.stated, USUAL))
    noisy = replace(rings, uv=rings.uv + 0.5 * rings.outward)
    quiet, moved = (ring_equations(state, r).rows.by_border for r in (rings, noisy))
    largest = np.abs(quiet).max(0)
    assert (np.abs(moved - quiet).max(0) <= 3e-4 * largest).all()


def test_drawn_probes_are_estimated_within_the_stated_sigma() -> None:
    drawn = [list(in_sigma(r, calibrated(r)).values()) for r in (made_run(seed) for seed in (1, 2, 3))]
    # 30 correlated numbers: a σ wrong by a factor of two, or such a bias, would show
    assert np.mean(np.abs(drawn) < 1.96) > 0.8
    assert 0.3 < np.sqrt(np.mean(np.square(drawn))) < 1.6


def test_the_result_says_by_how_much_the_stated_probe_is_off(run: GaugeRun) -> None:
    result = calibrated(run)
    names = result.probe.parameter_names
    k = [names.index(n) for n in ("tilt_x", "tilt_y")]
    assert np.linalg.norm((run.true.parameters - run.stated.parameters)[k]) > 20 * 1e-4
    assert np.linalg.norm((run.true.parameters - result.probe.parameters)[k]) < 1.7e-4
    widest = max(result.radii, key=lambda r: r.radius_mm)
    assert np.abs(widest.before_mm).max() > 20 * widest.sigma_mm.max()
    assert result.sheet is SheetModel.PLAIN
    assert result.encoder[0] == pytest.approx(1.001, abs=4 * result.encoder_sigma[0])


def test_decentring_is_estimated_where_it_exists(run: GaugeRun) -> None:
    laser = replace(run.true.laser, decentre_x_mm=0.15, decentre_y_mm=-0.1)
    true = replace(run.true, laser=laser)
    T_pc = driven_as(run)
    index = run.recording.frames.of(Illumination.LASER)
    rings = rings_of(T_pc, index, true, run.gauge, np.random.default_rng(5))
    result = calibrated(replace(run, rings=rings, true=true))
    assert result.sheet is SheetModel.DECENTRED
    assert max(map(abs, in_sigma(replace(run, true=true), result).values())) < 4


def test_one_wrong_ring_in_five_is_rejected_and_named(run: GaugeRun) -> None:
    wrong = np.arange(2, len(run.rings.frame), 5)
    radius = run.rings.radius_px.copy()
    radius[wrong] += (4 * np.cos(3 * run.rings.azimuth_rad) + 3).astype(np.float32)
    broken = replace(run, rings=replace(run.rings, radius_px=radius))
    result = calibrated(broken)
    on_bore = np.intersect1d(run.rings.frame[wrong], np.unique(calibrated(run).measured.rings.frame))
    assert set(on_bore) <= set(result.wrong_rings) <= set(run.rings.frame[wrong])
    assert max(map(abs, in_sigma(broken, result).values())) < 4


def test_a_displaced_fiducial_is_left_out_and_named(run: GaugeRun) -> None:
    moved = run.edges.marker == 12
    edges = replace(run.edges, xyz_p=run.edges.xyz_p + 0.6 * moved[:, None] * np.array([0, 0, 1.0]))
    result = calibrated(replace(run, edges=edges))
    assert result.wrong_fiducials.tolist() == [12]
    assert max(map(abs, in_sigma(run, result).values())) < 4


def test_bores_in_the_wrong_order_are_refused(run: GaugeRun) -> None:
    state, _ = _unknowns(run)
    other = gauge_of(
        replace(facts(), bore=tuple(BoreSection(42.0, d) for d in (101.6, 70.0, 84.0))), run.gauge.fiducials
    )
    source = RingSource(run.rings, run.rings.frame, other)

    def error(of: RingSource) -> tuple[np.ndarray, np.ndarray]:
        rings = of.on_bore(state.T_pc, run.stated, USUAL)
        xyz_p = transform(state.T_pc[rings.frame], run.stated.triangulate(rings.uv))
        return rings.section, np.hypot(xyz_p[:, 0], xyz_p[:, 1]) - rings.radius_mm

    with pytest.raises(UnusableError, match=r"section 2 .* measures 8.* where .* says 70 mm"):
        premises.require_bores(other, *error(source))
    premises.require_bores(run.gauge, *error(RingSource(run.rings, run.rings.frame, run.gauge)))


def test_camera_that_stays_on_the_axis_is_refused(run: GaugeRun) -> None:
    T_pc = driven_as(run)
    premises.require_offset(T_pc, USUAL)
    T_pc[:, :2, 3] *= 0.05
    with pytest.raises(UnusableError, match="a tilt of the sheet"):
        premises.require_offset(T_pc, USUAL)


def test_an_inspection_is_refused_as_a_gauge_run(run: GaugeRun) -> None:
    with pytest.raises(InputError, match="describes no bore"):
        premises.require_gauge(replace(run.recording, pipe=replace(facts(), bore=())))
    twice = replace(facts().fiducials, markers=facts().fiducials.markers[:1] * 2)
    with pytest.raises(InputError, match="lists fiducial 0 twice"):
        premises.require_gauge(replace(run.recording, pipe=replace(facts(), fiducials=twice)))


def test_a_gauge_with_a_too_uncertain_radius_is_refused_with_its_name() -> None:
    premises.require_determined(0.003, "cx with tilt_x", USUAL)
    with pytest.raises(UnusableError, match="weak direction is cx with tilt_x"):
        premises.require_determined(0.2, "cx with tilt_x", USUAL)


def test_pictures_that_no_such_probe_can_take_are_reported_and_sound_ones_are_not(run: GaugeRun) -> None:
    """Pixels 2 % too wide gave a cone 125 σ off with its usual σ, and no message."""
    said: list[str] = []
    context = replace(quiet_context(), warn=said.append)
    sound = calibrated(run)
    warn_of_misfit(sound, context)
    warn_of_bores(sound, run.gauge, context)
    assert said == []
    uv, (cx, _) = run.edges.uv.copy(), run.stated.camera.centre_px
    uv[:, 0] = cx + 1.02 * (uv[:, 0] - cx)
    warn_of_misfit(calibrated(replace(run, edges=replace(run.edges, uv=uv))), context)
    assert "the edges of the fiducials lie" in said[0]
    assert "scales, stretches, cuts or stabilises" in said[0]


def test_a_bore_that_is_not_as_stated_is_reported(run: GaugeRun) -> None:
    """A bore stated .1 mm too narrow moved the baseline by 2.7 σ, without a message."""
    said: list[str] = []
    context = replace(quiet_context(), warn=said.append)
    wrong = replace(run.gauge, radius_mm=run.gauge.radius_mm - np.array([0.0, 0.05, 0.0]))
    warn_of_bores(calibrated(replace(run, gauge=wrong)), wrong, context)
    assert "Farthest off is section 2" in said[0]
