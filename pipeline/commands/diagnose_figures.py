"""Pictures of a diagnosis: residuals over azimuth, time and wall, before and after; candidates."""

from __future__ import annotations

from io import BytesIO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from stages.diagnose.result import Candidate, Picture, WallPicture

Float = NDArray[np.float64]
_SHOWN = 10
_QUANTILE = 98.0
_UM = 1000.0
_ACCENT, _MUTED = "#0a5ea8", "#9aa7b4"


def frames_figure(picture: Picture) -> bytes:
    """Return the ring's residual over azimuth and frame, before and after, on one scale."""
    extent = (float(picture.frame[0]) - 0.5, float(picture.frame[-1]) + 0.5, -180.0, 180.0)
    return _pair(picture.before_mm.T, picture.after_mm.T, extent, "frame", "azimuth in C, °")


def wall_figure(picture: WallPicture) -> bytes:
    """Return the residual on the unrolled wall, before and after, on one scale."""
    extent = (float(picture.distance_mm[0]), float(picture.distance_mm[-1]), -180.0, 180.0)
    return _pair(picture.before_mm.T, picture.after_mm.T, extent, "distance, mm", "azimuth in P, °")


def azimuth_figure(picture: Picture) -> bytes:
    """Return the residual's mean over all frames against azimuth, with its scatter, before and after."""
    figure = Figure(figsize=(9.6, 3.2), layout="constrained")
    axes = figure.subplots()
    degrees = np.degrees(picture.azimuth_rad)
    for values, colour, name in (
        (picture.before_mm, "#b04a00", "before"),
        (picture.after_mm, _ACCENT, "after"),
    ):
        middle, low, high = _quantiles(_UM * values)
        axes.fill_between(degrees, low, high, color=colour, alpha=0.2, lw=0)
        axes.plot(degrees, middle, color=colour, label=name)
    axes.axhline(0, color="#5b6875", lw=0.8)
    axes.set(
        xlabel="azimuth in C, °", ylabel="residual radius, µm", xlim=(-180, 180), xticks=range(-180, 181, 45)
    )
    _finish(axes)
    return _png(figure)


def candidates_figure(candidates: tuple[Candidate, ...]) -> bytes:
    """Return what each explanation gains on held-out regimes, the best first."""
    best = sorted(candidates, key=lambda c: c.heldout_gain, reverse=True)[:_SHOWN]
    figure = Figure(figsize=(9.6, 0.7 + 0.34 * len(best)), layout="constrained")
    axes = figure.subplots()
    place = np.arange(len(best))
    axes.barh(place - 0.18, [c.gain for c in best], 0.34, color=_MUTED, label="on all measurements")
    axes.barh(place + 0.18, [c.heldout_gain for c in best], 0.34, color=_ACCENT, label="on held-out regimes")
    axes.set_yticks(place, [" + ".join(c.names) or "nothing left out" for c in best])
    axes.invert_yaxis()
    axes.set(xlabel="drop of χ² against the stated instrument (square-root scale)")
    axes.set_xscale("function", functions=(_signed_root, _signed_square))
    _finish(axes)
    return _png(figure)


def _pair(before: Float, after: Float, extent: tuple[float, float, float, float], x: str, y: str) -> bytes:
    figure = Figure(figsize=(9.6, 5.2), layout="constrained")
    both = figure.subplots(2, 1, sharex=True)
    seen = np.abs(before[np.isfinite(before)])
    limit = max(float(np.percentile(seen, _QUANTILE)) if len(seen) else 0.0, 1e-3) * _UM
    for axes, values, title in zip(both, (before, after), ("Before", "After"), strict=True):
        image = axes.imshow(
            _UM * values, cmap="RdBu_r", vmin=-limit, vmax=limit, extent=extent, origin="lower",
            aspect="auto", interpolation="nearest",
        )  # fmt: skip
        axes.set_facecolor("#808080")
        axes.set(ylabel=y, yticks=range(-180, 181, 90))
        axes.set_title(title, fontsize=11, loc="left")
    both[1].set_xlabel(x)
    figure.colorbar(image, ax=both, label="residual radius, µm (grey: not measured)")
    return _png(figure)


def _quantiles(values: Float) -> tuple[Float, Float, Float]:
    """Return the median and the middle two thirds (A,) over frames; NaN where nothing was seen."""
    seen = np.isfinite(values).any(0)
    out = np.full((3, values.shape[1]), np.nan)
    out[:, seen] = np.nanpercentile(values[:, seen], [50, 16, 84], axis=0)
    return out[0], out[1], out[2]


def _signed_root(values: Float) -> Float:
    return np.asarray(np.sign(values) * np.sqrt(np.abs(values)))


def _signed_square(values: Float) -> Float:
    return np.asarray(np.sign(values) * np.square(values))


def _finish(axes: Axes) -> None:
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(fontsize=9)


def _png(figure: Figure) -> bytes:
    FigureCanvasAgg(figure)
    out = BytesIO()
    figure.savefig(out, format="png", dpi=130, metadata={"Software": None})
    return out.getvalue()
