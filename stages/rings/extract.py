"""Every laser frame of a recording -> ring samples."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, islice

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from pipeline.artefacts import Float, Int, RingSamples, RingValidity
from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Illumination, Image, Recording
from pipeline.stage import Context, Parameters
from stages.rings.colour import discriminant_weights, excess_weights, mix
from stages.rings.noise import clip_level_of, noise_response
from stages.rings.sectors import Sectors, cut_sectors
from stages.rings.trace import RingTrace, trace_ring
from stages.rings.validity import mark_outliers, wander_px

Images = Iterator[tuple[int, Image | None]]
Found = tuple[int, RingTrace | None]
_LEARNING_FRAMES = 4


class RingParameters(Parameters):
    """Parameters of ring extraction."""

    azimuths: int = Field(1440, ge=90, le=14400, description="ring samples per frame")
    least_coverage: float = Field(
        0.05,
        ge=0.0,
        le=1.0,
        description="share of azimuths with a valid line below which a frame is rejected",
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
    # Decoding goes on in the background from here.
    lasers = recording.read(recording.frames.of(Illumination.LASER), "grey")
    both = recording.read(recording.frames.of(Illumination.BOTH), "bgr")
    sectors = cut_sectors(recording.source.image_size, probe.camera.centre_px, parameters.azimuths)
    found = chain(_laser_traces(lasers, recording, sectors), _lit_traces(both, probe, sectors))
    traces: dict[int, RingTrace] = {}
    for done, (frame, trace) in enumerate(found, 1):
        if trace is not None and trace.coverage >= parameters.least_coverage:
            traces[frame] = trace
        context.progress(done, len(frames))
    if not traces:
        raise UnusableError(
            "rings", "no laser ring was found in any frame", frames=frames.tolist(),
            hint="is the laser on, the probe inside the pipe, and the exposure long enough?",
        )  # fmt: skip
    samples = _samples(frames, sectors, traces)
    wander = wander_px(samples)
    _report(context, samples, wander)
    return replace(samples, sigma_px=np.hypot(samples.sigma_px, np.float32(wander)))


def _laser_traces(images: Images, recording: Recording, sectors: Sectors) -> Iterator[Found]:
    """Trace frames lit by the laser alone, in the luma plane."""
    first = [(frame, None if i is None else i.copy()) for frame, i in islice(images, _LEARNING_FRAMES)]
    trace = _first_trace(first, recording, sectors)
    clip_level = np.inf if trace is None else trace.response.clip_level
    for frame, image in chain(first, images):
        trace = None if image is None else trace_ring(image, sectors, clip_level, trace)
        yield frame, trace


def _lit_traces(images: Images, probe: Probe, sectors: Sectors) -> Iterator[Found]:
    """Trace frames in which the wall is lit too, in the mixture of channels that shows the line best."""
    weights, trace = excess_weights(probe.laser.wavelength_nm), None
    for frame, bgr in images:
        if bgr is None:
            yield frame, None
            continue
        if trace is None:
            weights = _first_weights(bgr, sectors, probe)
        image = mix(bgr, weights)
        trace = trace_ring(image, sectors, np.inf, trace)
        yield frame, trace
        if trace is not None:
            weights = discriminant_weights(bgr, sectors, trace, weights)
            trace = replace(trace, response=noise_response(image, sectors, trace.fit, trace.response))


def _first_weights(bgr: NDArray[np.uint8], sectors: Sectors, probe: Probe) -> Float:
    """Return weights learned from an image in which the ring is found by the laser's colour alone."""
    weights = excess_weights(probe.laser.wavelength_nm)
    trace = trace_ring(mix(bgr, weights), sectors, np.inf)
    return weights if trace is None else discriminant_weights(bgr, sectors, trace, weights)


def _first_trace(
    images: Sequence[tuple[int, Image | None]], recording: Recording, sectors: Sectors
) -> RingTrace | None:
    """Return the ring of the first of ``images`` that shows one, with the grey level at which it clips."""
    for frame, grey in images:
        trace = None if grey is None else trace_ring(grey, sectors, np.inf)
        _, bgr = (frame, None) if trace is None else next(recording.read([frame], "bgr"))
        if trace is None or grey is None or bgr is None:
            continue
        line = sectors.pixels_near(trace.radius_everywhere(), 0, trace.width_px)
        clips = trace.response._replace(clip_level=clip_level_of(grey, bgr, line))
        return replace(trace, response=noise_response(grey, sectors, trace.fit, clips))
    return None


def _samples(frames: Int, sectors: Sectors, traces: dict[int, RingTrace]) -> RingSamples:
    shape = (len(frames), len(sectors.azimuth_rad))
    values = {
        k: np.full(shape, np.nan, np.float32) for k in ("radius_px", "sigma_px", "width_px", "amplitude")
    }
    validity = np.full(shape, RingValidity.FRAME_REJECTED, np.uint8)
    for row, frame in enumerate(frames):
        trace = traces.get(int(frame))
        if trace is None:
            continue
        validity[row] = trace.validity
        for name, array in values.items():
            array[row] = getattr(trace.fit, name)
    validity = mark_outliers(values["radius_px"], values["sigma_px"], validity)
    return RingSamples(frames, sectors.azimuth_rad, sectors.centre_px, **values, validity=validity)


def _report(context: Context, samples: RingSamples, wander: float) -> None:
    context.report("line wander beyond noise", wander, "px")
    for reason in RingValidity:
        name = (
            "ring samples valid"
            if reason is RingValidity.VALID
            else f"ring samples rejected: {reason.name.lower()}"
        )
        context.report(name, int((samples.validity == reason).sum()), "samples")
