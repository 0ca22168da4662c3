"""A probe that the adjustment had to change by many σ is reported; one that it merely refined is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.artefacts.measured import Trajectory
from pipeline.artefacts.motion import PipePiece
from pipeline.geometry.axis import PipeAxis, straight_axis
from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from stages.motion.cuts import beyond_cuts
from stages.motion.stated_probe import report_instrument
from stages.motion.tracking.landmarks import TrackedPoses
from stages.motion.trajectory import SeenCentres, camera_trembles, warn_of_lost_texture
from tests.quiet import quiet_context

COUNT = 20


def probe(covariance: np.ndarray) -> Probe:
    camera = KannalaBrandt((1600, 1200), (360.0, 360.0), (799.5, 599.5))
    return Probe(camera, LaserSheet(22.0), covariance)


def told(
    stated: Probe, change: np.ndarray | None, left: np.ndarray | None = None, encoder_scale: float = 1.0
) -> dict[str, object]:
    """Return numbers and warning of a run that changed the probe and ``left`` this covariance of it."""
    axis = PipeAxis(np.array([-9.0, 99.0]), np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)))
    poses, found = np.tile(np.eye(4), (3, 1, 1)), None if change is None else stated.parameters + change
    trajectory = Trajectory(
        np.arange(3),
        np.arange(3) / 30,
        poses,
        np.zeros((3, 6, 6)),
        axis,
        50.0,
        encoder_scale,
        0.001,
        0.0005,
        (),
        found,
        instrument_covariance=left,
    )
    numbers: dict[str, object] = {}
    context = replace(
        quiet_context(),
        report=lambda name, value, unit="": numbers.update({name: value}),
        warn=lambda text: numbers.update({"warning": text}),
    )
    report_instrument(stated, trajectory, context)
    return numbers


def loose(**sigma: float) -> np.ndarray:
    names = probe(np.zeros((COUNT, COUNT))).parameter_names
    return np.diag([sigma.get(name, 0.0) ** 2 for name in names])


def at(name: str, value: float) -> np.ndarray:
    names = probe(np.zeros((COUNT, COUNT))).parameter_names
    return np.array([value if n == name else 0.0 for n in names])


def test_a_probe_changed_by_36_sigma_gives_a_warning_with_the_number() -> None:
    numbers = told(probe(loose(baseline_mm=0.008, fx=0.05)), at("baseline_mm", -0.288))
    assert numbers["contradiction of pictures and stated probe, at most"] == pytest.approx(36)
    text = str(numbers["warning"])
    assert "the stated probe does not fit this recording" in text
    assert "36 times" in text
    assert "baseline_mm by -0.288" in text
    assert "boresight diagnose" in text


@pytest.mark.parametrize(("times", "warned"), [(0.0, False), (2.0, False), (4.9, False), (5.1, True)])
def test_a_probe_refined_within_its_uncertainty_gives_no_warning(times: float, warned: bool) -> None:
    numbers = told(probe(loose(baseline_mm=0.008, fx=0.05)), at("fx", 0.05 * times))
    assert ("warning" in numbers) is warned


def test_a_change_against_a_known_correlation_has_the_size_that_this_implies() -> None:
    """Two σ each are small if the correlation is right, and large against a known correlation."""
    covariance = loose(fx=0.05, fy=0.05)
    both = at("fx", 0.1) - at("fy", 0.1)
    assert "warning" not in told(probe(covariance), both)
    covariance[0, 1] = covariance[1, 0] = 0.98 * 0.05**2
    assert "warning" in told(probe(covariance), both)
    assert "warning" not in told(probe(covariance), at("fx", 0.1) + at("fy", 0.1))


@pytest.mark.parametrize(("moved", "warned"), [(0.03, False), (0.09, False), (0.2, True), (0.8, True)])
def test_a_direction_that_pictures_hardly_show_counts_against_what_they_show(
    moved: float, warned: bool
) -> None:
    """Pictures shifted by 160 σ of the stated centre moved it by 0.8 σ alone, and nothing was said."""
    stated = probe(loose(cx=0.03, baseline_mm=0.008))
    gain = 0.001  # so that a correct probe moves by 0.03 of its σ
    left = stated.covariance * np.where(at("cx", 1.0) > 0, 1 - gain, 1.0)
    numbers = told(stated, at("cx", 0.03 * moved), left)
    assert numbers["contradiction of pictures and stated probe, at most"] == pytest.approx(
        moved / np.sqrt(gain)
    )
    assert ("warning" in numbers) is warned
    if warned:
        text = str(numbers["warning"])
        assert "by the pictures alone the probe would change" in text
        assert f"cx by {0.03 * moved / gain:+.3g}" in text
        assert "dust, reflections or water" in text, "the pictures may be wrong as well"


@pytest.mark.parametrize("encoder", [False, True])
@pytest.mark.parametrize("name", ["baseline_mm", "cx"])
def test_without_an_encoder_the_scale_of_all_lengths_is_no_evidence_against_the_probe(
    name: str, encoder: bool
) -> None:
    """An even motion in mm shrank all lengths by 1e-5: a correct baseline was contradicted by 8 σ."""
    stated, gain = probe(loose(cx=0.03, baseline_mm=0.008)), 1e-3
    left = stated.covariance * np.where(at(name, 1.0) > 0, 1 - gain, 1.0)
    change = -0.2 * np.sqrt(np.diagonal(stated.covariance)) * at(name, 1.0)
    numbers = told(stated, change, left, 1.0 if encoder else float("nan"))
    assert ("warning" in numbers) is (encoder or name == "cx")


def test_a_direction_that_pictures_do_not_show_is_no_evidence_however_small_its_share() -> None:
    """What the adjustment's end left undone, .011 σ, contradicted a correct probe by 5.3 σ."""
    stated, gain = probe(loose(cx=0.03, baseline_mm=0.008)), 4.6e-6
    left = stated.covariance * np.where(at("cx", 1.0) > 0, 1 - gain, 1.0)
    assert "warning" not in told(stated, at("cx", 0.03 * 0.0114), left)


@pytest.mark.parametrize("seed", range(3))
def test_a_correct_probe_moves_by_what_the_pictures_show(seed: int) -> None:
    """Of drawn adjustments of two parameters none is contradicted, whether pictures show much or little."""
    random, stated = np.random.default_rng(seed), probe(loose(cx=0.03, baseline_mm=0.008))
    for error in (0.01, 1.0, 100.0):
        true = 0.03 * random.standard_normal()
        seen = true + 0.03 * error * random.standard_normal()
        gain = 1 / (1 + error**2)
        left = stated.covariance * np.where(at("cx", 1.0) > 0, 1 - gain, 1.0)
        assert "warning" not in told(stated, at("cx", gain * seen), left)


def test_a_probe_that_was_not_adjusted_gives_no_warning() -> None:
    assert told(probe(loose(fx=0.05)), None) == {}
    assert told(probe(np.zeros((COUNT, COUNT))), np.zeros(COUNT)) == {
        "contradiction of pictures and stated probe, at most": 0.0
    }


@pytest.mark.parametrize(("ring_trembles", "denied"), [(0.0, True), (0.3, True), (1.0, False), (6.0, False)])
def test_a_ring_without_vibration_excludes_a_vibrating_camera(ring_trembles: float, denied: bool) -> None:
    """1: the whole probe vibrates; 6: the camera does, on its mount, which moves the picture of the ring."""
    number, random = np.arange(200), np.random.default_rng(3)
    shaken = np.zeros((200, 2))
    shaken[:, 1] = 0.05 * random.standard_normal(200)
    sway = np.stack([np.sin(number / 30), np.cos(number / 40)], -1)
    T_pc = np.tile(np.eye(4), (200, 1, 1))
    T_pc[:, :2, 3], T_pc[:, 2, 3] = sway + shaken, 0.6 * number
    axis = straight_axis(-50, 300)
    run = Trajectory(number, number / 30, T_pc, np.zeros((200, 6, 6)), axis, 50.0, 1.0, 0.0, 0.0, ())
    rings = SeenCentres(-(sway + ring_trembles * shaken)[::2], 22.0)
    assert rings.deny_trembling(run, number[1::2]) is denied


@pytest.mark.parametrize(("lost", "told"), [(0.1, True), (0.9, False)])
def test_without_texture_no_camera_is_reported_to_vibrate(lost: float, told: bool) -> None:
    """Of 85 lit pictures 84 showed no texture, and the camera was reported to vibrate by 0.03°."""
    number, random = np.arange(80), np.random.default_rng(3)
    T_pc = np.tile(np.eye(4), (80, 1, 1))
    T_pc[:, :3, :3] = Rotation.from_rotvec(2e-3 * random.standard_normal((80, 3))).as_matrix()
    T_pc[:, 2, 3] = 0.6 * number
    run = Trajectory(
        number, number / 30, T_pc, np.zeros((80, 6, 6)), straight_axis(-50, 300), 50.0, 1.0, 0.0, 0.0, ()
    )
    poses = TrackedPoses(number[1::2], T_pc[1::2], random.permutation(40) < 40 * lost)
    assert camera_trembles(run, poses, SeenCentres(np.full((40, 2), np.nan), 22.0)) is told


def test_rings_of_a_jerking_probe_exclude_no_vibration() -> None:
    """Jerks hide the vibration of rings. Estimated as 0, it excluded vibration in one of four runs."""
    number, axis = np.arange(40), straight_axis(-50, 300)
    for seed in range(20):
        random = np.random.default_rng(seed)
        jerks = np.cumsum(np.cumsum(np.cumsum(0.2 * random.standard_normal((40, 2)), 0), 0), 0)
        T_pc = np.tile(np.eye(4), (40, 1, 1))
        T_pc[:, :2, 3] = jerks + 0.1 * random.standard_normal((40, 2))
        T_pc[:, 2, 3] = 0.6 * number
        run = Trajectory(number, number / 30, T_pc, np.zeros((40, 6, 6)), axis, 50.0, 1.0, 0.0, 0.0, ())
        assert not SeenCentres(-T_pc[::2, :2, 3], 22.0).deny_trembling(run, number[1::2])


def run_of(z_mm: list[float]) -> Trajectory:
    """Return a run to these places with two pieces of pipe, each known to 0.3 mm."""
    count = len(z_mm)
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, 2, 3] = z_mm
    pieces = (PipePiece("straight", 0.0, 15.0, 0.3), PipePiece("straight", 15.0, 30.0, 0.3))
    return Trajectory(
        np.arange(count), np.arange(count) / 30, poses, np.tile(0.01 * np.eye(6), (count, 1, 1)),
        straight_axis(-50.0, 150.0), 50.0, 1.0, 0.001, 0.0005, (), distance_sigma_mm=0.1, pieces=pieces,
    )  # fmt: skip


@pytest.mark.parametrize("cut", [(), (2,), (2, 3)])
def test_sigma_of_distances_beyond_a_cut_is_the_length_of_the_run(cut: tuple[int, ...]) -> None:
    """Where ten pictures were stored ten too late, distances erred by 73 of their σ."""
    found = beyond_cuts(run_of([0.0, 10.0, 20.0, 30.0]), cut, 20.0)
    behind = bool(cut) * (np.arange(4) >= 2)
    np.testing.assert_allclose(found.covariance[:, 2, 2], 0.01 + 900.0 * behind)
    np.testing.assert_allclose(found.covariance[:, [0, 1, 5], [0, 1, 5]], 0.01)
    assert found.distance_sigma_mm == pytest.approx(30.0 if cut else 0.1, rel=1e-4)
    assert found.cut_sigma_mm == (30.0 if cut else 0.0)
    assert [p.sigma_mm for p in found.pieces] == pytest.approx([0.3, 30.0 if cut else 0.3], rel=1e-4)


def test_sigma_at_a_cut_is_at_least_the_distance_that_a_picture_shows_even_if_the_probe_stood() -> None:
    """Such a run has no length, so that σ was 0 beyond the cut."""
    found = beyond_cuts(run_of([5.0, 5.0, 5.0, 5.0]), (2,), 20.0)
    np.testing.assert_allclose(np.sqrt(found.covariance[:, 2, 2]), [0.1, 0.1, 20.0, 20.0], rtol=1e-4)
    assert found.distance_sigma_mm == pytest.approx(20.0, rel=1e-4)


@pytest.mark.parametrize("encoder", [True, False])
@pytest.mark.parametrize("lost", [True, False])
def test_where_texture_is_lost_an_encoder_is_named_only_if_there_is_one(encoder: bool, lost: bool) -> None:
    """A run without an encoder was told that rings and encoder give the motion."""
    words: list[str] = []
    poses = TrackedPoses(np.arange(9), np.tile(np.eye(4), (9, 1, 1)), np.full(9, lost))
    warn_of_lost_texture(poses, 0, encoder, replace(quiet_context(), warn=words.append))
    (text,) = words
    assert ("encoder" in text) is encoder
