"""The recording simulated again with and without what was found: held-out rings of the gauge run.

The simulator and the diagnosis share no forward model, so that this is a second opinion on the laws.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.errors import InputError
from pipeline.geometry.axis import straight_axis
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context, Parameters, Stage
from pipeline.physics.catalogue import EFFECTS, effect
from pipeline.physics.effect import Course
from pipeline.recording.base import Recording
from pipeline.recording.checks import CheckedFrames
from pipeline.simulator.effects import switch_on
from pipeline.simulator.effects.switch import Switch
from pipeline.simulator.instrument import (
    LedRing,
    LineProfile,
    TrueCamera,
    TrueInstrument,
    TrueLaser,
    TrueSensor,
)
from pipeline.simulator.motion import Odometer, motion_through
from pipeline.simulator.scene import Rendering
from pipeline.simulator.sheet import room_mm
from pipeline.simulator.truth import SceneTruth
from pipeline.simulator.wall.grid import Wall, WallGrid
from stages.calibrate.gauge.geometry import gauge_of
from stages.diagnose.channels import Seen
from stages.diagnose.effects.courses import Coursed
from stages.diagnose.gauge.examine import Examined
from stages.diagnose.gauge.fit import Fit, fit
from stages.diagnose.gauge.run import GaugeRun, Term

_HELD_OUT = 12
_RELAXED, _UNHEARD = 1e-4, 1e-8
_NEAR = 2
_STEP_PX, _WAVES = 0.5, 8


@dataclass(frozen=True)
class Resimulated:
    """Measured less simulated rings in frames that had no say in poses or sizes.

    Attributes
    ----------
    frame : (M,) int
        Frame numbers.
    azimuth_rad : (M,)
        In the image.
    without_px, with_px : (M,)
        How much farther out the line is found than the simulation of the stated instrument, and of that
        with the effects, has it.
    floor_px : float
        R.m.s. of the measured rings about a smooth curve of their own: what no simulation can remove.
    switches : tuple of str
        What was switched on, as `boresight simulate` takes it.
    """

    frame: Int
    azimuth_rad: Float
    without_px: Float
    with_px: Float
    floor_px: float
    switches: tuple[str, ...]

    @property
    def rms_px(self) -> tuple[float, float]:
        """Without and with the effects."""
        before, after = (float(np.sqrt(np.mean(x**2))) for x in (self.without_px, self.with_px))
        return before, after


@dataclass(frozen=True)
class Resimulation:
    """The gauge run simulated again; None where nothing was found in it that the simulator has."""

    simulated: Resimulated | None


def resimulate(
    recording: Recording, frames: CheckedFrames, seen: Seen, *, parameters: Parameters, context: Context
) -> Resimulation:
    """Simulate held-out rings of a gauge run again, without and with what was found in it."""
    return Resimulation(_resimulated(frames.applied_to(recording), seen.geometry))


def _resimulated(gauge: Recording, examined: Examined | None) -> Resimulated | None:
    if examined is None or examined.best is None or not examined.best.fit.terms:
        return None
    run, start, terms = examined.searched.run, examined.searched.nothing.state, examined.best.fit.terms
    if any(not _switchable(t) for t in terms):
        return None
    frames = held_out(run)
    quiet = np.where(np.isin(run.rings.frame, frames), _UNHEARD, 1.0)
    relaxed = replace(run, ring_weight=_RELAXED * quiet * run.ring_weight)
    nothing = tuple(replace(t, amplitude=0 * t.amplitude) for t in terms)
    try:
        without, found = fit(relaxed, start, ()), fit(relaxed, start, nothing)
        return _compared(gauge, run, frames, without, found)
    except (np.linalg.LinAlgError, InputError):
        return None


RESIMULATION = Stage(
    "resimulation", "1", Parameters, resimulate, "held-out rings simulated with what was found in a gauge run"
)


def held_out(run: GaugeRun) -> Int:
    """Return ring frames (places), spread over the run, whose neighbours' fiducials place the probe."""
    seen = np.unique(run.edges.frame)
    rings = np.unique(run.rings.frame)
    placed = rings[np.abs(rings[:, None] - seen).min(1) <= _NEAR]
    pick = np.linspace(0, len(placed) - 1, min(_HELD_OUT, len(placed)))
    return np.asarray(placed[np.unique(pick.round().astype(int))])


def _compared(recording: Recording, run: GaugeRun, frames: Int, without: Fit, found: Fit) -> Resimulated:
    switches = tuple(_switch(t) for t in found.terms)
    plain = scene_of(recording, without)
    made = switch_on(scene_of(recording, found), switches)
    # Samples that the gauge's fit weighed down to a tenth lie off the bore (chosen).
    weight = run.ring_weight > 0.1 * np.median(run.ring_weight)
    use = np.isin(run.rings.frame, frames) & weight
    frame, uv, outward = run.rings.frame[use], run.rings.uv[use], run.rings.outward[use]
    off = [_off_px(scene, frame, uv, outward) for scene in (plain, made)]
    good = np.isfinite(off).all(0)
    azimuth = np.arctan2(outward[:, 1], outward[:, 0])
    return Resimulated(
        recording.frames.frame[frame[good]], azimuth[good], off[0][good], off[1][good],
        _floor(frame[good], azimuth[good], off[1][good]), tuple(s.text for s in switches),
    )  # fmt: skip


def _switchable(term: Term) -> bool:
    """Return whether the simulator has the effect, and all its quantities are known."""
    if term.model.law not in EFFECTS:
        return False
    known = term.model.quantities(term.shape, term.amplitude)
    return all(q.name in known for q in effect(term.model.law).quantities)


def _switch(term: Term) -> Switch:
    sizes = term.model.quantities(term.shape, term.amplitude)
    values = tuple(float(f"{sizes[q.name]:.5g}") for q in effect(term.model.law).quantities)
    if not isinstance(term.model, Coursed):
        return Switch(term.model.law, values)
    numbers = term.model.course(term.shape, term.amplitude).values()
    return Switch(term.model.law, values, Course(term.model.kind, tuple(float(f"{n:.5g}") for n in numbers)))


def scene_of(recording: Recording, found: Fit) -> SceneTruth:
    """Return the scene of a gauge run: its bores, the poses and the instrument of a fit, no effect."""
    return gauge_scene(recording, found.state.stated, found.state.probe, found.state.T_pc)


def _off_px(scene: SceneTruth, frame: Int, uv: Float, outward: Float) -> Float:
    """Return by how much measured points (M, 2) lie beyond the simulated line, px, to first order."""
    out = np.full(len(uv), np.nan)
    for number in np.unique(frame):
        here = frame == number
        room, beyond = (room_mm(scene, int(number), uv[here] + d * outward[here]) for d in (0.0, _STEP_PX))
        out[here] = _STEP_PX * room / (beyond - room)
    return out


def _floor(frame: Int, azimuth: Float, off_px: Float) -> float:
    """Return the r.m.s. of measured less simulated about a few waves of its own in each frame."""
    left: list[Float] = []
    for number in np.unique(frame):
        here = frame == number
        waves = np.outer(azimuth[here], np.arange(_WAVES + 1))
        design = np.concatenate([np.cos(waves), np.sin(waves[:, 1:])], 1)
        gap = off_px[here]
        rest = gap - design @ np.linalg.lstsq(design, gap, rcond=1e-6)[0]
        left.append(rest * np.sqrt(len(gap) / max(len(gap) - design.shape[1], 1)))
    return float(np.sqrt(np.mean(np.concatenate(left) ** 2)))


_BEYOND_MM, _STEP_MM, _COLUMNS = 300.0, 0.1, 16
"""The wall reaches so far beyond the way; its step is finer than the chamfer of a bore; a bore is round."""


def gauge_scene(recording: Recording, stated: Probe, probe: Probe, T_pc: Float) -> SceneTruth:
    """Return the scene of a gauge run without any effect.

    Parameters
    ----------
    recording : Recording
        Of a gauge with fiducials.
    stated, probe : Probe
        What probe.yaml says, and the instrument that is rendered.
    T_pc : (N, 4, 4)
        The camera's pose in every frame.
    """
    wall = _bores(recording, T_pc)
    laser = TrueLaser(probe.laser, profile=LineProfile(probe.laser.line_sigma_mm))
    return SceneTruth(
        name=recording.name, kind=recording.kind, seed=0, stated=stated,
        instrument=TrueInstrument(TrueCamera(probe.camera), laser, LedRing(), TrueSensor(), probe.shutter),
        wall=wall, facts=recording.pipe, motion=motion_through(T_pc, recording.frames.time_s, wall.axis),
        odometer=Odometer(), frames=recording.frames, frame_rate=recording.frame_rate,
        rendering=Rendering.model_validate({}),
    )  # fmt: skip


def _bores(recording: Recording, T_pc: Float) -> Wall:
    z = T_pc[:, 2, 3]
    ends = float(z.min()) - _BEYOND_MM, float(z.max()) + _BEYOND_MM
    grid = WallGrid(ends[0], _STEP_MM, round((ends[1] - ends[0]) / _STEP_MM) + 1, _COLUMNS)
    fiducials = recording.pipe.fiducials
    assert fiducials is not None
    gauge = gauge_of(recording.pipe, fiducials)
    radius = gauge.radius_mm[gauge.section(grid.distance_mm)]
    shape = np.repeat(radius[:, None], _COLUMNS, axis=1).astype(np.float32)
    plain = WallGrid(ends[0], ends[1] - ends[0], 2, _COLUMNS)
    albedo = np.full((2, _COLUMNS, 3), 0.5, np.float32)
    return Wall(straight_axis(*ends), grid, shape, plain, albedo)
