"""Kinds of pictures and light of the line in the composed answer: what they excuse, and what they do not."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pipeline.instrument.probe import Probe
from stages.diagnose.causes import NONE
from stages.diagnose.combine import compose
from stages.diagnose.gauge import answer as of_rings
from stages.diagnose.gauge.examine import Examined
from stages.diagnose.profile.evidence import Condition, ProfileEvidence
from stages.diagnose.profile.finding import Size, finding
from stages.diagnose.result import EffectFound, FitQuality, Location, Verdict
from tests.diagnosed import AGREES, SCALE, answer, seen
from tests.unit.wall_points import Bore, plain_probe, ring_points


@pytest.mark.parametrize(("width_px", "verdict"), [(1.5, Verdict.NAMED), (9.0, Verdict.CLASS)])
def test_a_name_needs_pictures_of_a_kind_on_which_names_were_validated(
    real_probe: Probe, width_px: float, verdict: Verdict
) -> None:
    size = (Size("skewness", "", 1.0, 0.1),)
    skewed = replace(finding("line_skew", 20.0, 1e-12, size, "It is skewed."), agreements=(AGREES,))
    light = ProfileEvidence("gauge", np.arange(3), (skewed,), (Condition("width", width_px, 1.1, 3.2),))
    found = answer(real_probe, None, replace(seen("gauge"), profile=light))
    assert found.verdict is verdict
    assert (found.effects[0].probability > 0.8) is (verdict is Verdict.NAMED)
    assert bool(light.uncovered) is (verdict is Verdict.CLASS)


def test_evidence_of_image_formation_in_the_line_is_not_reported_as_improbable(real_probe: Probe) -> None:
    """A sound probe was consistent, but "chance alone would show as much with probability 9e-8"."""
    faint = finding("line_skew", 5.6, 3e-8, (Size("skewness", "", 0.1, 0.02),), "It is skewed.")
    clear = replace(faint, z=20.0)
    told = []
    for skewed in (faint, clear):
        light = ProfileEvidence("gauge", np.arange(3), (skewed,))
        told.append(answer(real_probe, None, replace(seen("gauge"), profile=light)).global_p)
    assert told == [1.0, pytest.approx(3e-8)]


def rings_of_a_class(monkeypatch: pytest.MonkeyPatch, moved_px: float) -> Examined:
    """Return rings that a drift, from a class of two names, moves by ``moved_px``."""
    monkeypatch.setattr(of_rings, "ring_shift_alone_px", lambda fit, term: term.shift_px)
    monkeypatch.setattr(of_rings, "verdict_of", lambda examined: Verdict.CLASS)
    drift = EffectFound("baseline_drift", 0.5, {}, "The baseline gets longer.", "", ())
    monkeypatch.setattr(of_rings, "effects_found", lambda examined: (drift,))
    monkeypatch.setattr(of_rings, "members", lambda examined: ("laser_cone", "baseline_drift"))
    monkeypatch.setattr(of_rings, "candidates", lambda examined: ())
    monkeypatch.setattr(of_rings, "unknown_law_descriptions", lambda examined: ())
    best = SimpleNamespace(fit=SimpleNamespace(terms=(SimpleNamespace(shift_px=moved_px),)), names=("a",))
    rings = SimpleNamespace(
        best=best, searched=searched_rings(), location=None, quality=None, feasibility=(),
        global_p=0.0, shortcomings=(), verdicts=None,
    )  # fmt: skip
    return cast(Any, rings)


def searched_rings() -> Any:
    """Return rings of a 4 inch bore with a line 1.7 px wide; one mm of the sheet is 6 px."""
    rings = ring_points(plain_probe(), Bore(50.8), 40)
    return SimpleNamespace(
        run=SimpleNamespace(width_px=np.full(9, 1.7)),
        nothing=SimpleNamespace(linearised=SimpleNamespace(rings=rings)), by_chance=0.5,
    )  # fmt: skip


def light(source: str, name: str, *size: Size) -> ProfileEvidence:
    """Return a certain effect on the line's light."""
    found = replace(finding(name, 20.0, 1e-12, size, "It is seen."), agreements=(AGREES,))
    return ProfileEvidence(source, np.arange(3), (found,))


@pytest.mark.parametrize(
    ("moved_px", "sd_mm", "verdict"),
    [(0.07, 0.03, Verdict.NAMED), (0.3, 0.03, Verdict.PARTLY), (0.07, 0.002, Verdict.PARTLY)],
)
def test_residuals_smaller_than_the_uncertainty_of_a_named_light_effect_are_no_remainder(
    real_probe: Probe, monkeypatch: pytest.MonkeyPatch, moved_px: float, sd_mm: float, verdict: Verdict
) -> None:
    """Beside a line with glowing wall, .07 px of drift gave the verdict "partly" and a class of 13 names."""
    rings = rings_of_a_class(monkeypatch, moved_px)
    glow = light("gauge", "subsurface", Size("transport_mm", "mm", 0.3, sd_mm))
    found = answer(real_probe, None, replace(seen("gauge"), profile=glow, geometry=rings))
    assert found.verdict is verdict
    assert [e.name for e in found.effects] == ["subsurface"]
    told = [s for s in found.shortcomings if "uncertain size of subsurface can explain all deviations" in s]
    assert bool(told) is (verdict is Verdict.NAMED)
    assert all("such as laser_cone, baseline_drift, moves them" in s for s in told)


@pytest.mark.parametrize(("moved_px", "asked"), [(0.07, False), (0.3, True)])
def test_causes_of_rings_that_light_explains_are_no_part_of_another_channels_class(
    real_probe: Probe, monkeypatch: pytest.MonkeyPatch, moved_px: float, asked: bool
) -> None:
    """Beside a class of the encoder's errors, causes of rings that were left out would be summed up."""
    rings, weighed = rings_of_a_class(monkeypatch, moved_px), []
    monkeypatch.setattr(compose, "weighed", lambda examined, claims: weighed.append(examined) or NONE)
    glow = light("gauge", "subsurface", Size("transport_mm", "mm", 0.3, 0.03))
    found = answer(real_probe, None, replace(seen("gauge", estimates=(SCALE,)), profile=glow, geometry=rings))
    assert found.remainder is not None
    assert "encoder_scale" in found.remainder.members
    assert weighed == [rings if asked else None]


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("vignetting", (Size("falloff", "", 0.3, 0.06),)),
        ("ambient_light", (Size("relative", "", 0.05, 0.02),)),
        ("dust", (Size("attenuation", "", 0.4, 0.1),)),
        ("speckle", (Size("contrast", "", 0.1, 0.02),)),
        ("ghost_ring", (Size("relative", "", 0.02, 0.01),)),
    ],
)
def test_light_that_cannot_move_the_line_so_far_excuses_no_residual(
    real_probe: Probe, monkeypatch: pytest.MonkeyPatch, name: str, size: tuple[Size, ...]
) -> None:
    """Each excused .05 px or more.

    With its size known to 20 %, it was assumed to move the line by .2 widths.
    """
    rings, seen_light = rings_of_a_class(monkeypatch, 0.05), light("gauge", name, *size)
    found = answer(real_probe, None, replace(seen("gauge"), profile=seen_light, geometry=rings))
    assert found.remainder is not None
    assert {"laser_cone", "baseline_drift"} <= set(found.remainder.members)


def test_light_in_the_inspection_alone_excuses_no_residual_of_the_gauge_run(
    real_probe: Probe, monkeypatch: pytest.MonkeyPatch
) -> None:
    rings = rings_of_a_class(monkeypatch, 0.07)
    glow = light("field", "subsurface", Size("transport_mm", "mm", 0.3, 0.03))
    field, gauge = replace(seen("field"), profile=glow), replace(seen("gauge"), geometry=rings)
    found = answer(real_probe, field, gauge)
    assert found.remainder is not None
    assert {"laser_cone", "baseline_drift"} <= set(found.remainder.members)
    assert answer(real_probe, field, replace(gauge, profile=glow)).remainder is None


@pytest.mark.parametrize(
    ("name", "size", "verdict"),
    [
        ("subsurface", (Size("transport_mm", "mm", 0.3, 0.06),), Verdict.NAMED),
        ("beam_decentre", (), Verdict.PARTLY),
        ("saturation", (Size("exposure_gain", "", 3.0, 2.0),), Verdict.PARTLY),
    ],
)
def test_a_repeated_residual_is_due_to_light_only_where_the_light_can_move_the_line_so_far(
    real_probe: Probe, name: str, size: tuple[Size, ...], verdict: Verdict
) -> None:
    """A claim without a size excused a whole width of the line: 1.4 px, with noise of .1 px."""
    quality = FitQuality("px", 0.31, 0.3, 0.29, 0.284, 0.126)
    rings = Examined(searched_rings(), None, (), (), quality=quality, location=Location("ring", None, None))
    gauge = replace(seen("gauge"), profile=light("gauge", name, *size), geometry=rings)
    assert answer(real_probe, None, gauge).verdict is verdict
