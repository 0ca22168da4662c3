"""Colour of lit wall over that in its photo: light or a camera whose colour changes over the run.

The photo of a place is made when the laser sheet passes it. Wall ahead of the sheet is therefore shown in
earlier light than its photo, and wall behind it in later light: if colour changes over the run, the ratio of
blue or red to green differs from the photo's ahead and behind. Grey levels of coloured wall change with it,
by its colour: that resembles light that is dim on one side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.arrays import Byte, Float, Int
from pipeline.artefacts.twin import Look, Mismatch, NamedFigure
from stages.twin.cells import sigmas
from stages.twin.line_colour import Coloured
from stages.twin.reflectance import LUMA_BGR
from stages.twin.render import Region, Renderer
from stages.twin.scene import Scene
from stages.twin.state import PhotometricState

_UNSURE = {"", "window_dirt"}
"""Names of sides that are told by small changes of grey between angles of view: none, or one of several."""
_FEW = 8
"""Most lit frames whose colours are compared: decoding colour takes three times as long."""
_EVERY_PX, _BRIGHT, _CLIPPED = 8, 8.0, 250
"""Spacing of the pixels that are compared; grey levels above black that each colour must have by its twin, as
an error of the black level changes darker ones; grey level from which a colour is clipped. Chosen."""
_LEAST, _SURE, _FEWEST, _FEWEST_PIXELS = 0.1, 3.0, 4, 200
"""Least change of a colour's logarithm within a view that is reported, its σ from frame to frame, fewest
frames and pixels. Chosen: sound recordings of another renderer leave up to .04."""
_WIDE, _PARTS = 0.9, 8
"""Share of the pixels of a view over which the change within it is stated; parts of equally many pixels, of
which each colour is summed: the logarithm of a single dark pixel's colour is biased by noise."""


def few_lit(frames: Sequence[int]) -> Int:
    """Return those of the compared frames of lit wall whose colours are compared."""
    return np.array(frames[:: max(-(-len(frames) // _FEW), 1)], np.int64)


def colour_over_run(scene: Scene, state: PhotometricState, pictures: Coloured) -> tuple[Mismatch, ...]:
    """Return the change of colour over the run, if lit frames (number, (H, W, 3) B, G, R) show one."""
    renderer = Renderer(replace(scene, outside=state.outside), state)
    found = [(n, _slopes(scene, renderer, n, image)) for n, image in pictures if image is not None]
    slopes = np.array([s for _, s in found if s is not None]).reshape(-1, 2)
    if len(slopes) < _FEWEST:
        return ()
    which = int(np.argmax(np.abs(slopes.mean(0))))
    size = float(slopes[:, which].mean())
    if abs(size) < _LEAST or abs(sigmas(slopes[:, which])) < _SURE:
        return ()
    return (_mismatch(("blue", "red")[which], slopes[:, which], scene.ring.whole(found[0][0])),)


def _mismatch(colour: str, slopes: Float, look: Look) -> Mismatch:
    size, nan = float(slopes.mean()), float("nan")
    sd = float(slopes.std(ddof=1) / np.sqrt(len(slopes)) * np.exp(size))
    change = NamedFigure("change", float(np.expm1(size)), sd, "relative")
    said = (
        f"Wall ahead has {100 * abs(change.value):.0f} % {'more' if size > 0 else 'less'} {colour} beside "
        "green than wall near the camera, compared with its photo, which is made when the laser passes: the "
        "colour of the light or of the camera changes over the run, or lens, window or lamps colour the "
        "border of the picture otherwise than its middle. What to do: fix the white balance, and let the "
        "LEDs warm up."
    )
    return Mismatch("", "colour", "time", (), (change,), nan, nan, nan, said, look)


def _slopes(scene: Scene, renderer: Renderer, number: int, image: Byte) -> Float | None:
    """Return by how much ln of blue and of red over green grows ahead, beside those of the photo (2,)."""
    some = (slice(None, None, _EVERY_PX),) * 2
    # Under both lights the line is left out.
    twin, black = renderer.frame(number, renderer.state.shows_wall[-1]), _black(renderer.state)
    use = (twin.region[some] == Region.WALL) & (image[some].max(-1) < _CLIPPED)
    away, azimuth, grey = (a[some][use] for a in (twin.distance_mm, twin.azimuth_rad, twin.level))
    photo = scene.reflectance.coloured(away, azimuth).astype(float) - black
    with np.errstate(divide="ignore", invalid="ignore"):
        predicted = photo * (grey / (LUMA_BGR @ photo))
    # Chosen by prediction: noise would choose the brighter ones of the dark pixels.
    known = predicted.min(0) > _BRIGHT
    if known.sum() < _FEWEST_PIXELS:
        return None
    return _growth(away[known].astype(float), (image[some][use][known] - black).T, predicted[:, known])


def _growth(away: Float, seen: Float, predicted: Float) -> Float:
    """Return the growth (2,) of ln(blue / green) and ln(red / green) with N distances, of seen (3, N)."""
    parts = np.array_split(np.argsort(away), _PARTS)
    each = [np.maximum(seen[:, k].sum(1), 1.0) / predicted[:, k].sum(1) for k in parts]
    ratio, lean = np.log(each).T, np.array([away[k].mean() for k in parts]) - away.mean()
    wide = float(np.diff(np.quantile(away, [(1 - _WIDE) / 2, (1 + _WIDE) / 2]))[0])
    return np.asarray(wide * (ratio[[0, 2]] - ratio[1]) @ lean / max(float(lean @ lean), 1e-9))


def _black(state: PhotometricState) -> float:
    """Return the black level, which each colour of frames and photo contains: it pales what is dark."""
    return state.noise.black.value if np.isnan(state.photo_black) else state.photo_black


def beside_colour(
    found: Sequence[Mismatch], over_time: Sequence[Mismatch]
) -> tuple[tuple[Mismatch, ...], tuple[Mismatch, ...]]:
    """Return effects on the whole picture that remain beside a change of colour, and those withdrawn for it.

    It is among what changes ``over_time``. Withdrawn are sides without a certain name, which are told by
    small changes of grey between angles of view.
    """
    colour = any(m.channel == "colour" for m in over_time)
    left = tuple(
        m for m in found if colour and set(m.names) & _UNSURE and m.fixed_to == "image" and _has_side(m)
    )
    said = "{} But the colour of wall differs from its photo, too, which changes its grey likewise."
    withdrawn = tuple(replace(m, statement=said.format(m.statement)) for m in left)
    return tuple(m for m in found if m not in left), withdrawn


def _has_side(found: Mismatch) -> bool:
    return any(p.name == "azimuth_deg" for p in found.place)
