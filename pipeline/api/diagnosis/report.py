"""The report of a diagnosis: diagnosis.html, one file that opens offline."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from pipeline.api.diagnosis.apply import GeometryChange, consequence
from pipeline.api.diagnosis.causes import class_shown
from pipeline.arrays import Float
from pipeline.files.disk import replace_text
from pipeline.files.json_yaml import json_number
from pipeline.pages import page_template, rendered, tidy
from pipeline.pages.notation import measured
from pipeline.physics.catalogue import ALL_EFFECTS
from stages.diagnose.as_json import to_json
from stages.diagnose.compared import OnImage
from stages.diagnose.result import (
    Candidate,
    Diagnosis,
    EffectFound,
    Picture,
    ReadingPicture,
    Verdict,
    WallPicture,
)

# Measured quantities of events that are not parameters of their laws: meaning and unit.
_OF_EVENTS = {
    "duration_s": ("duration", "s"),
    "late_s": ("delay of the pictures relative to the encoder", "s"),
}  # fmt: skip
_HEADLINES = {
    Verdict.CONSISTENT: "The recording agrees with the stated instrument",
    Verdict.CLASS: "Something was left out; its kind is known, its name is not certain",
    Verdict.UNEXPLAINED: "Something was left out that has no name yet",
    Verdict.NOT_IDENTIFIABLE: "This recording cannot show whether anything was left out",
}


@dataclass(frozen=True)
class Shown:
    """Further content of the page; None where there is nothing to show."""

    change: GeometryChange | None = None
    image: OnImage | None = None


def write_page(found: Diagnosis, shown: Shown, folder: Path) -> None:
    """Write diagnosis.html.

    Raises
    ------
    OSError
        When it cannot be written.
    """
    change = shown.change
    text = page_template("diagnose").render(
        d=to_json(found), possible=class_shown(found), headline=headline(found), change=change,
        sizes=[sizes(e) for e in found.effects],
        consequence=consequence(change) if change is not None else size_of_mismatch(found),
        hours=_by_hour(change) if change is not None else (), pictures=_pictures(found, shown),
    )  # fmt: skip
    replace_text(folder / "diagnosis.html", text)


def headline(found: Diagnosis) -> str:
    """Return the answer in one line, with what could not be examined."""
    unexamined = f" (not examined: {', '.join(found.unexamined)})" if found.unexamined else ""
    return _headline(found) + unexamined


def _headline(found: Diagnosis) -> str:
    if found.verdict is Verdict.NAMED:
        return "Left out: " + " and ".join(e.name.replace("_", " ") for e in found.effects)
    if found.verdict is Verdict.PARTLY:
        names = " and ".join(e.name.replace("_", " ") for e in found.effects)
        return f"Left out: {names}, and something more that has no name yet"
    return _HEADLINES[found.verdict]


def sizes(found: EffectFound) -> tuple[str, ...]:
    """Return each size of an effect that has a σ, in words."""
    law = ALL_EFFECTS.get(found.name)
    known = {q.name: (q.meaning, q.unit) for q in law.quantities} if law is not None else {}
    out = []
    for name, value in found.parameters.items():
        meaning, unit = (_OF_EVENTS | known).get(name, (name, ""))
        share, unit = (100.0, "%") if name == "relative" else (1.0, unit)
        if value.sd > 0:
            out.append(f"{meaning}: {measured(share * value.value, share * value.sd, unit)}")
    return tuple(out)


def size_of_mismatch(found: Diagnosis) -> str:
    """Return the difference of measured and expected before and after, in a sentence; else empty."""
    if found.reading_picture is not None:
        seen = found.reading_picture
        before, after = (float(np.nanmax(np.abs(mm))) for mm in (seen.before_mm, seen.after_mm))
        return (
            f"The encoder's reading is wrong by up to {before:.2f} mm; after correction for the effects "
            f"found, up to {after:.2f} mm remain."
        )
    if found.ring_picture is None or found.verdict is Verdict.CONSISTENT:
        return ""
    rings = found.ring_picture
    before, after = (float(np.nanmax(np.abs(_quantiles(mm)[0]))) for mm in (rings.before_mm, rings.after_mm))
    return (
        f"With the stated instrument, ring and texture differ by up to {before:.3f} mm in the wall's place "
        f"(median of frames, worst azimuth); after correction for the effects found, {after:.3f} mm "
        "remain. The same command with the option --apply measures the pipe again and says what changes."
    )


def _by_hour(change: GeometryChange) -> list[tuple[int, float | None, float | None]]:
    """Return each clock position with mean and largest change, None where nothing was seen."""
    return [
        (k or 12, json_number(mean), json_number(most))
        for k, (mean, most) in enumerate(zip(change.mean_mm, change.max_mm, strict=True))
    ]


def _pictures(found: Diagnosis, shown: Shown) -> dict[str, bytes]:
    """Return the available pictures (PNG)."""
    made: dict[str, bytes] = {}
    if found.ring_picture is not None:
        made["frames"] = frames_figure(found.ring_picture)
        made["azimuth"] = azimuth_figure(found.ring_picture)
    if found.reading_picture is not None:
        made["reading"] = reading_figure(found.reading_picture)
    if found.wall_picture is not None:
        made["wall"] = wall_figure(found.wall_picture)
    if shown.image is not None:
        made["image"] = image_figure(shown.image)
    if found.candidates:
        made["candidates"] = candidates_figure(found.candidates)
    return made


_SHOWN = 10
# Arrows and colours end at this percentile, so that a few outliers leave the rest visible; the longest arrow.
_QUANTILE = 98.0
_UM = 1000.0
_LONGEST_PX = 60.0
_ACCENT, _BEFORE, _MUTED = "#0a5ea8", "#b04a00", "#9aa7b4"


def frames_figure(picture: Picture) -> bytes:
    """Return the ring's residual over azimuth and frame, before and after, on one scale."""
    extent = (float(picture.frame[0]) - 0.5, float(picture.frame[-1]) + 0.5, -180.0, 180.0)
    return _pair(picture.before_mm.T, picture.after_mm.T, extent, "frame", "azimuth in C, °")


def wall_figure(picture: WallPicture) -> bytes:
    """Return the residual on the unrolled wall, before and after, on one scale."""
    extent = (float(picture.distance_mm[0]), float(picture.distance_mm[-1]), -180.0, 180.0)
    return _pair(picture.before_mm.T, picture.after_mm.T, extent, "distance, mm", "azimuth in P, °")


def azimuth_figure(picture: Picture) -> bytes:
    """Return the residual's mean over all frames by azimuth, with its scatter, before and after."""
    figure = Figure(figsize=(9.6, 3.2), layout="constrained")
    axes = figure.subplots()
    degrees = np.degrees(picture.azimuth_rad)
    for values, colour, name in (
        (picture.before_mm, _BEFORE, "before"),
        (picture.after_mm, _ACCENT, "after"),
    ):
        middle, low, high = _quantiles(_UM * values)
        axes.fill_between(degrees, low, high, color=colour, alpha=0.2, lw=0)
        axes.plot(degrees, middle, color=colour, label=name)
    axes.axhline(0, color="#5b6875", lw=0.8)
    axes.set(
        xlabel="azimuth in C, °", ylabel="residual radius, µm", xlim=(-180, 180), xticks=range(-180, 181, 45)
    )
    tidy(axes)
    return rendered(figure)


def reading_figure(picture: ReadingPicture) -> bytes:
    """Return the error of the encoder's reading over time, before and after."""
    figure = Figure(figsize=(9.6, 3.2), layout="constrained")
    axes = figure.subplots()
    axes.plot(picture.time_s, picture.before_mm, color=_BEFORE, label="before")
    axes.plot(picture.time_s, picture.after_mm, color=_ACCENT, label="after")
    axes.axhline(0, color="#5b6875", lw=0.8)
    axes.set(xlabel="time, s", ylabel="reading − pictures, mm")
    tidy(axes)
    return rendered(figure)


def image_figure(shown: OnImage) -> bytes:
    """Return the residual on the image, before and after, drawn outward and enlarged."""
    figure = Figure(figsize=(9.6, 5.0), layout="constrained")
    both = figure.subplots(1, 2, sharex=True, sharey=True)
    limit = max(float(np.percentile(np.abs(shown.before_px), _QUANTILE)), 0.05)
    longer = _LONGEST_PX / limit
    centre = (shown.uv_before.min(0) + shown.uv_before.max(0)) / 2
    for axes, uv, off, title in zip(
        both, (shown.uv_before, shown.uv_after), (shown.before_px, shown.after_px), ("Before", "After"),
        strict=True,
    ):  # fmt: skip
        axes.imshow(255 - shown.grey, cmap="gray", vmin=0, vmax=255)
        away = uv - centre
        tip = uv + longer * off[:, None] * away / np.linalg.norm(away, axis=1)[:, None]
        ends = np.stack([uv, tip], 1)
        lines = LineCollection(list(ends), cmap="RdBu_r", norm=Normalize(-limit, limit), linewidths=1.6)
        lines.set_array(off)
        axes.add_collection(lines)
        axes.set(xlabel="u, px")
        axes.set_title(f"{title}, frame {shown.frame}, ×{longer:.0f}", fontsize=11, loc="left")
    reach = 1.15 * float(np.max(np.abs(shown.uv_before - centre))) + _LONGEST_PX
    both[0].set(
        xlim=(centre[0] - reach, centre[0] + reach),
        ylim=(centre[1] + reach, centre[1] - reach),
        ylabel="v, px",
    )
    figure.colorbar(lines, ax=both, label="ring farther out than by texture, px")
    return rendered(figure)


def candidates_figure(candidates: tuple[Candidate, ...]) -> bytes:
    """Return the gain of each explanation on held-out regimes, the best first."""
    best = sorted(candidates, key=lambda c: c.heldout_gain, reverse=True)[:_SHOWN]
    figure = Figure(figsize=(9.6, 0.7 + 0.34 * len(best)), layout="constrained")
    axes = figure.subplots()
    place = np.arange(len(best))
    axes.barh(place - 0.18, [c.gain for c in best], 0.34, color=_MUTED, label="on all measurements")
    axes.barh(place + 0.18, [c.heldout_gain for c in best], 0.34, color=_ACCENT, label="on held-out regimes")
    axes.set_yticks(place, [" + ".join(c.names) or "nothing left out" for c in best])
    axes.invert_yaxis()
    axes.set(xlabel="drop of χ² relative to the stated instrument (square-root scale)")
    axes.set_xscale("function", functions=(_signed_root, _signed_square))
    tidy(axes)
    return rendered(figure)


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
    return rendered(figure)


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
