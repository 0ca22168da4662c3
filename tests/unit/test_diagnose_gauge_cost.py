"""Equations of a gauge run: a fit counts in the image, whatever the lens; so does the place in a pixel."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.arrays import Float
from pipeline.physics.effect import CourseKind
from stages.calibrate.gauge.state import Unknowns
from stages.diagnose.effects.courses import Coursed
from stages.diagnose.effects.library import LIBRARY, columns, ring_shift_px
from stages.diagnose.gauge.equations import RING
from stages.diagnose.gauge.linearise import asking, in_courses, linearise
from stages.diagnose.gauge.run import GaugeRun, Term
from stages.diagnose.gauge.search import prepare, weighed
from tests.gauge_runs import made_run, measured_run

NOISE_PX = 0.1


@pytest.fixture(scope="module")
def run() -> tuple[GaugeRun, Unknowns]:
    return prepare(measured_run(made_run(4, frames=24)))


def told_of_noise(measured: GaugeRun, start: Unknowns, larger: float) -> Float:
    """Return by how much the cost changes when residuals move outward, with a lens so much larger."""
    focal = np.zeros(len(start.instrument))
    focal[:2] = larger * np.array(start.stated.camera.focal_px)
    state, centre = replace(start, instrument=focal), start.stated.camera.centre_px
    rings = replace(measured.rings, uv=centre + (1 + larger) * (measured.rings.uv - centre))
    noisy = replace(rings, uv=rings.uv + NOISE_PX * rings.outward)
    before, after = (linearise(replace(measured, rings=r), state, ()).equations for r in (rings, noisy))
    ring = (before.kind == RING) & (before.weight > 0)
    return np.asarray(after.residual[ring] - before.residual[ring])


def test_image_noise_has_the_same_weight_whatever_the_lens(
    run: tuple[GaugeRun, Unknowns],
) -> None:
    stated = told_of_noise(*run, larger=0.0)
    assert np.median(stated) == pytest.approx(NOISE_PX, rel=0.05)
    # In millimetres it would be 2 % less.
    assert told_of_noise(*run, larger=0.02) == pytest.approx(stated, rel=1e-3)


def test_points_outside_the_view_have_no_weight_and_do_not_sharpen_the_rest(
    run: tuple[GaugeRun, Unknowns],
) -> None:
    measured, start = run
    rings = measured.rings
    away = np.arange(len(rings.frame)) % 3 == 0
    uv = np.where(away[:, None], rings.uv + 5000 * rings.outward, rings.uv)
    found = linearise(replace(measured, rings=replace(rings, uv=uv)), start, ())
    ring = found.equations.kind == RING
    assert not found.equations.weight[ring][away].any()
    assert np.isfinite(found.equations.residual[ring]).all()
    kept = weighed(measured, found).ring_weight
    assert not kept[away].any()
    alone = measured.rings.select(~away)
    few = replace(
        measured, rings=alone, width_px=measured.width_px[~away], ring_weight=np.ones((~away).sum())
    )
    assert kept[~away] == pytest.approx(weighed(few, linearise(few, start, ())).ring_weight, rel=1e-6)


def test_the_place_within_a_pixel_is_that_of_the_line_as_found_effects_displace_it(
    run: tuple[GaugeRun, Unknowns],
) -> None:
    """It was that of the undisplaced line: beside two waves of the sheet, .051 px came out as .008."""
    measured, start = run
    wavy = Term(LIBRARY["sheet_waviness"], (3.0,), np.array([2.0, 0.0]))
    at = linearise(measured, start, [wavy])
    waves = ring_shift_px(wavy.model, at.rings, *wavy.at(wavy.amplitude))
    assert np.ptp(waves) > 0.5
    rho = np.linalg.norm(at.rings.uv - start.stated.camera.centre_px, axis=1) + waves
    locked = np.sinc(measured.rings.across_px) * np.sin(2 * np.pi * rho)
    told = asking(measured, start, at, [(LIBRARY["pixel_locking"], ())])
    seen = (told.kind == RING) & (told.weight > 0)
    assert -told.by_global[seen, -1] == pytest.approx(locked[seen[told.kind == RING]], abs=0.01)


@pytest.mark.parametrize("all_of_one", [False, True])
def test_points_outside_the_view_leave_the_courses_of_laws_known(
    run: tuple[GaugeRun, Unknowns], all_of_one: bool
) -> None:
    """A course was taken at the first point of each frame, wherever that is: the fit ended in an error."""
    measured, start = run
    rings = measured.rings
    first = np.append(True, np.diff(rings.frame) > 0) & (rings.frame % 2 == 0)
    away = rings.frame == rings.frame[0] if all_of_one else first
    uv = np.where(away[:, None], rings.uv + 5000 * rings.outward, rings.uv)
    beyond = replace(measured, rings=replace(rings, uv=uv))
    at = linearise(beyond, start, ())
    model = Coursed(LIBRARY["laser_cone"], (), CourseKind.DISTANCE)
    told = in_courses(beyond, start, at, [(model, (100.0,))])
    own = told.kind == RING
    assert np.isfinite(told.courses.factor).all()
    assert not told.weight[own][away].any()
    assert told.weight[own][~away].all()
    factor = at.rings.camera_distance_mm[~away] / 100
    law = -columns(LIBRARY["laser_cone"], at.rings, ())[~away, 0]
    assert told.in_full().by_global[own][~away, -1] == pytest.approx(factor * law, rel=1e-9, abs=1e-12)
