"""σ includes the change of a stated probe where the evidence for that change is doubtful."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.arrays import Float
from pipeline.artefacts.measured import Trajectory
from pipeline.artefacts.motion import Rival
from pipeline.geometry.axis import straight_axis
from stages.accumulate import AccumulateParameters, accumulate_wall
from stages.motion import MotionParameters, estimate_motion, stated_probe
from stages.motion.stated_probe import with_doubtful_instrument
from stages.motion.tracking.landmarks import TrackedPoses
from stages.motion.wrong_parameters import wrong_parameters
from tests.drawn_run import RADIUS, drawn_run, without_encoder
from tests.quiet import quiet_context


@pytest.mark.parametrize(
    ("lasting", "trembles", "by", "doubted"),
    [(0.5, False, 3.0, False), (0.7, False, 3.0, True), (0.5, True, 3.0, True), (0.5, False, 6.0, True)],
    ids=["sound", "matches contradict", "the camera trembles", "another probe"],
)
def test_sigma_includes_the_change_of_a_probe_by_doubtful_evidence(
    lasting: float, trembles: bool, by: float, doubted: bool
) -> None:
    run = drawn_run(0.9 * np.arange(4), np.zeros(4))
    moved = by * run.probe.principal_uncertainties()[:, 0]
    got = Trajectory(
        np.arange(4), np.arange(4) / 30, run.T_pc, np.zeros((4, 6, 6)), straight_axis(-50.0, 150.0), RADIUS,
        1, 0, 0, (), run.probe.parameters + moved, 1e-4 * np.eye(len(moved)),
    )  # fmt: skip
    found = with_doubtful_instrument(got, run.probe, lasting, trembles).instrument_covariance
    assert found is not None
    np.testing.assert_allclose(found, 1e-4 * np.eye(len(moved)) + doubted * np.outer(moved, moved))


def test_a_probe_changed_by_frequently_lost_texture_is_doubtful(monkeypatch: pytest.MonkeyPatch) -> None:
    run = without_encoder(drawn_run(0.9 * np.arange(12), np.zeros(12)))
    parameters, found = MotionParameters(strip_step_mm=0.6, cell_px=20, patch_half_px=8), []
    told: dict[str, float] = {}
    context = replace(quiet_context(), report=lambda name, value, unit="": told.update({name: value}))
    for lost in (False, True):
        monkeypatch.setattr(TrackedPoses, "much_lost", lost)
        got = estimate_motion(run.recording, run.probe, run.rings, run.points, parameters, context)
        assert got.instrument is not None
        assert got.instrument_covariance is not None
        found.append(got.instrument_covariance)
    moved = got.instrument - run.probe.parameters
    assert np.abs(moved).max() > 1e-6, "control: with good texture it is not"
    np.testing.assert_allclose(found[1] - found[0], np.outer(moved, moved), atol=1e-15)
    assert told["1 σ of distance at the end"] == got.distance_sigma_mm, (
        "the reported uncertainty includes the doubt as well"
    )


def test_sigma_of_distances_includes_the_wider_pipe_of_a_doubtful_probe() -> None:
    """A view that drifted by 3 px changed the probe by 12 σ: distances were off by 2.2 to 2.8 of their σ."""
    run = drawn_run(0.9 * np.arange(4), np.zeros(4))
    moved = np.zeros(len(run.probe.parameters))
    moved[run.probe.parameter_names.index("baseline_mm")] = 0.01 * run.probe.laser.baseline_mm
    plain = Trajectory(
        np.arange(4), np.arange(4) / 30, run.T_pc, np.zeros((4, 6, 6)), straight_axis(-50.0, 150.0), RADIUS,
        1, 0, 0, (), run.probe.parameters + moved, 1e-4 * np.eye(len(moved)),
    )  # fmt: skip
    sound = replace(plain, distance_sigma_mm=0.01)
    doubted = with_doubtful_instrument(sound, run.probe, 0.5, shakes=True)
    assert doubted.distance_sigma_mm == pytest.approx(np.hypot(0.01, 0.01 * 2.7), rel=0.01)
    assert np.sqrt(doubted.covariance[:, 2, 2]) == pytest.approx(0.01 * 0.9 * np.arange(4), abs=1e-4)


def test_an_exact_baseline_gives_the_scale_without_an_encoder() -> None:
    """All that pictures said of the other lengths was taken for their unknown scale, and left out."""
    run = drawn_run(0.9 * np.arange(4), np.zeros(4))
    names = run.probe.parameter_names
    parameters, sigma, left = run.probe.parameters.copy(), np.zeros(len(names)), np.zeros(len(names))
    aside = names.index("decentre_x_mm")
    parameters[aside], sigma[aside], left[aside] = 0.5, 0.02, 0.001
    probe = run.probe.with_parameters(parameters, np.diag(sigma**2))
    got = Trajectory(
        np.arange(4), np.arange(4) / 30, run.T_pc, np.zeros((4, 6, 6)), straight_axis(-50.0, 150.0), RADIUS,
        np.nan, np.nan, 0, (), parameters + 10 * sigma, np.diag(left**2),
    )  # fmt: skip
    assert stated_probe.contradiction(got, probe).sigmas == pytest.approx(10, rel=0.01)


def test_pictures_name_the_wrong_parameters_or_those_that_they_cannot_tell_apart() -> None:
    """A direction of many parameters made the pipe 2 % wider where the centre had been shifted."""
    run = drawn_run(0.9 * np.arange(4), np.zeros(4))
    probe = replace(run.probe, covariance=np.diag(np.diag(run.probe.covariance)))
    names, sigma = probe.parameter_names, np.sqrt(np.diag(probe.covariance))
    centre, baseline, focal = (np.array([n.startswith(k) for n in names]) for k in ("cx", "baseline", "f"))
    both = centre | baseline
    of_focal, of_centre, of_sum = np.diag(focal), np.diag(centre), np.outer(both, both)
    cases: tuple[tuple[Float, Float, set[str]], ...] = (
        (of_centre, centre, {"cx"}),
        (of_sum, centre, {"cx", "baseline_mm"}),
        (np.diag(both), both, set()),
    )
    for of_wrong, parts, expected in cases:
        wrong, information = 100.0 * parts, 1e-2 * (of_wrong + of_focal)
        left = np.linalg.inv(np.eye(len(sigma)) + information)
        moved = sigma * (left @ information @ wrong)
        got = Trajectory(
            np.arange(4), np.arange(4) / 30, run.T_pc, np.zeros((4, 6, 6)), straight_axis(-50.0, 150.0),
            RADIUS, 1, 0, 0, (), probe.parameters + moved, np.outer(sigma, sigma) * left,
        )  # fmt: skip
        found = wrong_parameters(got, probe)
        most = {names[int(np.argmax(np.abs(w.moved) / np.maximum(sigma, 1e-12)))] for w in found}
        assert most == expected
        right = [w for w in found if abs(w.moved / sigma.clip(1e-12) - wrong).max() < 20]
        assert len(right) == bool(expected)


def test_sigma_includes_what_the_probe_that_pictures_demand_would_change(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In pictures of open-3 shifted by 10 px 85.6 % of the 95 % intervals held."""
    run = drawn_run(0.9 * np.arange(12), np.zeros(12))
    parameters, told = MotionParameters(strip_step_mm=0.6, cell_px=20, patch_half_px=8), list[str]()
    context = replace(quiet_context(), warn=told.append)
    agreed = estimate_motion(run.recording, run.probe, run.rings, run.points, parameters, context)
    assert not agreed.rivals
    assert not any("contradict each other" in words for words in told)
    monkeypatch.setattr(stated_probe, "TOO_FAR", 0.0)
    got = estimate_motion(run.recording, run.probe, run.rings, run.points, parameters, context)
    assert got.rivals
    assert got.distance_sigma_mm > agreed.distance_sigma_mm
    np.testing.assert_array_equal(got.T_pc, agreed.T_pc)


def test_sigma_of_radii_includes_the_wall_by_the_probe_that_pictures_demand() -> None:
    run = drawn_run(0.9 * np.arange(40), np.zeros(40))
    wide = run.probe.parameters.copy()
    wide[run.probe.parameter_names.index("baseline_mm")] *= 1.01
    got = Trajectory(
        np.arange(40), np.arange(40) / 30, run.T_pc, np.zeros((40, 6, 6)), straight_axis(-50.0, 150.0),
        RADIUS, 1, 0, 0, (), run.probe.parameters, run.probe.covariance,
    )  # fmt: skip
    chosen = AccumulateParameters(azimuth_samples=180)
    agreed, doubted = (
        accumulate_wall(run.probe, run.rings, run.points, t, chosen, quiet_context()).radius_map
        for t in (got, replace(got, rivals=(Rival(got.T_pc, got.axis, wide),)))
    )
    np.testing.assert_array_equal(doubted.radius_mm, agreed.radius_mm)
    added = np.sqrt(np.nanmedian(doubted.sigma_mm.astype(float) ** 2 - agreed.sigma_mm.astype(float) ** 2))
    assert added == pytest.approx(0.01 * RADIUS, rel=0.02)
