"""Mirrored pictures are recognised, and a probe with other errors is not called mirrored."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.artefacts.measured import Trajectory
from pipeline.geometry.axis import PipeAxis
from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from stages.motion.mirrored import _mirrored, mirrored_way
from stages.motion.stated_probe import report_instrument
from tests.quiet import quiet_context
from tests.unit.camera_samples import CAMERAS

CENTRE, SIZE = (796.9, 591.8), (1600, 1200)
SIGMA = {"cx": 0.06, "cy": 0.06, "tilt_x": 1e-4, "tilt_y": 1e-4, "fx": 0.06}


def stated(centre: tuple[float, float] = CENTRE, sigma: dict[str, float] = SIGMA) -> Probe:
    probe = Probe(KannalaBrandt(SIZE, (366.0, 366.0), centre), LaserSheet(23.4), np.zeros((20, 20)))
    return replace(probe, covariance=np.diag([sigma.get(n, 0.0) ** 2 for n in probe.parameter_names]))


def estimated(probe: Probe, truth: dict[str, float]) -> Trajectory:
    """Return the result of a run whose pictures were taken with ``truth`` instead of the stated parameters.

    It sees a mixture of tilt and principal point, as rings do, and each four times less precisely than
    stated.
    """
    names, sigma = probe.parameter_names, np.sqrt(np.diag(probe.covariance))
    true = np.array([truth.get(n, p) for n, p in zip(names, probe.parameters, strict=True)])
    known = np.flatnonzero(sigma > 0)
    look = np.eye(len(known)) + 0.5 * np.roll(np.eye(len(known)), 1, 0)
    seen = look @ ((true - probe.parameters)[known] / sigma[known])
    seen += np.random.default_rng(1).normal(0, 4, len(seen))
    gain = look.T @ np.linalg.inv(look @ look.T + 16 * np.eye(len(known)))
    change, covariance = np.zeros(20), np.zeros((20, 20))
    change[known] = sigma[known] * (gain @ seen)
    left = (np.eye(len(known)) - gain @ look) * np.outer(sigma[known], sigma[known])
    covariance[np.ix_(known, known)] = left
    axis = PipeAxis(np.array([-9.0, 99.0]), np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)))
    return Trajectory(
        np.arange(3), np.arange(3) / 30, np.tile(np.eye(4), (3, 1, 1)), np.zeros((3, 6, 6)), axis, 50.0, 1.0,
        0.001, 0.0005, (), probe.parameters + change, covariance,
    )  # fmt: skip


LEFT_RIGHT, UPSIDE_DOWN = {"cx": 1599 - CENTRE[0]}, {"cy": 1199 - CENTRE[1]}


@pytest.mark.parametrize(
    ("truth", "named"),
    [
        (LEFT_RIGHT, "mirrored left to right"),
        (UPSIDE_DOWN, "mirrored upside down"),
        (LEFT_RIGHT | UPSIDE_DOWN, "turned by 180°"),
        ({}, ""),
        ({"cx": CENTRE[0] + 3.2}, ""),
        ({"cx": CENTRE[0] - 5.2}, ""),
        ({"fx": 370.0}, ""),
    ],
)
def test_mirrored_pictures_are_named_and_other_faults_are_not(truth: dict[str, float], named: str) -> None:
    """In mirrored pictures of half the size the principal point moved by .11 of the way: no message."""
    assert mirrored_way(stated(), estimated(stated(), truth)) == named


@pytest.mark.parametrize("axes", ["x", "y", "xy"])
@pytest.mark.parametrize("name", CAMERAS)
def test_a_mirrored_probe_measures_the_mirrored_wall(name: str, axes: str) -> None:
    """Odd distortion and waves of the sheet must be mirrored, too: without that errors were .4 and .9 mm."""
    sheet = LaserSheet(
        23.4, tilt_x=0.01, tilt_y=-0.006, cone_rad=0.004, decentre_x_mm=0.3, decentre_y_mm=-0.2,
        waviness=(2e-3, -1e-3, 1.5e-3, 3e-3, -2e-3, 1e-3),
    )  # fmt: skip
    camera = CAMERAS[name]
    size = len(camera.parameter_names) + len(LaserSheet.PARAMETER_NAMES)
    probe = Probe(camera, sheet, np.zeros((size, size)))
    mirrored = probe.with_parameters(_mirrored(probe, axes), probe.covariance)
    azimuth = np.linspace(-3, 3, 40)
    uv = np.array(camera.parameters[[camera.parameter_names.index(c) for c in ("cx", "cy")]])
    uv = uv + 0.3 * min(camera.image_size) * np.stack([np.cos(azimuth), np.sin(azimuth)], -1)
    ways = [-1 if a in axes else 1 for a in "xy"]
    other = np.where(np.array(ways) < 0, np.array(camera.image_size) - 1 - uv, uv)
    wanted = probe.triangulate(uv) * (*ways, 1)
    np.testing.assert_allclose(mirrored.triangulate(other), wanted, atol=1e-6)


def test_a_symmetric_or_exactly_known_probe_cannot_show_mirroring() -> None:
    middle = stated((799.5, 599.5))
    assert mirrored_way(middle, estimated(middle, {"cx": 802.0})) == ""
    exact = stated(sigma={"fx": 0.06})
    assert mirrored_way(exact, estimated(exact, {"fx": 366.5})) == ""


def test_the_warning_says_that_the_recorder_mirrored_the_pictures() -> None:
    said: list[str] = []
    context = replace(quiet_context(), warn=said.append)
    report_instrument(stated(), estimated(stated(), LEFT_RIGHT), context)
    assert len(said) == 1
    assert "pictures that are mirrored left to right" in said[0]
    assert "boresight diagnose" not in said[0]
