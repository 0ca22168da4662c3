"""Whether the σ that the whole wall shares is true over many instruments.

One recording, drawn probes and wheels. The instrument's error is the same in all samples of a recording: one
draw. The share of samples inside their intervals is therefore near 0 or near 100 % in most single recordings,
which cannot test that part of σ. Here probes are drawn about a calibrated one with the uncertainty that the
recording's own file states, and the encoder's readings are scaled by a draw of its stated uncertainty. Rings
and texture are measured once, in px; motion is adjusted again for each draw. The reference is the radius and
distance with the calibrated probe and the unchanged encoder: differences must be one stated σ, rms, and 95 %
of them within 1.96 σ.

usage: python -m tests.benchmarks.bench_stated_probe RUN RECORDING CALIBRATED [--draws N] [--first N]
[--understate F] [--right-wheel]

With ``--understate 3`` the files state a third of what was drawn, which must show. With ``--right-wheel`` the
readings are not scaled: the part of the radii's σ that is due to the wheel is then not used up.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipeline.geometry.axis import distance_along
from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import read_probe
from stages.accumulate.survey import RingsOnWall, survey_of
from stages.accumulate.systematic import calibration_spread
from stages.motion.measuring import measure_run
from stages.motion.parameters import MotionParameters
from stages.motion.rings import looking_at_wall
from stages.motion.trajectory import trajectory_of
from stages.motion.windows.measured_run import MeasuredRun
from stages.motion.windows.sliding_window import adjust_run
from tests.benchmarks.painted_rings import Background, background
from tests.quiet import quiet_context


def drawn(stated: Probe, centre: Probe, understate: float, random: np.random.Generator) -> Probe:
    """Return a probe drawn about ``centre``; ``stated`` understates the uncertainty by a factor."""
    directions = stated.principal_uncertainties()
    off = directions @ random.standard_normal(directions.shape[1])
    probe = stated.with_parameters(centre.parameters + off, stated.covariance / understate**2)
    return replace(probe, encoder_scale_sigma=stated.encoder_scale_sigma / understate)


@dataclass(frozen=True)
class Found:
    """Radius and distance, mm, that a run has measured, with the 1 σ of each due to the instrument."""

    radius_mm: float
    radius_sigma_mm: float
    way_mm: float
    way_sigma_mm: float

    def in_sigma(self, right: Found) -> tuple[float, float]:
        """Return how far radius and distance are from the right ones, in σ."""
        radius = (self.radius_mm - right.radius_mm) / self.radius_sigma_mm
        return radius, (self.way_mm - right.way_mm) / self.way_sigma_mm


def adjusted(back: Background, run: MeasuredRun) -> Found:
    """Adjust the motion and return the radius and distance found."""
    joined = adjust_run(run, MotionParameters(), lambda *_: None, lambda *_: None).joined
    motion = trajectory_of(joined, back.recording.frames, run.probe, run.encoder is not None)
    probe = run.probe.as_found_in(motion)
    survey = survey_of(RingsOnWall(probe, back.rings, back.points, motion))
    sigma = calibration_spread(probe, back.rings, motion, survey).sigma_mm
    way = np.ptp(distance_along(motion.axis, motion.T_pc))
    return Found(joined.radius_mm, float(np.median(sigma)), float(way), motion.distance_sigma_mm)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path)
    parser.add_argument("recording", type=Path)
    parser.add_argument("calibrated", type=Path)
    parser.add_argument("--draws", type=int, default=12)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--understate", type=float, default=1.0)
    parser.add_argument("--right-wheel", action="store_true")
    asked = parser.parse_args()
    back, stated = background(asked.run, asked.recording), read_probe(asked.recording / "probe.yaml")
    recording, centre = looking_at_wall(back.recording, back.rings, back.points), read_probe(asked.calibrated)
    run = measure_run(recording, stated, back.rings, back.points, MotionParameters(), quiet_context(0))
    encoder, right, rows = run.encoder, adjusted(back, replace(run, probe=centre)), []
    for draw in range(asked.first, asked.first + asked.draws):
        random = np.random.default_rng(draw)
        probe, wheel = drawn(stated, centre, asked.understate, random), random.standard_normal()
        if run.encoder is not None and not asked.right_wheel:
            off = 1 + wheel * stated.encoder_scale_sigma
            encoder = replace(run.encoder, distance_mm=run.encoder.distance_mm * off)
        found = adjusted(back, replace(run, probe=probe, encoder=encoder))
        rows.append(found.in_sigma(right))
        print(
            f"draw {draw}: radius {found.radius_mm - right.radius_mm:+.3f} mm ({rows[-1][0]:+.2f} σ of "
            f"{found.radius_sigma_mm:.3f}), way {found.way_mm - right.way_mm:+.3f} mm ({rows[-1][1]:+.2f} σ)",
            flush=True,
        )
    for name, z in zip(("radius", "way"), np.array(rows).T, strict=True):
        inside = 100 * np.mean(np.abs(z) < 1.96)
        print(f"{name}: {len(z)} draws, rms {np.sqrt(np.mean(z**2)):.2f} σ, {inside:.0f} % inside 1.96 σ")


if __name__ == "__main__":
    main()
