"""Defects inserted into the rings of a finished run, where the run places each sample."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from pipeline.arrays import Float
from pipeline.artefacts.findings import Defects
from pipeline.artefacts.measured import RingPoints, RingSamples, Trajectory, Wall, WallTexture
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context
from pipeline.recording.base import Recording
from pipeline.review.run_files import RunFiles
from stages.accumulate import AccumulateParameters, accumulate_wall
from stages.accumulate.survey import wall_samples
from stages.triangulate import TriangulateParameters, triangulate_rings
from tests.benchmarks.true_wall import TrueWall, true_wall
from tests.quiet import quiet_context

_KINDS = ("pit", "corrosion", "gouge", "groove", "deposit", "ridge", "dent")
# A slim round defect at the limit of detection, into the wall or inward.
AT_LIMIT = "at the limit"
_INWARD = ("deposit", "ridge", "dent")
_DEPTH_MM, _SIZE_MM = (0.12, 3.0), (1.5, 22.0)
# Free wall between two inserted defects, and from the recording's own: as far as a finding may extend.
_APART_MM, _MOST = 16.0, 14


@dataclass(frozen=True)
class Painted:
    """A defect: place on the run's own wall, size, sign times depth, and its rotation, rad."""

    kind: str
    distance_mm: float
    azimuth_rad: float
    length_mm: float
    width_mm: float
    depth_mm: float
    turn_rad: float

    @property
    def reach_mm(self) -> float:
        """Half of the larger size."""
        return max(self.length_mm, self.width_mm) / 2

    def relief(self, distance: Float, azimuth: Float, radius: float) -> Float:
        """Return the change of radius (...) at places (...)."""
        s = distance - self.distance_mm
        q = radius * ((azimuth - self.azimuth_rad + np.pi) % (2 * np.pi) - np.pi)
        c, d = np.cos(self.turn_rad), np.sin(self.turn_rad)
        x, y = (c * s + d * q) / (self.length_mm / 2), (c * q - d * s) / (self.width_mm / 2)
        rho2 = x * x + y * y
        if self.kind in ("dent", AT_LIMIT):
            form = np.exp(-((1.5**2) * rho2))
        elif self.kind in ("deposit", "corrosion"):
            bumps = 1 + 0.15 * np.sin(5 * x + self.distance_mm) * np.cos(4 * y + self.azimuth_rad)
            form = np.clip(1 - rho2**2, 0, None) * bumps
        else:
            form = np.sqrt(np.clip(1 - rho2, 0, None))
        return np.asarray(self.depth_mm * form)


@dataclass(frozen=True)
class Background:
    """A finished run, its own defects (distance, azimuth, reach), and the true relief of its wall."""

    name: str
    recording: Recording
    probe: Probe
    rings: RingSamples
    points: RingPoints
    motion: Trajectory
    photo: WallTexture
    own: Float
    true: TrueWall | None

    def every(self, which: slice) -> Background:
        """Return the background with some of its rings only."""
        rings, points = (_rows(x, which, len(self.rings.frame)) for x in (self.rings, self.points))
        return replace(self, rings=rings, points=points)


def _rows(artefact, which, count):  # type: ignore[no-untyped-def]
    """Return an artefact with some of its rings only."""
    values = {f.name: getattr(artefact, f.name) for f in fields(artefact) if f.name != "azimuth_rad"}
    of_rings = {n: v for n, v in values.items() if isinstance(v, np.ndarray) and len(v) == count}
    return replace(artefact, **{n: v[which] for n, v in of_rings.items()})


def background(run: Path, truth: Path) -> Background:
    """Read a run and the truth of its recording: its own defects, and its relief where that is known."""
    files = RunFiles(run.resolve())
    motion, rings, probe = files.artefact(Trajectory), files.artefact(RingSamples), files.probe()
    read = json.loads((truth / "truth.json").read_text("utf-8"))
    shift, turn = _placed_in_truth(read, motion)
    known = (truth / "truth_wall.npz").stat().st_size > 0
    wall = true_wall(truth) if known else None
    if wall is not None:
        wall = replace(wall, distance_mm=wall.distance_mm + shift, azimuth_rad=wall.azimuth_rad + turn)
    points = triangulate_rings(rings, probe, TriangulateParameters(), quiet_context())
    name = run.parent.name if run.name == "run" else run.name
    photo, own = files.artefact(WallTexture), _own_defects(read, shift, turn)
    return Background(name, files.recording(), probe, rings, points, motion, photo, own, wall)


def _placed_in_truth(truth, motion: Trajectory) -> tuple[float, float]:  # type: ignore[no-untyped-def]
    """Return distance and azimuth in the run's pipe frame less those in the true one."""
    T_true, T_pc = np.array(truth["camera_pose_in_pipe"])[motion.frame], motion.T_pc
    roll = [np.arctan2(T[:, 1, 0], T[:, 0, 0]) for T in (T_pc, T_true)]
    turn = float(np.angle(np.exp(1j * (roll[0] - roll[1])).mean()))
    return float(np.median(T_pc[:, 2, 3] - T_true[:, 2, 3])), turn


def _own_defects(truth, shift: float, turn: float) -> Float:  # type: ignore[no-untyped-def]
    """Return distance and azimuth in the run's pipe frame, and reach along and around, of own defects."""
    rows = []
    for d in truth["defects"]:
        long = d["length"] if d["kind"] in ("gouge", "crack") else 0.0
        around = np.inf if d["kind"] in ("weld", "joint") else max(d["width"], long) / 2
        rows.append((d["z"] + shift, np.radians(d["azimuth_deg"]) + turn, d["length"] / 2, around))
    return np.array(rows).reshape(-1, 4)


Drawing = Callable[[tuple[float, float], np.random.Generator], "Painted | None"]


def drawn(
    bg: Background,
    radius: float,
    span: tuple[float, float],
    random: np.random.Generator,
    kind: Drawing | None = None,
) -> list[Painted]:
    """Draw defects that are clear of each other and of the recording's own."""
    out: list[Painted] = []
    for _ in range(300):
        new = (kind or _one)(span, random)
        if new is None:
            continue
        taken = [*bg.own, *((p.distance_mm, p.azimuth_rad, *(2 * [p.reach_mm])) for p in out)]
        if all(_clear(new, *place, radius) for place in taken) and len(out) < _MOST:
            out.append(new)
    return out


def at_limit(found: Defects, by_size: float, by_depth: float) -> Drawing:
    """Return a drawing of defects at the limit of detection, None where there is none; both multiplied."""

    def one(span: tuple[float, float], random: np.random.Generator) -> Painted | None:
        s, psi, sign = random.uniform(*span), random.uniform(-np.pi, np.pi), random.choice([-1.0, 1.0])
        limit = found.limit_at(s)
        if limit is None or not limit.from_mm < s < limit.to_mm or not np.isfinite(limit.depth_mm):
            return None
        size = by_size * limit.size_mm
        return Painted(AT_LIMIT, s, psi, size, size, sign * by_depth * limit.depth_mm, 0.0)

    return one


def _one(span: tuple[float, float], random: np.random.Generator) -> Painted:
    kind, s, psi = str(random.choice(_KINDS)), random.uniform(*span), random.uniform(-np.pi, np.pi)
    length, width = np.exp(random.uniform(*np.log(_SIZE_MM), 2))
    if kind in ("gouge", "groove", "ridge"):
        length, width = max(length, 6.0), random.uniform(1.0, 3.0)
    depth = min(float(np.exp(random.uniform(*np.log(_DEPTH_MM)))), 0.4 * min(length, width))
    signed = -depth if kind in _INWARD else depth
    return Painted(kind, s, psi, length, width, signed, random.uniform(0, np.pi))


def _clear(new: Painted, s: float, psi: float, along: float, around: float, radius: float) -> bool:
    """Return whether a drawn defect is clear of one that reaches so far along and around."""
    aside = radius * abs(turned(new.azimuth_rad - psi)) if np.isfinite(around) else 0.0
    return bool(
        abs(new.distance_mm - s) > along + new.reach_mm + _APART_MM
        or aside > (around if np.isfinite(around) else 0.0) + new.reach_mm + _APART_MM
    )


def turned(angle: float) -> float:
    """Return an angle wrapped into −π … π."""
    return float((angle + np.pi) % (2 * np.pi) - np.pi)


def painted_rings(bg: Background, defects: Sequence[Painted]) -> RingSamples:
    """Return the rings with the defects in them: every sample is moved along its ray of the image."""
    rows = np.arange(len(bg.rings.frame))
    probe = bg.probe.as_found_in(bg.motion)
    here = wall_samples(probe, bg.rings, bg.points, bg.motion, rows)
    beside = replace(bg.rings, radius_px=bg.rings.radius_px + np.float32(0.5))
    slope = (wall_samples(probe, beside, bg.points, bg.motion, rows).radius_mm - here.radius_mm) / 0.5
    radius = float(np.nanmedian(here.radius_mm[here.valid]))
    change = np.zeros_like(slope)
    for d in defects:
        change += d.relief(here.distance_mm, here.azimuth_rad, radius)
    moved = np.where(here.valid & (change != 0), change / slope, 0.0)
    return replace(bg.rings, radius_px=bg.rings.radius_px + moved.astype(np.float32))


def walled(bg: Background, rings: RingSamples, context: Context) -> Wall:
    """Return the wall accumulated from these rings."""
    parameters = AccumulateParameters.model_validate({})
    return accumulate_wall(bg.probe, rings, bg.points, bg.motion, parameters, context)
