"""Every laser frame of a recording -> ring samples."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

import numpy as np
from pydantic import Field

from pipeline.artefacts import Byte, Float32, Int, RingSamples, RingValidity
from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.recording.base import Illumination, Recording
from pipeline.stage import Context, Parameters
from stages.rings.colour import discriminant_weights, excess_weights, mix
from stages.rings.noise import clipping_knee, dark_response, noise_response
from stages.rings.profile import ProfileFit, Response
from stages.rings.search import BAND_WIDTHS, Image
from stages.rings.sectors import Sectors, cut_sectors
from stages.rings.trace import RingTrace, trace_ring
from stages.rings.validity import mark_outliers, wander_px

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
    sectors = cut_sectors(recording.source.image_size, probe.camera.centre_px, parameters.azimuths)
    traces: dict[int, RingTrace | None] = {}
    for frame, trace in _traces(recording, probe, sectors):
        traces[frame] = _covered(trace, parameters.least_coverage)
        context.progress(len(traces), len(frames))
    if not any(traces.values()):
        raise UnusableError(
            "rings", "no laser ring was found in any frame", frames=frames.tolist(),
            hint="is the laser on, the probe inside the pipe, and the exposure long enough?",
        )  # fmt: skip
    samples = _samples(frames, sectors, traces)
    _report(context, samples)
    return samples


def _traces(recording: Recording, probe: Probe, sectors: Sectors) -> Iterator[tuple[int, RingTrace | None]]:
    yield from _laser_traces(recording, recording.frames.of(Illumination.LASER), sectors)
    yield from _lit_traces(recording, recording.frames.of(Illumination.BOTH), probe, sectors)


def _laser_traces(
    recording: Recording, frames: Int, sectors: Sectors
) -> Iterator[tuple[int, RingTrace | None]]:
    """Trace frames lit by the laser alone, in the luma plane."""
    if not len(frames):
        return
    response = _learn_response(recording, frames, sectors)
    before = None
    for frame, image in recording.read(frames, "grey"):
        trace = None if image is None else trace_ring(image, sectors, response, before)
        before = trace if _covered(trace, 0.5) else None
        yield frame, trace


def _lit_traces(
    recording: Recording, frames: Int, probe: Probe, sectors: Sectors
) -> Iterator[tuple[int, RingTrace | None]]:
    """Trace frames in which the wall is lit too, in the mixture of channels that shows the line best."""
    if not len(frames):
        return
    weights, before, response = excess_weights(probe.laser.wavelength_nm), None, None
    for frame, bgr in recording.read(frames, "bgr"):
        trace = None
        if bgr is not None:
            image = mix(bgr, weights)
            response = response or dark_response(image)
            trace = trace_ring(image, sectors, response, before)
        before = trace if _covered(trace, 0.5) else None
        if bgr is not None and before is not None:
            band = BAND_WIDTHS * before.width_px
            weights = _or(
                discriminant_weights(bgr, sectors, before.radius_everywhere(), before.width_px, band), weights
            )
            image = mix(bgr, weights)
            response = noise_response(image, sectors, before.fit, dark_response(image))
            trace = trace_ring(image, sectors, response, before)
        yield frame, trace


def _or(first, second):
    return second if first is None else first


def _learn_response(recording: Recording, frames: Int, sectors: Sectors) -> Response:
    """Learn noise and clipping level from the first frames that show a ring."""
    few = frames[:_LEARNING_FRAMES]
    response = Response(0.0, 1.0, 0.0, np.inf, 0.0)
    pairs = zip(_copies(recording, few, "grey"), _copies(recording, few, "bgr"), strict=True)
    for grey, bgr in pairs:
        if grey is None or bgr is None:
            continue
        response = dark_response(grey)
        trace = trace_ring(grey, sectors, response)
        if _covered(trace, 0.5) is None:
            continue
        assert trace is not None
        line = np.zeros(grey.shape, bool)
        near = (
            np.abs(sectors.radius_px - np.repeat(trace.radius_everywhere(), np.diff(sectors.start)))
            < trace.width_px
        )
        line.ravel()[sectors.pixel[near]] = True
        knee, beyond = clipping_knee(grey, bgr, line)
        response = response._replace(knee=knee, beyond=beyond)
        response = noise_response(grey, sectors, trace.fit, response)
        return response
    return response


def _copies(recording: Recording, frames: Int, planes):
    return [None if image is None else image.copy() for _, image in recording.read(frames, planes)]


def _covered(trace: RingTrace | None, least: float) -> RingTrace | None:
    return trace if trace is not None and trace.valid.mean() >= least else None


def _samples(frames: Int, sectors: Sectors, traces: dict[int, RingTrace | None]) -> RingSamples:
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
    wander = wander_px(values["radius_px"], values["sigma_px"], validity)
    values["sigma_px"] = np.hypot(values["sigma_px"], np.float32(wander))
    return RingSamples(frames, sectors.azimuth_rad, sectors.centre_px, **values, validity=validity)


def _report(context: Context, samples: RingSamples) -> None:
    for reason in RingValidity:
        name = (
            "ring samples valid"
            if reason is RingValidity.VALID
            else f"ring samples rejected: {reason.name.lower()}"
        )
        context.report(name, int((samples.validity == reason).sum()), "samples")
