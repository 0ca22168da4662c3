"""What a real probe's rings say of its two published models. usage: bench_pipeblaser OUT

Sixteen single frames of one smooth round pipe at different tilts and offsets, no texture, no motion, the
pipe's size unknown. Poses and radius are free; every effect of the library is asked about; sizes found on
half of the frames are tried on the others. Writes tables and pictures into OUT.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy import stats
from scipy.optimize import least_squares

from pipeline.artefacts import RingValidity
from pipeline.geometry.rigid import rotation_from_vector
from pipeline.instrument.camera.base import Camera
from pipeline.instrument.camera.formats import read_camera
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from stages.diagnose.classes import classes_of
from stages.diagnose.effects.base import EffectModel, ImagePoints, Shape
from stages.diagnose.effects.generic import GENERIC, Moves
from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.effects.predict import columns
from stages.rings.colour import excess_weights, mix
from stages.rings.sectors import cut_sectors
from stages.rings.trace import trace_ring
from tests.shared_data import shared

Float = NDArray[np.float64]
Int = NDArray[np.int64]
RED_NM = 650.0
PLANE = (-0.228405, 0.61683, -100.0, 17.1103)
PIXELS = 1.35
POSE, BINS, CELL = 4, 90, 3
SEEN = 1e-8


@dataclass(frozen=True)
class Rings:
    """Ring samples of all frames as pixels of the published model: frame (M,), uv (M, 2), bin (M,)."""

    frame: Int
    uv: Float
    bin: Int

    def of(self, frames: Sequence[int]) -> Rings:
        keep = np.isin(self.frame, frames)
        return Rings(self.frame[keep], self.uv[keep], self.bin[keep])


@dataclass(frozen=True)
class Fitted:
    """Residuals (M,) in mm at the best poses and radius, weights, and derivatives by those (M, N)."""

    points: ImagePoints
    residual: Float
    mm_per_px: Float
    weight: Float
    own: Float
    state: Float

    @property
    def radius_mm(self) -> float:
        return float(self.state[-1])

    @property
    def residual_px(self) -> Float:
        return self.residual / self.mm_per_px


@dataclass(frozen=True)
class Told:
    """One effect: amplitude and 1 σ on all frames, χ², p, and the r.m.s. in px on frames not used for it."""

    name: str
    model: EffectModel
    shape: Shape
    amplitude: Float
    sigma: Float
    statistic: float
    p_value: float
    heldout_px: float


def rings_of(folder: Path) -> Rings:
    frame, uv, place = [], [], []
    for k, file in enumerate(sorted(folder.glob("*.png"))):
        image = cv2.imread(str(file))
        assert image is not None
        image[:, -2:] = 0
        size = (image.shape[1], image.shape[0])
        sectors = cut_sectors(size, (0.445 * size[0], 0.524 * size[1]), 1440)
        trace = trace_ring(mix(image, excess_weights(RED_NM)), sectors, 255.0)
        assert trace is not None, file.name
        radius = np.where(trace.validity == RingValidity.VALID, trace.fit.radius_px, np.nan)
        condensed = np.nanmedian(radius.reshape(BINS, -1), axis=1)
        seen = np.isfinite(radius.reshape(BINS, -1)).sum(1) >= 4
        psi = sectors.azimuth_rad.reshape(BINS, -1).mean(1)
        here = sectors.centre_px + condensed[:, None] * np.stack([np.cos(psi), np.sin(psi)], -1)
        frame.append(np.full(int(seen.sum()), k))
        uv.append((here[seen] + 0.5) * PIXELS - 0.5)
        place.append(np.flatnonzero(seen))
    return Rings(np.concatenate(frame), np.concatenate(uv), np.concatenate(place))


def probe_of(camera: Camera) -> Probe:
    a, b, c, d = PLANE
    laser = LaserSheet(-1000 * d / c, tilt_x=-a / c, tilt_y=-b / c, line_sigma_mm=1.0, wavelength_nm=RED_NM)
    size = len(camera.parameter_names) + len(LaserSheet.PARAMETER_NAMES)
    return Probe(camera, laser, np.zeros((size, size)))


def fitted(rings: Rings, probe: Probe, shift_px: Float | None = None, start: Float | None = None) -> Fitted:
    """Fit a cylinder to the rings of all frames, each with its own place and lean, by Gauss-Newton."""
    away = rings.uv - probe.camera.centre_px
    outward = away / np.linalg.norm(away, axis=1)[:, None]
    uv = rings.uv if shift_px is None else rings.uv - np.nan_to_num(shift_px)[:, None] * outward
    xyz = probe.triangulate(uv)
    seen = np.isfinite(xyz).all(1)
    xyz = np.where(seen[:, None], xyz, [1e3, 0.0, 1e3])
    frames, row = np.unique(rings.frame, return_inverse=True)
    state = _start(xyz, row, len(frames)) if start is None else start
    solved = least_squares(
        lambda x: np.where(seen, _cylinder(xyz, row, x, len(frames))[0], 0.0), state, loss="cauchy",
        jac=lambda x: np.where(seen[:, None], _cylinder(xyz, row, x, len(frames))[1], 0.0),
        f_scale=2.5, x_scale=np.r_[np.tile([10.0, 10.0, 0.05, 0.05], len(frames)), 10.0], max_nfev=60,
    )  # fmt: skip
    state = solved.x
    residual, own, normal, axis = _cylinder(xyz, row, state, len(frames))
    weight = seen / (1 + (residual / 2.5) ** 2)
    by_pixel = probe.triangulate_jacobian(uv)[0]
    mm_per_px = np.einsum("mi,mij,mj->m", normal, by_pixel, outward)
    none = np.zeros(len(uv))
    points = ImagePoints(
        probe, rings.frame, none, uv, xyz, normal, axis, np.zeros((len(uv), 2)), none, True,
        np.full(len(uv), 2.0),
    )  # fmt: skip
    return Fitted(points, residual, mm_per_px, weight, own, state)


def _start(xyz: Float, row: Int, frames: int) -> Float:
    """Return each frame's circle in the sheet's plane, no lean, and the median radius."""
    state, radius = np.zeros((frames, POSE)), np.zeros(frames)
    for k in range(frames):
        xy = xyz[(row == k) & np.isfinite(xyz).all(1), :2]
        *centre, rest = np.linalg.lstsq(np.c_[2 * xy, np.ones(len(xy))], (xy**2).sum(1), rcond=None)[0]
        state[k, :2], radius[k] = centre, np.sqrt(rest + np.sum(np.square(centre)))
    return np.append(state.ravel(), np.median(radius))


def _cylinder(xyz: Float, row: Int, state: Float, frames: int) -> tuple[Float, Float, Float, Float]:
    pose = state[:-1].reshape(frames, POSE)[row]
    residual, normal, axis = _gap(xyz, pose, state[-1])
    own = np.zeros((len(xyz), len(state)))
    own[:, -1] = -1.0
    for k in range(POSE):
        step = np.zeros(POSE)
        step[k] = 0.01 if k < 2 else 1e-5
        slope = (_gap(xyz, pose + step, state[-1])[0] - _gap(xyz, pose - step, state[-1])[0]) / (2 * step[k])
        own[np.arange(len(xyz)), POSE * row + k] = slope
    return residual, own, normal, axis


def _gap(xyz: Float, pose: Float, radius: float) -> tuple[Float, Float, Float]:
    """Return distance of points from cylinders less the radius, outward normals, axes, all in C."""
    lean = rotation_from_vector(np.stack([pose[:, 2], pose[:, 3], 0 * pose[:, 2]], -1))
    axis = lean[:, :, 2]
    across = xyz - np.stack([pose[:, 0], pose[:, 1], 0 * pose[:, 0]], -1)
    across = across - np.sum(across * axis, 1)[:, None] * axis
    distance = np.linalg.norm(across, axis=1)
    return distance - radius, across / distance[:, None], axis


def asked() -> list[tuple[str, EffectModel, Shape]]:
    """Return what single still frames of rings can be asked about: static, without texture of the wall."""
    out: list[tuple[str, EffectModel, Shape]] = []
    for name, model in LIBRARY.items():
        shapes = model.shapes(1.0, 1.0)
        if len(shapes) <= 8 and "drift" not in name and "encoder" not in name:
            out += [(name, model, s) for s in shapes]
    out += [(t.name, t, (0.0,)) for t in GENERIC if t.moves is not Moves.AROUND]
    return out


def told(rings: Rings, probe: Probe, found: Fitted, halves: Sequence[tuple[Rings, Fitted]]) -> list[Told]:
    out: dict[str, Told] = {}
    for name, model, shape in asked():
        estimate = _estimate(found, rings, model, shape)
        if estimate is None:
            continue
        amplitude, covariance, statistic = estimate
        if name in LIBRARY and not model.possible(shape, amplitude):
            continue
        if name in out and out[name].statistic > statistic:
            continue
        heldout = heldout_px(halves, probe, model, shape)
        p = float(stats.f.sf(statistic / len(amplitude), len(amplitude), 60))
        sigma = np.sqrt(np.diag(covariance))
        out[name] = Told(name, model, shape, amplitude, sigma, statistic, p, heldout)
    return sorted(out.values(), key=lambda t: t.heldout_px)


def heldout_px(
    halves: Sequence[tuple[Rings, Fitted]], probe: Probe, model: EffectModel, shape: Shape
) -> float:
    """Return the r.m.s. on each half with the size found on the other; poses and radius always anew."""
    squares = []
    for (use, known), (test, plain) in (halves, halves[::-1]):
        estimate = _estimate(known, use, model, shape)
        amplitude = estimate[0] if estimate is not None else np.zeros(len(model.amplitudes))
        after = fitted(test, probe, columns(model, plain.points, shape) @ amplitude, plain.state)
        squares.append(core(after.residual_px, plain.weight))
    return float(np.sqrt(np.mean(np.concatenate(squares))))


def core(residual_px: Float, weight: Float) -> Float:
    """Return the squares of what is no outlier under the published model."""
    return np.asarray(residual_px[weight > 0.1] ** 2)


def _estimate(
    found: Fitted, rings: Rings, model: EffectModel, shape: Shape
) -> tuple[Float, Float, float] | None:
    """Return amplitude, covariance (cells of a frame's neighbours err alike) and χ², poses eliminated."""
    by_effect = -found.mm_per_px[:, None] * columns(model, found.points, shape)
    good = np.isfinite(by_effect).all(1)
    w = np.sqrt(found.weight * good)
    own, by_effect = w[:, None] * found.own, np.where(good[:, None], w[:, None] * by_effect, 0.0)
    follow = np.linalg.lstsq(own, by_effect, rcond=1e-10)[0]
    left = by_effect - own @ follow
    if np.any(np.sum(left**2, 0) < SEEN * np.maximum(np.sum(by_effect**2, 0), 1e-30)):
        return None
    information = left.T @ left
    amplitude = np.linalg.solve(information, -left.T @ (w * found.residual))
    rest = w * found.residual + left @ amplitude
    cell = np.unique(rings.frame * 100 + rings.bin // CELL, return_inverse=True)[1]
    scores = np.zeros((int(cell.max()) + 1, len(amplitude)))
    np.add.at(scores, cell, left * rest[:, None])
    inverse = np.linalg.inv(information)
    covariance = inverse @ (scores.T @ scores) @ inverse
    return amplitude, covariance, float(amplitude @ np.linalg.solve(covariance, amplitude))


def floor_px(found: Fitted, rings: Rings, waves: int = 10) -> float:
    """Return the r.m.s. of the residual about so many waves of its own in every frame."""
    out = []
    for k in np.unique(rings.frame):
        here = (rings.frame == k) & (found.weight > 0.1)
        angle = np.outer(2 * np.pi * rings.bin[here] / BINS, np.arange(waves + 1))
        design = np.concatenate([np.cos(angle), np.sin(angle[:, 1:])], 1)
        values = found.residual_px[here]
        rest = values - design @ np.linalg.lstsq(design, values, rcond=1e-8)[0]
        out.append(rest * np.sqrt(len(rest) / (len(rest) - design.shape[1])))
    return float(np.sqrt(np.mean(np.concatenate(out) ** 2)))


def report(name: str, rings: Rings, probe: Probe, out: Path) -> None:
    found = fitted(rings, probe)
    frames = np.unique(rings.frame)
    halves = [(h, fitted(h, probe)) for h in (rings.of(frames[::2]), rings.of(frames[1::2]))]
    plain = float(np.sqrt(np.mean(np.concatenate([core(f.residual_px, f.weight) for _, f in halves]))))
    each = told(rings, probe, found, halves)
    print(f"\n{name}: diameter {2 * found.radius_mm:.1f} mm; residual {plain:.3f} px r.m.s. by halves;")
    print(f"about ten waves in each frame {floor_px(found, rings):.3f} px, {len(rings.uv)} bins")
    print("| explanation | held-out px | χ² | p | size |\n|---|---|---|---|---|")
    for t in each[:16]:
        size = ", ".join(
            f"{v:.4g} ± {s:.2g} {a.unit}"
            for a, v, s in zip(t.model.amplitudes, t.amplitude, t.sigma, strict=True)
        )
        told_apart = f"{t.statistic:.0f} | {t.p_value:.0e}"
        print(f"| {t.name} {t.shape or ''} | {t.heldout_px:.3f} | {told_apart} | {size} |")
    best = each[0]
    named = [t for t in each if t.name in LIBRARY]
    top = named[0]
    near = [t.name for t in named if t.heldout_px < plain - 0.8 * (plain - top.heldout_px)]
    print(f"class of those that remove at least 0.8 of what the best removes: {', '.join(near)}")
    print(f"with what one kind of recording never splits: {', '.join(classes_of(near))}")
    if best.name not in LIBRARY:
        print(f"a pattern without a cause does better: {best.name}, {best.heldout_px:.3f} px")
    _picture(name, rings, probe, found, top, out)


def _picture(name: str, rings: Rings, probe: Probe, found: Fitted, top: Told, out: Path) -> None:
    after = fitted(rings, probe, columns(top.model, found.points, top.shape) @ top.amplitude, found.state)
    figure = Figure(figsize=(9.6, 5.0), layout="constrained")
    both = figure.subplots(2, 1, sharex=True)
    for axes, f, title in zip(both, (found, after), ("as published", f"with {top.name}"), strict=True):
        image = np.full((16, BINS), np.nan)
        image[rings.frame, rings.bin] = f.residual_px
        shown = axes.imshow(image, cmap="RdBu_r", vmin=-4, vmax=4, aspect="auto", extent=(-180, 180, 16, 0))
        axes.set_title(f"{name}, {title}", loc="left", fontsize=11)
        axes.set(ylabel="frame")
    both[1].set_xlabel("azimuth, °")
    figure.colorbar(shown, ax=both, label="residual, px")
    FigureCanvasAgg(figure)
    figure.savefig(out / f"pipeblaser_{name.split()[0].lower()}.png", dpi=120)


def main() -> None:
    out = Path(sys.argv[1])
    out.mkdir(parents=True, exist_ok=True)
    folder = shared("real", "pipeblaser_cmu")
    rings = rings_of(folder / "rings_v1")
    for name, file in (("KANNALA_BRANDT", "iros2021.yaml"), ("MEI", "v1_vins.yaml")):
        report(name, rings, probe_of(read_camera(folder / "config" / file)), out)


if __name__ == "__main__":
    main()
