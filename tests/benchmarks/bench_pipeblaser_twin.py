"""A real probe's ring pictures beside the same pictures, re-rendered. usage: bench_pipeblaser_twin OUT

Sixteen single frames of one smooth pipe, without texture, motion or photo: what can be modelled is the line's
profile, the background and the noise. The profile measured in every other frame is tested on the frames
between them. The noise is estimated from differences along the line, independent of the profile. Brightness
and background of each frame's line are fitted in that frame, in blocks of 1.5°. Writes recorded | re-rendered
| z of the worst frame into OUT, maps of z of all frames (z.png: grey is none, white +8, black −8), and prints
which kinds of residual remain beyond the noise: each kind is predicted from other pixels than those it is
tested on.

Differences of pixels two apart give the white noise. Those ten apart, beyond a block of the codec (these
pictures were JPEGs: steps of the luma's coefficients 8 6 6 7 7 8, quality 75) and beyond grains of speckle,
give all noise. The difference of both is noise that neighbours share.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from scipy.optimize import nnls

from pipeline.arrays import Bool, Float, Float32, Int
from pipeline.artefacts.measured import RingValidity
from stages.rings.mixture import excess_weights
from stages.rings.picture import Mixture
from stages.rings.sectors import cut_sectors
from stages.rings.trace import trace_ring
from stages.twin.line_blocks import BlockLight, LineBlocks, light_of
from tests.shared_data import shared

RED, RED_NM, WHITE = 2, 650.0, 250.0
WIDE = 6.0
"""Distances from the line, in its widths to each side, within which residuals are examined."""
BLOCKS, HALF_PX, BROAD_PX, BINS = 240, 12.0, 8.0, 24
CENTRE = (0.445, 0.524)
WHITE_PX, APART_PX, ASIDE, FEWEST = 2, 10, 0.04, 30
"""Distances of the pixels whose differences give the noise, both even, for the camera's mosaic.

Then the tangent of the largest angle between line and row or column, and the fewest pixels of a bin.
"""


@dataclass(frozen=True)
class RealFrame:
    """A picture's red channel (H, W), its background away from the line, and its line in blocks."""

    grey: Float32
    ground: Float32
    off_line: Bool
    blocks: LineBlocks
    row: Int
    column: Int


def real_frame(file: Path) -> RealFrame:
    """Return a picture with its traced ring."""
    image = cv2.imread(str(file))
    assert image is not None
    image[:, -2:] = 0
    size = (image.shape[1], image.shape[0])
    sectors = cut_sectors(size, (CENTRE[0] * size[0], CENTRE[1] * size[1]), 1440)
    trace = trace_ring(Mixture(image, excess_weights(RED_NM)), sectors, 255.0)
    assert trace is not None, file.name
    radius = np.where(trace.validity == RingValidity.VALID, trace.fit.radius_px, np.nan)
    by_block = radius.reshape(BLOCKS, -1)
    seen = np.isfinite(by_block).sum(1) >= by_block.shape[1] // 2
    ring = np.where(seen, np.nanmedian(np.where(seen[:, None], by_block, 0.0), 1), np.nan)
    v, u = np.mgrid[0 : size[1], 0 : size[0]]
    away = np.stack([u, v], -1) - sectors.centre_px
    phi, rho = np.arctan2(away[..., 1], away[..., 0]), np.hypot(away[..., 0], away[..., 1])
    cell = ((phi + np.pi) / (2 * np.pi) * BLOCKS).astype(int) % BLOCKS
    own = sectors.azimuth_rad[np.isfinite(radius)], radius[np.isfinite(radius)]
    beyond = rho - np.interp(phi, *own, period=2 * np.pi)
    near = (np.abs(beyond) < HALF_PX) & seen[cell]
    row, column = np.nonzero(near)
    number = np.cumsum(seen) - 1
    grey = image[..., RED].astype(np.float32)
    count = int(seen.sum())
    blocks = LineBlocks(
        np.zeros(1, np.int64), np.zeros(count, np.int64), np.flatnonzero(seen) * 2 * np.pi / BLOCKS - np.pi,
        ring[seen], np.full(count, float(trace.width_px)), number[cell[near]], beyond[near],
        grey[near].astype(float), np.array(sectors.centre_px), WHITE,
    )  # fmt: skip
    off = (np.abs(beyond) > 2 * HALF_PX) & (rho < 0.49 * size[1])
    weight = cv2.GaussianBlur(off.astype(np.float32), (0, 0), BROAD_PX)
    ground = cv2.GaussianBlur(np.where(off, grey, np.float32(0)), (0, 0), BROAD_PX) / np.maximum(weight, 1e-3)
    return RealFrame(grey, ground, off, blocks, row, column)


def rendered(frame: RealFrame, light: BlockLight) -> tuple[Float, Float]:
    """Return grey levels (N,) of the pixels about the line, and the part of them that is the line's."""
    b = frame.blocks
    x = b.offset_px / b.width_px[b.block]
    shape = np.interp(x, light.x, light.profile, left=0.0, right=0.0)
    free = ~b.clipped
    w, p, pp, g, pg = (b.total(free * v) for v in (np.ones_like(x), shape, shape**2, b.grey, shape * b.grey))
    height = np.maximum((pg * w - p * g) / np.maximum(pp * w - p**2, 1e-9), 0.0)
    ground = (g - height * p) / np.maximum(w, 1)
    line = height[b.block] * shape
    return ground[b.block] + line, line


def noise_of(frames: list[RealFrame], apart_px: int) -> Float:
    """Return variances: of dark pixels, per grey level, and relative to the line's square (speckle).

    They are estimated from second differences along the line, where it runs along rows or columns of the
    picture, so that its profile and light that changes slowly have no influence.
    """
    each = [_along_line(f, apart_px) for f in frames]
    level, line, square = (np.concatenate(p) for p in zip(*each, strict=True))
    cell = np.searchsorted(np.quantile(level, np.linspace(0, 1, BINS + 1)[1:-1]), level)
    count = np.bincount(cell, minlength=BINS)
    parts = [np.ones_like(level), np.maximum(level, 0.0), line**2, square]
    mean = np.stack([np.bincount(cell, p, BINS) for p in parts], 1)[count > FEWEST]
    mean /= count[count > FEWEST, None]
    return np.asarray(nnls(mean[:, :3] / np.maximum(mean[:, 3:], 1 / 12), np.ones(len(mean)))[0])


def _along_line(frame: RealFrame, apart_px: int) -> tuple[Float, Float, Float]:
    """Return level, line's part and squared noise (N,) of pixels where the line is parallel to an axis."""
    u, v = frame.column - frame.blocks.centre_px[0], frame.row - frame.blocks.centre_px[1]
    found = []
    for across, along, step in ((u, v, (apart_px, 0)), (v, u, (0, apart_px))):
        use = np.abs(along) < ASIDE * np.abs(across)
        row, column = frame.row[use], frame.column[use]
        three = np.stack([frame.grey[row + k * step[0], column + k * step[1]] for k in (-1, 0, 1)]).astype(
            float
        )
        three = three[:, three.max(0) < WHITE]
        found.append((three, np.sqrt(1 / 6) * (three[0] - 2 * three[1] + three[2])))
    level = np.concatenate([t.mean(0) for t, _ in found])
    dark = float(np.median(frame.ground[frame.row, frame.column]))
    return level, np.maximum(level - dark, 0.0), np.concatenate([d for _, d in found]) ** 2


def variance_of(noise: Float, level: Float, line: Float) -> Float:
    """Return the variance (N,) of pixels, at least that of rounding."""
    return np.asarray(np.maximum(noise[0] + noise[1] * np.maximum(level, 0) + noise[2] * line**2, 1 / 12))


def main(out: Path) -> None:
    """Print profile, noise and χ² of frames that were not used for them; write the worst frame."""
    files = sorted((shared() / "real" / "pipeblaser_cmu" / "rings_v1").glob("*.png"))
    frames = [real_frame(f) for f in files]
    left: dict[int, Float] = {}
    chi2 = np.zeros((4, len(frames)))
    for half in (0, 1):
        learned = frames[half::2]
        lights = [light_of(f.blocks) for f in learned]
        profile = np.median([light.profile for light in lights], 0)
        light = BlockLight(lights[0].x, profile, np.zeros(0))
        white, noise = (noise_of(learned, apart) for apart in (WHITE_PX, APART_PX))
        step, wide = light.x[1] - light.x[0], np.abs(light.x) > 3
        print(
            f"learned from {len(learned)} frames: variance {noise[0]:.2f} + {noise[1]:.3f} · level + "
            f"({np.sqrt(noise[2]):.3f} · line)²; light beyond 3 widths "
            f"{profile[wide].sum() / profile.sum():.3f}, width {profile.sum() * step:.2f}, "
            f"{np.sqrt(2 * np.pi):.2f} for a normal curve"
        )
        gauss = replace(light, profile=np.exp(-0.5 * light.x**2))
        for k in range(1 - half, len(frames), 2):
            z = [_z(frames[k], *by) for by in ((gauss, noise), (light, noise), (light, white))]
            use = ~frames[k].blocks.clipped
            chi2[:, k] = *(np.mean(a[use] ** 2) for a in z), np.mean(_z_dark(frames[k], noise) ** 2)
            left[k] = np.where(use, z[1], 0.0)
            print(
                f"{files[k].name}: line, normal profile {chi2[0, k]:.2f}, learned {chi2[1, k]:.2f}, "
                f"by white noise alone {chi2[2, k]:.2f}, background {chi2[3, k]:.2f}"
            )
    better = int((chi2[1] < chi2[0]).sum())
    print(f"learned profile fits better in {better} of {len(frames)} withheld frames")
    names = ("normal", "learned", "by white noise alone", "background")
    print("median χ²:", ", ".join(f"{n} {x:.2f}" for n, x in zip(names, np.median(chi2, 1), strict=True)))
    worst = int(chi2[1].argmax())
    rest = [left[k] for k in range(len(frames))]
    _write(frames[worst], rest[worst], light, out / f"worst-{files[worst].stem}.png")
    _write_maps(frames, rest, out / "z.png")
    print(_remaining(frames, rest))


def _z(frame: RealFrame, light: BlockLight, noise: Float) -> Float:
    level, line = rendered(frame, light)
    return np.asarray((frame.blocks.grey - level) / np.sqrt(variance_of(noise, level, line)))


def _z_dark(frame: RealFrame, noise: Float) -> Float:
    use = frame.off_line & (frame.grey < WHITE)
    ground = frame.ground[use].astype(float)
    return np.asarray((frame.grey[use] - ground) / np.sqrt(variance_of(noise, ground, 0 * ground)))


def _write(frame: RealFrame, z: Float, light: BlockLight, file: Path) -> None:
    made, map_of_z = frame.ground.copy(), np.full(frame.grey.shape, 128.0)
    made[frame.row, frame.column] = rendered(frame, light)[0]
    map_of_z[frame.row, frame.column] = 128 + 16 * z
    file.parent.mkdir(parents=True, exist_ok=True)
    pictures = [np.clip(p, 0, 255).astype(np.uint8) for p in (frame.grey, made, map_of_z)]
    cv2.imwrite(str(file), np.concatenate(pictures, 1))


def _remaining(frames: list[RealFrame], left: list[Float]) -> str:
    """Return in words which share of the squares of z each kind of cell predicts, one after the other."""
    z = np.concatenate(left)
    frame = np.repeat(np.arange(len(frames)), [len(part) for part in left])
    blocks = [f.blocks for f in frames]
    azimuth = np.concatenate([(b.azimuth_rad[b.block] + np.pi) / (2 * np.pi) for b in blocks])
    across = np.concatenate([b.offset_px / b.width_px[b.block] for b in blocks])
    step = np.floor(2 * np.clip(across, -WIDE, WIDE) + 2 * WIDE).astype(int)
    place = (azimuth * BLOCKS).astype(int) % BLOCKS
    tile = np.concatenate([(f.row // 2 + f.column // 2) % 2 for f in frames])
    steps = int(4 * WIDE + 1)
    kinds = (
        ("a profile of another shape, alike in all frames", step, frame % 2),
        ("what is fixed to the image: lens, dirt, mount", place * steps + step, frame % 2),
        ("the line's own shape, which changes from degree to degree and frame to frame: speckle, wall",
         (frame * BLOCKS + place) * steps + step, tile),
    )  # fmt: skip
    total, said = float((z**2).mean()), []
    for words, cell, half in kinds:
        foretold = _by_other_half(z, cell, half)
        said.append(f"{(z**2 - (z - foretold) ** 2).mean():.2f} {words}")
        z = z - foretold
    return (
        f"of χ² {total:.2f}: " + "; ".join(said) + f"; {float((z**2).mean()):.2f} single pixels (1 is noise)"
    )


def _by_other_half(z: Float, cell: Int, half: Int) -> Float:
    """Return the mean of the other half of the pixels (N,) in a cell, shrunk by its noise."""
    other, own = 2 * cell + 1 - half, 2 * cell + half
    count, total = (np.bincount(own, v, 2 * cell.max() + 2) for v in (None, z))
    between = max(float((total[other] / np.maximum(count[other], 1) * z).mean()), 1e-6)
    return np.asarray(total[other] / (count[other] + 1 / between))


def _write_maps(frames: list[RealFrame], left: list[Float], file: Path) -> None:
    """Write maps of z of all frames, four in a row, a third as large; the largest of nine pixels is shown."""
    made = []
    for frame, z in zip(frames, left, strict=True):
        whole = np.zeros(frame.grey.shape, np.float32)
        whole[frame.row, frame.column] = z
        rows, columns = (3 * (n // 3) for n in whole.shape)
        nine = whole[:rows, :columns].reshape(rows // 3, 3, columns // 3, 3).transpose(0, 2, 1, 3)
        nine = nine.reshape(rows // 3, columns // 3, 9)
        most = np.take_along_axis(nine, np.abs(nine).argmax(-1)[..., None], -1)[..., 0]
        made.append(np.clip(128 + 16 * most, 0, 255).astype(np.uint8))
    sheet = np.concatenate([np.concatenate(made[k : k + 4], 1) for k in range(0, len(made), 4)], 0)
    cv2.imwrite(str(file), sheet)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
