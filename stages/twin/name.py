"""What is counted or read off the photometric state, and what cannot be told."""

from __future__ import annotations

import numpy as np

from pipeline.artefacts.measured import RingSamples, RingValidity
from pipeline.artefacts.twin import Mismatch, NamedFigure
from stages.twin.line_light import LineLight
from stages.twin.noise import CameraNoise
from stages.twin.state import PhotometricState

_CLIPPED, _CLIPPED_WALL = 0.05, 0.01
"""Share of ring samples, and of pixels of lit wall, from which clipping is told."""
_IN_FOCUS_PX = 1.2
"""1 σ of lens and pixel that lenses in focus stay below: a pixel's own is 0.29, and a spot two pixels wide at
half height has 0.85."""


def clipped(rings: RingSamples, wall_share: float) -> tuple[Mismatch, ...]:
    """Return a clipped line and clipped lit wall, which are counted, not inferred: χ² stays as it was.

    ``wall_share`` is the share of pixels of lit wall at the level where grey levels pile up.
    """
    line_share = float(np.mean(rings.validity == RingValidity.SATURATED)) if rings.validity.size else 0.0
    nan, found = float("nan"), []
    for share, least, what, where, of in (
        (line_share, _CLIPPED, "The line is", "line", "of ring samples"),
        (wall_share, _CLIPPED_WALL, "Lit wall is", "image", "of pixels of lit wall"),
    ):
        if share > least:
            found.append(Mismatch(
                "saturation", "line" if where == "line" else "intensity", where, (),
                (NamedFigure("share", share, 0.0, of),), 0.0, nan, nan,
                f"{what} clipped in {100 * share:.0f} % {of}.",
            ))  # fmt: skip
    return tuple(found)


def not_sharp(line: LineLight | None) -> tuple[Mismatch, ...]:
    """Return a line that is wider than its sheet and a lens in focus make it.

    Its width is held against a fixed limit, not against other frames: the run's photo is as blurred as its
    frames, and re-rendered ones are, too.
    """
    if line is None or line.blur_px.value - 3 * line.blur_px.sd < _IN_FOCUS_PX:
        return ()
    blur, nan = line.blur_px, float("nan")
    return (
        Mismatch(
            "defocus or thick_sheet", "line", "line", (), (NamedFigure("blur", blur.value, blur.sd, "px"),),
            nan, nan, nan,
            f"The line is blurred by {blur.value:.1f} px (1 σ) beyond its sheet's stated thickness: the lens "
            "is out of focus, or the sheet is thicker than stated. In one diameter the two look alike.",
        ),
    )  # fmt: skip


def noise_figures(noise: CameraNoise) -> tuple[NamedFigure, ...]:
    """Return the camera's noise as EMVA 1288 has it."""
    e, read = noise.electrons_per_level, noise.read_electrons
    return (
        NamedFigure("black_dn", noise.black.value, noise.black.sd, "grey levels"),
        NamedFigure("white_dn", noise.white, 0.0, "grey levels"),
        NamedFigure("read_e", read.value, read.sd, "electrons"),
        NamedFigure("gain_e_per_dn", e.value, e.sd, "electrons per grey level"),
        NamedFigure("non_uniformity", noise.uneven.value, noise.uneven.sd, "relative"),
        NamedFigure("gamma", noise.gamma.value, noise.gamma.sd, ""),
    )


def state_figures(state: PhotometricState) -> tuple[NamedFigure, ...]:
    """Return what lamps, laser and lens do, in few numbers."""
    found: list[NamedFigure] = []
    if state.lamp is not None:
        found.append(
            NamedFigure(
                "photo_place_px", float(np.median(state.place_px)), float(np.ptp(state.place_px)) / 2, "px"
            )
        )
        found.append(
            NamedFigure(
                "exposure_spread", state.lamp.gain.spread, float(np.median(state.lamp.gain.sd)), "relative"
            )
        )
        names = ("lamp_cos_1", "lamp_sin_1", "lamp_cos_2", "lamp_sin_2")
        found += [
            NamedFigure(n, float(v), float(s), "relative")
            for n, v, s in zip(names, state.lamp.pattern, state.lamp.pattern_sd, strict=True)
        ]
    if state.line is not None:
        line = state.line
        colours = zip(("blue", "green", "red"), line.colour, line.colour_sd, strict=True)
        found += [NamedFigure(f"line_{n}", float(v), float(s), "share") for n, v, s in colours]
        found += [
            NamedFigure(
                "laser_power_spread", line.course.spread, float(np.median(line.course.sd)), "relative"
            ),
            NamedFigure("sheet_sigma_mm", line.sheet_mm.value, line.sheet_mm.sd, "mm"),
            NamedFigure("lens_blur_px", line.blur_px.value, line.blur_px.sd, "px"),
            NamedFigure("line_halo", line.halo.value, line.halo.sd, "share of light"),
            NamedFigure("line_skewness", line.skewness.value, line.skewness.sd, ""),
            NamedFigure("speckle", line.speckle.value, line.speckle.sd, "relative"),
        ]
    return tuple(found)


def cannot_tell(state: PhotometricState) -> tuple[str, ...]:
    """Return what such recordings do not tell, as sentences."""
    said = [
        "Vignetting cannot be told from the LEDs' lobe: both change brightness with the polar angle alone.",
        "A power response cannot be told from the wall's contrast; gamma is read off the noise, which a "
        "video codec changes: it is no proof of a response that is not linear.",
    ]
    if state.lamp is None:
        said.append("No lit frame could be used: nothing is known of lamps, vignetting and photon transfer.")
    if state.line is None:
        said.append("No frame of the laser alone could be used: nothing is known of the line's profile.")
    else:
        said.append(
            "The sheet's thickness is the stated one: in one diameter it cannot be told from the lens' blur."
        )
    return tuple(said)
