"""Ring extraction compared with Steger's method and the centre of gravity: accuracy over noise, and rate."""

from __future__ import annotations

from functools import partial

import numpy as np
from matplotlib.axes import Axes

from pipeline.recording.base import Illumination
from stages.rings.sectors import cut_sectors
from tests.benchmarks import bench_rings as bench
from tests.benchmarks.page.charts import COLOURS, bars, chart
from tests.benchmarks.page.inputs import Inputs
from tests.benchmarks.page.section import Method, Quantity, Section

_NAMES = ("boresight, matched fit", "Steger, ridge of the smoothed image", "centre of gravity over 3 σ")
_FRAMES, _AZIMUTHS = 20, 1440
_SETUP = (
    "Accuracy: synthetic rings of known place (720 samples, line 1.2 px wide, 90 grey levels high), read and "
    "shot noise as listed, rounded to 8 bits; four images a level. All three are told where to look, to a "
    "pixel. Steger's smoothing also averages along the line, over neighbouring samples: in strong noise it "
    "may fall below the bound of a single sample, at the price of neighbours that err together.",
    "Rate: rings a second of processor time over decoded frames of the recording at 1440 samples a ring. "
    "Boresight's time includes finding the ring, judging each sample and learning the noise; that of the "
    "other two is just their measurement along rays, the ring's place given to them.",
)


def section(inputs: Inputs) -> Section:
    """Return the comparison."""
    levels = bench.accuracies()
    alone, whole, frames = bench.rates(inputs.folder)
    rings = len(inputs.recording.frames.of(Illumination.LASER, Illumination.BOTH))
    per_ring = (rings / max(whole[1] - alone[1], 1e-9), *_other_rates(inputs))
    over_bound = np.array([[e / bound for e in errors] for _, _, bound, *errors in levels])
    shared = {
        "decoding_per_s": frames / alone[0],
        "with_decoding_per_s": frames / whole[0],
        "share_of_decoding": alone[0] / whole[0],
        "share_of_decoding_cpu": alone[1] / whole[1],
    }
    methods = tuple(
        Method(
            name,
            {
                "best_over_bound": float(over_bound[:, k].min()),
                "worst_over_bound": float(over_bound[:, k].max()),
            }
            | {"rings_per_cpu_s": float(per_ring[k])}
            | (shared if k == 0 else {}),
        )
        for k, name in enumerate(_NAMES)
    )
    return Section(
        "rings",
        "Ring extraction",
        (*_SETUP, _table(levels)),
        _QUANTITIES,
        methods,
        _charts(levels, per_ring),
        _WHY_BEHIND,
    )


_QUANTITIES = (
    Quantity("best_over_bound", "error over the Cramér–Rao bound, least"),
    Quantity("worst_over_bound", "largest"),
    Quantity("rings_per_cpu_s", "rings", "1/s of processor time", "more"),
    Quantity("decoding_per_s", "decoding alone", "frames/s", "more"),
    Quantity("with_decoding_per_s", "decoding and extraction", "frames/s", "more"),
    Quantity("share_of_decoding", "rate over decoding's, by the clock", better="more"),
    Quantity("share_of_decoding_cpu", "by processor time", better="more"),
)
_ALONG = "Steger's smoothing averages neighbouring samples, which then err together; ours stay independent."
_WHY_BEHIND = {
    "best_over_bound": _ALONG,
    "worst_over_bound": _ALONG,
    "rings_per_cpu_s": "The others are given the ring's place and only measure along rays.",
}


def _other_rates(inputs: Inputs) -> tuple[float, float]:
    """Return rings a second of processor time of Steger's method and of the centre of gravity."""
    frames = inputs.recording.frames.of(Illumination.LASER, Illumination.BOTH)[:_FRAMES]
    images = [image.copy() for _, image in inputs.recording.read(frames, "grey")]
    sectors = cut_sectors(inputs.recording.source.image_size, inputs.probe.camera.centre_px, _AZIMUTHS)
    ring = np.full(_AZIMUTHS, 0.25 * min(images[0].shape))
    measures = (bench.steger, partial(bench.centre_of_gravity, noise=1.0))
    spent = [bench.seconds(lambda m=m: [m(image, sectors, ring) for image in images])[1] for m in measures]
    return len(images) / spent[0], len(images) / spent[1]


def _table(levels: list[tuple[float, ...]]) -> str:
    rows = "; ".join(
        f"read {read:g}, shot {shot:g}: bound {bound:.4f}, " + " / ".join(f"{e:.4f}" for e in errors)
        for read, shot, bound, *errors in levels
    )
    return f"Errors in px, boresight / Steger / centre of gravity: {rows}."


def _charts(levels: list[tuple[float, ...]], per_ring: tuple[float, ...]) -> tuple[str, str]:
    def draw(axes: Axes) -> None:
        noise = [np.hypot(read, np.sqrt(shot * bench.AMPLITUDE)) for read, shot, *_ in levels]
        axes.loglog(noise, [level[2] for level in levels], "k--", label="Cramér–Rao bound of one sample")
        for k, name in enumerate(_NAMES):
            axes.loglog(noise, [level[3 + k] for level in levels], "o-", color=COLOURS[k], label=name)

    error = chart(draw, "Error of a ring sample", "noise at the line's peak, grey levels", "rms error, px")
    return error, bars(dict(zip(_NAMES, per_ring, strict=True)), "Rate", "rings a second of processor time")
