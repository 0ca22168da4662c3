"""The stage triangulate turns ring samples into wall points in C, each with its image noise."""

from __future__ import annotations

import numpy as np
from pydantic import Field
from scipy.ndimage import binary_propagation, median_filter

from pipeline.adjustment.circles import circles_through
from pipeline.adjustment.robust import robust_spreads
from pipeline.arrays import Bool, Float, Float32, Int
from pipeline.artefacts.findings import clock_of_azimuth
from pipeline.artefacts.measured import RingPoints, RingSamples, RingValidity
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context, Parameters, Stage
from pipeline.pages import notation
from pipeline.recording.base import PipeFacts, Recording
from pipeline.system.parallel import in_threads
from stages.triangulate.possible import (
    beyond_the_wall,
    farthest_wall_mm,
    judge_impossible,
    rings_at_an_end,
    warn_of_end,
)

# Frames a thread takes at a time.
_CHUNK_FRAMES = 16
# Rings of which the report's median is taken: a bound on time.
_REPORTED_RINGS = 500
# Standing water mirrors the line, whose image below the surface then lies outside the pipe. No oval pipe lies
# so far, in radii, outside its circle, and no branch over so much of the circle in so many of the rings
# (chosen).
_FAR_OUTSIDE, _WIDE, _MOST_RINGS = 0.25, 0.1, 0.5
# A sample beside a mirrored one still counts as wall up to so many spreads from the circle.
_BESIDE = 3.0
# Samples of a ring that are enough to fit its circle: a bound on time.
_ENOUGH = 180
# Samples of the running median: four on each side, so that a feature of five is kept.
_NEIGHBOURS = 9


class TriangulateParameters(Parameters):
    """Triangulation is exact; the parameters decide which samples cannot lie on the wall."""

    largest_departure: float = Field(
        0.2,
        gt=0,
        le=100,
        description="largest departure of a sample's distance from the camera's axis from the median of its "
        "nine neighbours, as a share of that median; beyond it are edges of texture taken for the line",
    )


def triangulate_rings(
    rings: RingSamples,
    probe: Probe,
    parameters: TriangulateParameters,
    context: Context,
    pipe: PipeFacts | None = None,
) -> RingPoints:
    """Intersect the ray of every valid ring sample with the laser sheet.

    Parameters
    ----------
    rings
        Ring samples, px.
    probe
        Camera and laser sheet.
    pipe
        The stated pipe; without it, wall may lie at any distance.

    Returns
    -------
    RingPoints
        mm in C; NaN where the sample is invalid, its ray misses the sheet, it is off the ring, or it cannot
        lie on the pipe's wall.

    Raises
    ------
    UnusableError
        When most samples lie farther away than the stated pipe is wide.
    """
    shape = rings.validity.shape
    farthest_mm = farthest_wall_mm(pipe)
    impossible = np.zeros(shape[0], np.int64)
    xyz, noise = (context.scratch.zeros((*shape, 3), np.float32) for _ in range(2))

    def place(frames: slice) -> Int:
        found = _triangulate_chunk(rings, frames, probe)
        hit = np.isfinite(found[0][..., 0])
        rho = np.hypot(*np.moveaxis(found[0][..., :2], -1, 0))
        beyond = beyond_the_wall(rho, farthest_mm)
        impossible[frames] = beyond.sum(1)
        rho[beyond] = np.nan
        apart = off_the_ring(rho, parameters.largest_departure)
        for whole, part in zip((xyz, noise), found, strict=True):
            part[apart | beyond] = np.nan
            whole[frames] = part
        placed = hit & ~apart & ~beyond
        return np.array([placed.sum(), (_valid(rings, frames) & ~hit).sum(), apart.sum()])

    chunks = [slice(a, a + _CHUNK_FRAMES) for a in range(0, len(rings.frame), _CHUNK_FRAMES)]
    counts = np.zeros(3, np.int64)
    for done, count in enumerate(in_threads(place, chunks, context.workers), 1):
        counts += count
        context.progress(done, len(chunks))
    judge_impossible(impossible, int(counts[[0, 2]].sum()), rings, farthest_mm, context)
    mirrored = outside_the_pipe(xyz)
    for whole in (xyz, noise):
        whole[mirrored] = np.nan
    _warn_of_mirrored(mirrored, rings, context)
    for end in rings_at_an_end(xyz):
        for whole in (xyz, noise):
            whole[end] = np.nan
        warn_of_end(rings.frame[end], context)
    _report(context, counts, noise)
    return RingPoints(rings.frame, rings.azimuth_rad, xyz, noise)


def off_the_ring(rho_mm: Float32, largest_departure: float) -> Bool:
    """Return where samples lie off the ring that their neighbours form.

    A dent, a step or a branch is wider than half of the nine neighbours and is kept. A narrower feature as
    deep as a fifth of the pipe's radius (the default) cannot be wall: no light would come out of such a hole.

    Parameters
    ----------
    rho_mm : (F, A)
        Distance from the camera's axis; NaN where there is no sample.
    largest_departure
        Largest difference from the median of the nine nearest samples along the ring, as a share of it.
    """
    out = np.zeros(rho_mm.shape, bool)
    for row, rho in zip(out, rho_mm, strict=True):
        there = np.flatnonzero(np.isfinite(rho))
        if there.size >= _NEIGHBOURS:
            ring = median_filter(rho[there], _NEIGHBOURS, mode="wrap")
            row[there] = np.abs(rho[there] - ring) > largest_departure * ring
    return out


def outside_the_pipe(xyz_c: Float32) -> Bool:
    """Return where points (F, A, 3) lie far outside the circle of their ring over a wide arc, in most rings.

    Marked too are the points beside them, up to the first that is as near to the circle as usual, and whole
    rings whose circle is as much too wide, since mirrored points have determined it.
    """
    out = np.zeros(xyz_c.shape[:2], bool)
    few = xyz_c[:, :: max(xyz_c.shape[1] // _ENOUGH, 1), :2]
    centre, radius = circles_through(few)
    off = _off_circle(few, centre[:, None], radius[:, None])
    far = off > _FAR_OUTSIDE * radius[:, None]
    wide = np.flatnonzero(far.mean(1) > _WIDE)
    if len(wide) <= _MOST_RINGS * len(xyz_c):
        return out
    limit = _BESIDE * robust_spreads(np.where(far, np.nan, off)[wide], axis=1)
    for row, most in zip(wide, limit, strict=True):
        off = _off_circle(xyz_c[row, :, :2], centre[row], radius[row])
        out[row] = _grown(off > _FAR_OUTSIDE * radius[row], ~(off < most))
    out[radius > (1 + _FAR_OUTSIDE) * np.nanmedian(radius)] = True
    return out


def _off_circle(xy: Float32, centre: Float, radius: Float) -> Float:
    return np.asarray(np.linalg.norm(xy - centre, axis=-1) - radius)


def _grown(seed: Bool, into: Bool) -> Bool:
    """Return ``seed`` (A,) and all of ``into`` (A,) that is connected to it around the circle."""
    twice = binary_propagation(np.tile(seed, 2), mask=np.tile(into, 2))
    return np.asarray(twice[: len(seed)] | twice[len(seed) :])


def _warn_of_mirrored(mirrored: Bool, rings: RingSamples, context: Context) -> None:
    if mirrored.any():
        where = np.flatnonzero(mirrored.any(1))
        context.warn(
            f"in {len(where)} of {len(mirrored)} rings {100 * mirrored[where].mean():.0f} % of the line lies "
            f"far outside the circle of the rest, about {_middle_clock(mirrored, rings)} in the picture: "
            "standing water or a shiny wall mirrors it, the pipe is open there, or the pictures were cropped "
            "or scaled. It is not taken for wall, and nothing is measured there. What to do: drain the pipe, "
            "or judge what lies above the water alone; see that the pictures are whole"
        )


def _middle_clock(mirrored: Bool, rings: RingSamples) -> str:
    middle = np.angle(np.sum(mirrored.sum(0) * np.exp(1j * rings.azimuth_rad)))
    return notation.clock(float(clock_of_azimuth(middle)))


def _triangulate_chunk(rings: RingSamples, frames: slice, probe: Probe) -> tuple[Float32, Float32]:
    """Return points and noise directions (F, A, 3) of some frames."""
    usable = _valid(rings, frames)
    direction = np.stack([np.cos(rings.azimuth_rad), np.sin(rings.azimuth_rad)], -1)
    directions = np.broadcast_to(direction, (*usable.shape, 2))[usable]
    uv = rings.centre_px + rings.radius_px[frames][usable].astype(float)[:, None] * directions
    by_pixel = probe.triangulate_jacobian(uv)[0]
    sigma = rings.sigma_px[frames][usable].astype(float)
    noise = np.einsum("nij,nj->ni", by_pixel, directions) * sigma[:, None]
    return _spread(probe.triangulate(uv), usable), _spread(noise, usable)


def _spread(values: Float, where: Bool) -> Float32:
    """Put rows of ``values`` (N, K) where ``where`` (F, A) is true, NaN elsewhere."""
    out = np.full((*where.shape, values.shape[-1]), np.nan, np.float32)
    out[where] = values
    return out


def _valid(rings: RingSamples, frames: slice) -> Bool:
    return np.asarray(rings.validity[frames] == RingValidity.VALID)


def _report(context: Context, counts: Int, noise: Float32) -> None:
    placed, missed, off = counts.tolist()
    context.report("points triangulated", placed, "points")
    context.report("ring samples that miss the laser sheet", missed, "samples")
    context.report("rejected: far off the ring beside them", off, "samples")
    # The median of some hundred rings is close enough to that of all.
    some = noise[:: max(len(noise) // _REPORTED_RINGS, 1)]
    length = np.linalg.norm(some[np.isfinite(some[..., 0])], axis=-1)
    if length.size:
        context.report("median point noise", float(np.median(length)), "mm")


def _triangulated(
    recording: Recording,
    rings: RingSamples,
    probe: Probe,
    parameters: TriangulateParameters,
    context: Context,
) -> RingPoints:
    return triangulate_rings(rings, probe, parameters, context, recording.pipe)


TRIANGULATE = Stage(
    "triangulate",
    "6",
    TriangulateParameters,
    _triangulated,
    "ring samples and instrument to wall points with their noise",
)
