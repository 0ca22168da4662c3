"""The profile channel of the diagnosis: all tests of the line's light on one recording and on its halves."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Int
from pipeline.artefacts.measured import RingSamples
from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context
from pipeline.pages import notation
from pipeline.recording.base import Recording
from stages.diagnose.agreement import Agreement, Part, agreement
from stages.diagnose.profile.brightness import (
    clip_finding,
    decentre_finding,
    dust_finding,
    stray_finding,
    vignetting_finding,
)
from stages.diagnose.profile.cells import Cells, LineGeometry, line_geometry, make_cells
from stages.diagnose.profile.finding import Finding, Size
from stages.diagnose.profile.measure import LineProfiles, measure_profiles
from stages.diagnose.profile.naming import UNEXPLAINED, shape_findings
from stages.diagnose.profile.width import blur_finding, locking_finding, pattern_finding

_LEAST_BLOCKS = 4
_NAMELESS = "The line's light shows something that no known effect explains."
_SPOT_OR_PIXELS = {"dust": "fixed_pattern", "fixed_pattern": "dust"}
Test = Callable[[Cells], tuple[Finding, ...]]
_HALVES = ("first half of the frames", "second half of the frames")
# A jackknife over fewer blocks gives no usable σ.
_LEAST_BLOCKS_OF_HALF = 3
# Range of the simulated cases of `python -m tests.benchmarks.bench_profile_nulls`, 39 of seed 1: widths of
# unclipped lines, heights and clipped shares. They were encoded by H.264 at crf 18 to 34.
_COUNTED_WIDTH_PX, _COUNTED_HEIGHT, _COUNTED_CLIPPED = (1.1, 3.2), (38.0, 251.0), (0.0, 0.84)


def with_halves(findings: tuple[Finding, ...], tests: Sequence[Test], cells: Cells) -> tuple[Finding, ...]:
    """Return the findings; those that were found include whether both halves of the frames agree.

    ``tests`` are those that found something; they are repeated on each half.
    """
    count = len(cells.frames)
    middle = count // 2
    if middle < _LEAST_BLOCKS_OF_HALF:
        return findings
    halves = [
        {f.effect: f for test in tests for f in test(half)}
        for half in (cells.of_blocks(0, middle), cells.of_blocks(middle, count))
    ]
    return tuple(replace(f, agreements=_halves_agree(f, *halves)) if f.found else f for f in findings)


def _halves_agree(
    whole: Finding, first: Mapping[str, Finding], second: Mapping[str, Finding]
) -> tuple[Agreement, ...]:
    """Return whether the halves agree on the first quantity; nothing where either is too uncertain."""
    sizes = [s for half in (first, second) if whole.effect in half for s in half[whole.effect].sizes[:1]]
    if len(sizes) < 2:
        return ()
    each = zip(_HALVES, sizes, strict=True)
    first_part, second_part = (Part.of(where, _words(s), s.value, s.sigma) for where, s in each)
    out = agreement(first_part, second_part)
    return () if out is None else (out,)


def _words(size: Size) -> str:
    return f"{size.name} {size.value:.4g} {notation.plus_minus(size.sigma, size.unit)}"


@dataclass(frozen=True)
class Condition:
    """A property of the line's pictures, and its range in the cases where false alarms were counted."""

    words: str
    value: float
    low: float
    high: float

    @property
    def covered(self) -> bool:
        """Whether the value is within that range."""
        return self.low <= self.value <= self.high


@dataclass(frozen=True)
class ProfileEvidence:
    """Evidence from the line's light in one recording.

    Attributes
    ----------
    source : str
        Name of the recording.
    frame : (F,) int
        Frames lit by the laser alone.
    findings : tuple of Finding
        One per effect, found or not.
    """

    source: str
    frame: Int
    findings: tuple[Finding, ...]
    conditions: tuple[Condition, ...] = ()

    @property
    def uncovered(self) -> tuple[str, ...]:
        """Sentences on how these pictures differ from those on which the tests' p-values were verified."""
        return tuple(
            f"The {c.words} is {c.value:.3g} in {self.source}. How often the line's profile raises "
            f"false alarms is known from {c.low:.3g} to {c.high:.3g}: here it gives no name by itself."
            for c in self.conditions
            if not c.covered
        )

    @property
    def found(self) -> tuple[Finding, ...]:
        """Findings with a name that exceed image formation and chance, the most significant first."""
        named = (f for f in self.findings if f.found and f.effect != UNEXPLAINED)
        return tuple(sorted(named, key=lambda f: -abs(f.z)))

    @property
    def unexplained(self) -> Finding | None:
        """A feature of the line that no named shape fits; None where there is none."""
        return next((f for f in self.findings if f.effect == UNEXPLAINED), None)

    def with_finding(self, finding: Finding) -> ProfileEvidence:
        """Return the evidence with the finding of one effect replaced."""
        findings = tuple(finding if f.effect == finding.effect else f for f in self.findings)
        return replace(self, findings=findings)

    def without(self, names: Collection[str]) -> ProfileEvidence:
        """Return the evidence with some effects treated as unknown.

        A finding that only they would explain becomes unexplained.
        """
        left = {f.effect for f in self.found} - set(names)
        out = []
        for f in self.findings:
            alike = tuple(n for n in f.alike if n not in names)
            if f.effect not in names:
                out.append(replace(f, alike=alike))
            elif f.found and self.unexplained is None and not left & set(alike):
                out.append(replace(f, effect=UNEXPLAINED, alike=(), statement=_NAMELESS, sizes=()))
        return replace(self, findings=tuple(out))

    def of(self, effect: str) -> Finding:
        """Return the finding of an effect.

        Raises
        ------
        KeyError
            When the profile does not test that effect.
        """
        return {f.effect: f for f in self.findings}[effect]


def profile_evidence(
    recording: Recording, rings: RingSamples, probe: Probe, context: Context
) -> ProfileEvidence:
    """Test every effect that the line's light can show.

    Raises
    ------
    UnusableError
        When too few frames are lit by the laser alone, or the ring is never steady for long enough.
    """
    with warnings.catch_warnings():
        # Where frames and sectors have no line, all values and their median are NaN.
        warnings.simplefilter("ignore", RuntimeWarning)
        return _examined(recording, rings, probe, context)


def _examined(recording: Recording, rings: RingSamples, probe: Probe, context: Context) -> ProfileEvidence:
    profiles = measure_profiles(recording, rings)
    if not len(profiles.row):
        raise UnusableError(
            "diagnose", "no frame shows the line alone", hint="record frames with the LEDs off"
        )
    geometry = line_geometry(
        rings, profiles.row, profiles.time_s, profiles.azimuth_rad, profiles.clipped, probe
    )
    cells = make_cells(profiles, geometry)
    if len(cells.frames) < _LEAST_BLOCKS:
        raise UnusableError(
            "diagnose", f"only {len(cells.frames)} stretches of frames show the line alone and steady",
            limit=f"at least {_LEAST_BLOCKS}", hint="record frames with the LEDs off",
        )  # fmt: skip
    tests = _tests(rings, profiles, geometry, probe)
    shown = [test(cells) for test in tests]
    findings: tuple[Finding, ...] = (
        *(f for each in shown for f in each),
        vignetting_finding(recording, probe),
        stray_finding(profiles, geometry),
        pattern_finding(profiles, recording.source.image_size),
    )
    telling = [test for test, each in zip(tests, shown, strict=True) if any(f.found for f in each)]
    findings = with_halves(_spot_or_pixels(findings), telling, cells)
    context.report("effects found in the line's profile", sum(f.found for f in findings), "effects")
    return ProfileEvidence(recording.name, profiles.frame, findings, _conditions(profiles, geometry))


def _conditions(profiles: LineProfiles, geometry: LineGeometry) -> tuple[Condition, ...]:
    """Return the properties of the line's pictures."""
    width, height = float(np.nanmedian(geometry.width_px)), float(np.nanmedian(geometry.height))
    return (
        Condition("line's median width (1 σ, px)", width, *_COUNTED_WIDTH_PX),
        Condition("line's median height (grey levels)", height, *_COUNTED_HEIGHT),
        Condition("share of the line that clips", float(np.nanmean(profiles.clipped)), *_COUNTED_CLIPPED),
    )


def _spot_or_pixels(findings: tuple[Finding, ...]) -> tuple[Finding, ...]:
    """Return the findings, without spot and pixel gains as mutual rivals where the other one was not found.

    Gains of single pixels would be visible in their own test long before they made a dip in all frames.
    """
    by_name = {f.effect: f for f in findings}

    def settled(found: Finding) -> Finding:
        rival = by_name.get(_SPOT_OR_PIXELS.get(found.effect, ""))
        if rival is None or rival.found or not rival.sizes:
            return found
        return replace(found, alike=tuple(n for n in found.alike if n != rival.effect))

    return tuple(settled(f) for f in findings)


def _tests(
    rings: RingSamples, profiles: LineProfiles, geometry: LineGeometry, probe: Probe
) -> tuple[Test, ...]:
    """Return the tests, each of which takes any cells of the recording."""
    return (
        lambda cells: shape_findings(cells, geometry, probe),
        lambda cells: (blur_finding(cells, geometry, probe),),
        lambda cells: (dust_finding(rings, profiles, cells),),
        lambda cells: (decentre_finding(geometry, cells),),
        lambda cells: (clip_finding(profiles, cells, geometry),),
        lambda cells: (locking_finding(rings, profiles, cells),),
    )
