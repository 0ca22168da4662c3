"""Tests two published models of a real probe with its rings. usage: bench_pipeblaser OUT

Sixteen single frames of one smooth round pipe at different tilts and offsets, without texture and motion; the
pipe's size is unknown. Poses and radius are free, and every effect of the library is fitted; sizes found on
half of the frames are tested on the others. Writes tables and pictures into OUT.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from scipy import stats

from pipeline.arrays import Float
from pipeline.instrument.camera.formats import read_camera
from pipeline.instrument.probe import Probe
from stages.diagnose.effects.base import EffectModel, Shape
from stages.diagnose.effects.library import LIBRARY, columns
from stages.diagnose.effects.nameless import Moves
from stages.diagnose.effects.vocabulary import GENERIC
from stages.diagnose.result import classes_of
from tests.benchmarks.pipeblaser_rings import BINS, Fitted, Rings, fitted, probe_of, rings_of
from tests.shared_data import shared

CELL = 3
SEEN = 1e-8


@dataclass(frozen=True)
class Told:
    """One effect: amplitude and 1 σ from all frames, χ², p, and the rms, px, on frames not used."""

    name: str
    model: EffectModel
    shape: Shape
    amplitude: Float
    sigma: Float
    statistic: float
    p_value: float
    heldout_px: float


def asked() -> list[tuple[str, EffectModel, Shape]]:
    """Return the effects that single frames of rings can show.

    These are static ones that need no texture of the wall.
    """
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
    """Return the r.m.s. on each half with the size found on the other.

    Poses and radius are always fitted again.
    """
    squares = []
    for (use, known), (test, plain) in (halves, halves[::-1]):
        estimate = _estimate(known, use, model, shape)
        amplitude = estimate[0] if estimate is not None else np.zeros(len(model.amplitudes))
        after = fitted(test, probe, columns(model, plain.points, shape) @ amplitude, plain.state)
        squares.append(core(after.residual_px, plain.weight))
    return float(np.sqrt(np.mean(np.concatenate(squares))))


def core(residual_px: Float, weight: Float) -> Float:
    """Return the sum of squares without outliers under the published model."""
    return np.asarray(residual_px[weight > 0.1] ** 2)


def _estimate(
    found: Fitted, rings: Rings, model: EffectModel, shape: Shape
) -> tuple[Float, Float, float] | None:
    """Return amplitude, covariance and χ², with poses eliminated.

    Errors of neighbouring bins of a frame are correlated, which the covariance allows for.
    """
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
    """Return the r.m.s. of the residual about a sum of so many harmonics, fitted in every frame."""
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
