"""Ring extraction: speed against decoding alone, and accuracy against the Cramér–Rao bound.

usage: python -m tests.benchmarks.bench_rings [RECORDING]
"""

import sys
import time
from pathlib import Path

import cv2
import numpy as np

from pipeline.instrument.probe_file import read_probe
from pipeline.recording import open_recording
from stages.rings import RingParameters, extract_rings
from stages.rings.profile import Response, fit_line
from stages.rings.sectors import cut_sectors
from tests.quiet import quiet_context
from tests.ring_images import exposed, off_centre, ring_light

SIZE, CENTRE, AZIMUTHS, WIDTH, AMPLITUDE, BLACK = (640, 480), (318.7, 241.3), 720, 1.2, 90.0, 16.0
ROUNDS = 3
NOISES = ((0.7, 0.0), (1.0, 0.1), (2.0, 0.4), (4.0, 1.0), (8.0, 1.0))


def seconds(work):
    """Return the least wall and processor time of ``ROUNDS`` calls: that of an otherwise idle machine."""
    spent = []
    for _ in range(ROUNDS):
        start = np.array([time.perf_counter(), time.process_time()])
        work()
        spent.append([time.perf_counter(), time.process_time()] - start)
    return np.min(spent, axis=0)


def rates(folder):
    """Return seconds (wall, processor) of decoding alone, the same with extraction, and the frames."""
    recording = open_recording(folder)
    probe = read_probe(recording.probe_file)
    planes = "bgr" if "both" in recording.frames.illumination else "grey"

    def extract():
        extract_rings(recording, probe, RingParameters(), quiet_context())

    extract()
    alone = seconds(lambda: sum(1 for _ in recording.read(recording.frames.frame, planes)))
    return alone, seconds(extract), len(recording.frames.frame)


def speed(folder):
    alone, whole, frames = rates(folder)
    for clock, one, both in zip(("wall", "processor"), alone, whole, strict=True):
        print(f"{folder.name}, {clock} time: decoding alone {frames / one:.0f} frames/s, "
              f"with extraction {frames / both:.0f} frames/s, ratio {one / both:.2f}; "
              f"extraction's own share {both - one:.2f} s")  # fmt: skip


def resampled(image, sectors, truth):
    """Return distances (N,) and grey levels above black (A, N) along each ray about the ring."""
    x = np.arange(-6 * WIDTH, 6 * WIDTH, 0.2)
    rho = (truth[:, None] + x).astype(np.float32)
    u = sectors.centre_px[0] + rho * np.cos(sectors.azimuth_rad)[:, None]
    v = sectors.centre_px[1] + rho * np.sin(sectors.azimuth_rad)[:, None]
    grey = cv2.remap(image.astype(np.float32), u.astype(np.float32), v.astype(np.float32), cv2.INTER_CUBIC)
    return x, grey - BLACK


def centre_of_gravity(image, sectors, truth, noise):
    """Return the mean distance weighted by the light above three σ of the noise."""
    x, y = resampled(image, sectors, truth)
    weight = np.where(y > 3 * noise, y, 0.0)
    return weight @ x / np.maximum(weight.sum(1), 1e-9)


def steger(image, sectors, truth):
    """Return the ridge of the image smoothed by the line's own width, along the line's normal.

    Smoothing also averages along the line over neighbouring samples: in strong noise the error falls below
    the bound of a single sample, at the price of correlated neighbours.
    """
    x, y = resampled(cv2.GaussianBlur(image.astype(np.float32), (0, 0), WIDTH), sectors, truth)
    at = np.clip(np.argmax(y, 1), 1, len(x) - 2)
    left, top, right = (np.take_along_axis(y, (at + k)[:, None], 1)[:, 0] for k in (-1, 0, 1))
    return x[at] + 0.5 * (x[1] - x[0]) * (left - right) / np.minimum(left - 2 * top + right, -1e-9)


def bound(sectors, truth, read, shot):
    """Return the root mean square Cramér–Rao 1 σ with height, width and background unknown."""
    variance = []
    for a, r in enumerate(truth):
        x = sectors.radius_px[sectors.start[a] : sectors.start[a + 1]] - r
        x = x[np.abs(x) < 8]
        e = np.exp(-0.5 * (x / WIDTH) ** 2)
        weight = 1 / (read**2 + 1 / 12 + shot * AMPLITUDE * e)
        d = np.stack([AMPLITUDE * e * x / WIDTH**2, AMPLITUDE * e * (x / WIDTH) ** 2, e, np.ones_like(e)], 1)
        variance.append(np.linalg.inv(d.T @ (d * weight[:, None]))[0, 0])
    return np.sqrt(np.mean(variance))


def rms_errors(sectors, ring, truth, read, shot):
    """Return rms errors, px, of the matched fit, of Steger's method and of the centre of gravity."""
    rows = []
    for seed in range(4):
        light = ring_light(SIZE, CENTRE, ring, WIDTH, AMPLITUDE)
        image = exposed(light, np.random.default_rng(seed), read=read, shot=shot)
        fit = fit_line(image, sectors, truth, WIDTH, Response(BLACK, read**2 + 1 / 12, shot, 255.0))
        others = steger(image, sectors, truth), centre_of_gravity(image, sectors, truth, read)
        rows.append((fit.radius_px - truth, *others))
    return [float(np.sqrt(np.nanmean(np.square(r)))) for r in zip(*rows, strict=True)]


def accuracies():
    """Return, for each noise level, read noise, shot noise, the bound, and the three methods' errors, px."""
    sectors, ring = cut_sectors(SIZE, np.array(CENTRE), AZIMUTHS), off_centre(170.0, 2.0)
    truth = ring(sectors.azimuth_rad)
    return [
        (read, shot, float(bound(sectors, truth, read, shot)), *rms_errors(sectors, ring, truth, read, shot))
        for read, shot in NOISES
    ]


def accuracy():
    print("read  shot   bound  matched  ratio  Steger  centre of gravity   (rms error, px)")
    for read, shot, least, matched, ridge, gravity in accuracies():
        print(f"{read:4.1f}  {shot:4.1f}  {least:6.4f}  {matched:6.4f}  {matched / least:5.2f}  "
              f"{ridge:6.4f}  {gravity:6.4f}")  # fmt: skip


def main():
    default = Path(__file__).resolve().parents[2].parent / "shared" / "recordings" / "open-1-field"
    speed(Path(sys.argv[1]) if len(sys.argv) > 1 else default)
    accuracy()


if __name__ == "__main__":
    main()
