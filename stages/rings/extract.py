"""Measures the laser line in every laser frame of a recording."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from pydantic import Field

from pipeline.arrays import Bool, Byte, Float, Image, Int
from pipeline.artefacts.measured import RingSamples, RingValidity
from pipeline.errors import UnusableError
from pipeline.geometry.image_places import ImagePlaces
from pipeline.instrument.probe import Probe
from pipeline.machine.scratch import Scratch
from pipeline.machine.stage import Context, Parameters
from pipeline.recording.base import Illumination, Recording
from pipeline.system.parallel import side_by_side
from stages.rings.behind_dirt import set_right
from stages.rings.expectation import warn_of_rings
from stages.rings.glints import SAYING_RINGS
from stages.rings.lattice import lattices_of, take_out, warn_of_lattices
from stages.rings.mixture import across_line, channel_of, excess_weights, line_weights, wall_weights
from stages.rings.noise import SURELY_UNCLIPPED, clip_level_of, noise_response
from stages.rings.picture import Mixture
from stages.rings.seam import seam_of, warn_of_seam
from stages.rings.sectors import Sectors, sectors_of
from stages.rings.trace import LOST, RingTrace, fitted_in, trace_ring
from stages.rings.validity import contradicted, off_laser_alone
from stages.rings.wander import Wander, wander_of

Images = Iterator[tuple[int, Image | None]]
Found = tuple[int, RingTrace | None]
_LEARNING_FRAMES = 4
# A mixture is learned at most so many times: of open-3 at crf 30 and half size, samples scatter by .65 px at
# first and by .36, .27 and .2 px after one, two and four rounds.
_ROUNDS = 4
_AT_ONCE = 512
# Parts of a recording that are traced side by side, on however many cores. Within each, a ring is searched
# around the one before it.
_PARTS = 2
# Clipped pixels are searched up to so many line widths on either side of the line. If the line lies within
# half a width of their middle, both of its flanks were fitted.
_CLIP_WIDTHS, _CLIP_STEP, _ASIDE_WIDTHS = 3.0, 0.5, 0.5
# If a larger share of them clips, the wall clips too, and the line is not seen.
_MOST_CLIPPED = 0.5


class RingParameters(Parameters):
    """Parameters of ring extraction."""

    azimuths: int = Field(1440, ge=90, le=14400, description="ring samples per frame")
    least_coverage: float = Field(
        0.05,
        ge=0.0,
        le=1.0,
        description="share of azimuths with a valid line below which a frame is rejected",
    )
    left_out: ImagePlaces = Field(
        (),
        description="dirty places of the image, each as u, v and radius, px; the line is left out there "
        "unless it moves with its ring; boresight run --twin takes them from a twin",
    )


def extract_rings(
    recording: Recording, probe: Probe, parameters: RingParameters, context: Context
) -> RingSamples:
    """Measure the laser line at every azimuth of every frame in which the laser is on.

    Raises
    ------
    UnusableError
        When the laser is on in no frame, or no frame shows a ring.
    """
    frames = recording.frames.of(Illumination.LASER, Illumination.BOTH)
    if not len(frames):
        raise UnusableError(
            "rings", "the laser is on in no frame", hint="check frames.csv, column illumination"
        )
    samples = _measured(recording, probe, frames, parameters, context)
    if parameters.left_out:
        samples = set_right(samples, parameters.left_out, context)
    _compare_rings(samples, np.isin(frames, recording.frames.of(Illumination.LASER)))
    lattices = lattices_of(samples)
    samples = take_out(lattices, samples)
    warn_of_lattices(lattices, context)
    wander = wander_of(_some(samples))
    typical = _typical(samples, wander)
    _report(context, samples, typical)
    size, is_gauge = recording.source.image_size, recording.kind == "gauge"
    warn_of_rings(samples, size, typical, is_gauge, context)
    warn_of_seam(seam_of(_some(samples)), context)
    np.hypot(samples.sigma_px, wander.at(samples.amplitude), out=samples.sigma_px, casting="same_kind")
    return samples


def _measured(
    recording: Recording, probe: Probe, frames: Int, parameters: RingParameters, context: Context
) -> RingSamples:
    """Return the rings of frames (F,) as each image alone shows them."""
    sectors = sectors_of(recording.source, probe.camera.centre_px, parameters.azimuths)
    samples, done = _empty(frames, sectors, context.scratch), itertools.count(1)

    def put(found: Iterable[Found]) -> int:
        """Store rings that were found in images, and return their number."""
        rings = 0
        for frame, trace in found:
            if trace is not None and trace.coverage >= parameters.least_coverage:
                _put(samples, int(np.searchsorted(frames, frame)), trace)
                rings += 1
            context.progress(next(done), len(frames))
        return rings

    lasers, both = _laser_traces(recording, sectors), _lit_traces(recording, probe, sectors)
    rings = sum(sum(side_by_side(put, parts)) for parts in (lasers, both))
    if not rings:
        raise UnusableError(
            "rings", "no laser ring was found in any frame", frames=frames.tolist(),
            hint="is the laser on, the probe inside the pipe, and the exposure long enough? Where LEDs are "
            "on, too, colour tells the line: switch them off with a monochrome camera or a white laser",
        )  # fmt: skip
    return samples


def _typical(samples: RingSamples, wander: Wander) -> float:
    """Return the wander, px, of a line of median height."""
    valid = samples.valid
    return float(wander.at(float(np.median(samples.amplitude[valid])))) if valid.any() else 0.0


def _laser_traces(recording: Recording, sectors: Sectors) -> list[Iterable[Found]]:
    """Return the traced parts of the frames lit by the laser alone, in the luma plane."""
    frames = recording.frames.of(Illumination.LASER)
    first = _first_trace(recording, frames[:_LEARNING_FRAMES], sectors)
    clip_level = np.inf if first is None else first.response.clip_level

    def traced(part: Int, trace: RingTrace | None) -> Iterator[Found]:
        for frame, image in recording.read(part, "grey"):
            trace = None if image is None else trace_ring(image, sectors, clip_level, trace)
            yield frame, trace

    return [traced(part, None if at else first) for at, part in enumerate(np.array_split(frames, _PARTS))]


def _lit_traces(recording: Recording, probe: Probe, sectors: Sectors) -> list[Iterable[Found]]:
    """Return the traced parts of the frames in which the wall is lit too."""
    parts = np.array_split(recording.frames.of(Illumination.BOTH), _PARTS)
    return [_in_mixture(recording.read(part, "bgr"), probe, sectors) for part in parts]


def _in_mixture(images: Images, probe: Probe, sectors: Sectors) -> Iterator[Found]:
    """Trace images in which the wall is lit too, in the mixture of channels that shows the line best.

    The line is then placed in the mixture in which it is displaced least.
    """
    weights, channel = excess_weights(probe.laser.wavelength_nm), channel_of(probe.laser.wavelength_nm)
    trace = None
    for frame, bgr in images:
        if bgr is None:
            yield frame, None
            continue
        before = trace
        if before is not None:
            image = Mixture(bgr, weights)
            trace = trace_ring(image, sectors, np.inf, before)
        if before is None or trace is None or trace.coverage < before.coverage - LOST:
            # Colours may have changed, so that weights learned from the pictures before hide the line.
            own = _first_weights(bgr, sectors, probe)
            alone = trace_ring(Mixture(bgr, own), sectors, np.inf)
            if trace is None or (alone is not None and alone.coverage > trace.coverage):
                weights, image, trace = own, Mixture(bgr, own), alone
        yield (
            frame,
            None if trace is None else _without_dips(_placed(trace, bgr, sectors), bgr, sectors, channel),
        )
        if trace is not None:
            weights = wall_weights(bgr, sectors, trace, weights)
            trace = replace(trace, response=noise_response(image, sectors, trace.fit, trace.response))


def _first_weights(bgr: Byte, sectors: Sectors, probe: Probe) -> Float:
    """Return weights learned from an image in which the ring is found by the laser's colour alone."""
    weights = excess_weights(probe.laser.wavelength_nm)
    trace = trace_ring(Mixture(bgr, weights), sectors, np.inf)
    return weights if trace is None else wall_weights(bgr, sectors, trace, weights)


def _placed(trace: RingTrace, bgr: Byte, sectors: Sectors) -> RingTrace:
    """Return a ring fitted in the mixture in which it is displaced least, if that shows it.

    The mixture is learned from the ring, and the ring placed in it shows a better one.
    """
    for _ in range(_ROUNDS):
        weights = line_weights(bgr, sectors, trace)
        anew = None if weights is None else fitted_in(Mixture(bgr, weights), trace, sectors)
        if anew is None:
            break
        trace = anew
    return trace


def _without_dips(trace: RingTrace, bgr: Byte, sectors: Sectors, channel: int) -> RingTrace:
    """Return a ring without the samples that do not lie in the middle of the clipped pixels.

    Where the laser's channel clips, the other channels rise further and the mixture has a dip at the
    brightest place of the line. On a bright wall the line would then be found beside its true place, which
    looks like deposits. The σ of the remaining samples is widened by the largest shift of the line's centre
    that the clipped pixels can cause.
    """
    across = np.arange(-_CLIP_WIDTHS, _CLIP_WIDTHS + _CLIP_STEP / 2, _CLIP_STEP)
    colours = across_line(bgr, sectors, np.nan_to_num(trace.fit.radius_px), across * trace.width_px)
    clips = colours[..., channel] > SURELY_UNCLIPPED * np.iinfo(bgr.dtype).max
    count = clips.sum(1)
    aside = np.abs(clips @ across) / np.maximum(count, 1)
    line = np.exp(-(across**2) / 2)
    pull = np.abs(clips @ (across * line)) / line.sum()
    lost = (aside > _ASIDE_WIDTHS) | (count > _MOST_CLIPPED * len(across))
    lost &= trace.validity == RingValidity.VALID
    fit = trace.fit._replace(sigma_px=np.hypot(trace.fit.sigma_px, pull * trace.width_px))
    return replace(trace, fit=fit, validity=np.where(lost, RingValidity.SATURATED, trace.validity))


def _first_trace(recording: Recording, frames: Int, sectors: Sectors) -> RingTrace | None:
    """Return the ring of the first of ``frames`` that shows one, with the grey level at which it clips."""
    for frame, grey in recording.read(frames, "grey"):
        trace = None if grey is None else trace_ring(grey, sectors, np.inf)
        _, bgr = (frame, None) if trace is None else next(recording.read([frame], "bgr"))
        if trace is None or grey is None or bgr is None:
            continue
        line = sectors.pixels_near(trace.radius_everywhere(), 0, trace.width_px)
        clips = trace.response._replace(clip_level=clip_level_of(grey, bgr, line))
        return replace(trace, response=noise_response(grey, sectors, trace.fit, clips))
    return None


def _empty(frames: Int, sectors: Sectors, scratch: Scratch) -> RingSamples:
    """Return storage for the rings of all frames, all samples rejected so far."""
    shape = (len(frames), len(sectors.azimuth_rad))
    radius, sigma, width, amplitude = (scratch.full(shape, np.nan, np.float32) for _ in range(4))
    validity = scratch.full(shape, RingValidity.FRAME_REJECTED, np.uint8)
    return RingSamples(
        frames, sectors.azimuth_rad, sectors.centre_px, radius, sigma, width, amplitude, validity
    )


def _put(samples: RingSamples, row: int, trace: RingTrace) -> None:
    samples.validity[row] = trace.validity
    for name in ("radius_px", "sigma_px", "width_px", "amplitude"):
        getattr(samples, name)[row] = getattr(trace.fit, name)


def _compare_rings(samples: RingSamples, alone: Bool) -> None:
    """Reject samples that their neighbours contradict, in place, some rings at a time.

    Each block is compared with the rings around it as they were found in the images, before any rejection.
    ``alone`` (F,) are the rings of pictures that the laser alone lights.
    """
    count = len(samples.frame)
    validity, sigma_px = samples.validity[:0], samples.sigma_px[:0]
    for first in range(0, count, _AT_ONCE):
        rows = slice(first, min(first + _AT_ONCE, count))
        wide = slice(max(first - SAYING_RINGS, 0), min(rows.stop + SAYING_RINGS, count))
        own = slice(first - wide.start, rows.stop - wide.start)
        found = replace(
            samples.some(wide),
            validity=np.concatenate([validity, samples.validity[wide.start + len(validity) : wide.stop]]),
            sigma_px=np.concatenate([sigma_px, samples.sigma_px[wide.start + len(sigma_px) : wide.stop]]),
        )
        found.validity[off_laser_alone(found, alone[wide])] = RingValidity.GHOST
        validity = found.validity[: own.stop][-SAYING_RINGS:]
        sigma_px = found.sigma_px[: own.stop][-SAYING_RINGS:]
        revised = contradicted(found)
        samples.validity[rows], samples.sigma_px[rows] = revised[0][own], revised[1][own]


def _some(samples: RingSamples) -> RingSamples:
    """Return some hundred of the rings, spread evenly, which are enough for statistics."""
    return samples.some(slice(None, None, max(len(samples.frame) // _AT_ONCE, 1)))


def _report(context: Context, samples: RingSamples, wander: float) -> None:
    context.report("line wander beyond noise", wander, "px")
    for reason in RingValidity:
        name = (
            "ring samples valid"
            if reason is RingValidity.VALID
            else f"ring samples rejected: {reason.name.lower()}"
        )
        context.report(name, int((samples.validity == reason).sum()), "samples")
