"""What changes over the run or along the laser line: causes, and what hides or resembles them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.artefacts.twin import Mismatch
from stages.texture.surface import WallSurface
from stages.twin.causes import causes
from stages.twin.colours import colour_over_run
from stages.twin.fine_noise import beside_coding
from stages.twin.lamps import beside_measured, faded, flicker_of_measured
from stages.twin.line_colour import Coloured
from stages.twin.reference import BlockSamples
from stages.twin.scene import Scene
from stages.twin.state import PhotometricState
from stages.twin.sums import Sums
from stages.twin.window import or_on_window

_SAME_BORE = 0.04
"""Relative change of the bore from which changes of light over time are not told: the smallest change of the
laser that is named. Light falls at least in proportion to the distance to the wall."""


def changes_over_time(
    sums: Sums, samples: BlockSamples | None, scene: Scene, state: PhotometricState, coloured: Coloured
) -> tuple[tuple[Mismatch, ...], tuple[Mismatch, ...]]:
    """Return what is found to change over time or along the line, and what is withdrawn.

    ``coloured`` yields numbers and colour pictures (H, W, 3) of lit frames.
    """
    cells = sums.cells()
    found, slow = causes(*cells, scene.probe.lighting, scene.ring, samples)
    found = or_on_window(found)
    found = (*beside_measured(found, state), *flicker_of_measured(state, found, scene.ring, cells))
    found = (*found, *faded(state, found, scene.ring))
    found, of_bore = beside_reducer(found, scene.surface)
    coding = sums.fine.step(scene.ring)
    found, beside = beside_coding(found, coding)
    return (*found, *coding, *colour_over_run(scene, state, coloured)), (*slow, *of_bore, *beside)


def beside_reducer(
    found: Sequence[Mismatch], surface: WallSurface
) -> tuple[tuple[Mismatch, ...], tuple[Mismatch, ...]]:
    """Return what is found beside a change of the bore, and what that change may cause.

    Line and photo get brighter where the wall is nearer, by lobes and slopes that are not known as well as
    the smallest change that is named. What is at one image azimuth is not caused by it.
    """
    least, most = np.quantile(surface.radius_mm.mean(1), (0.05, 0.95))
    if most < (1 + _SAME_BORE) * least:
        return tuple(found), ()
    unsure = tuple(
        m for m in found
        if m.fixed_to in ("time", "rows") and not any(p.name == "azimuth_deg" for p in m.place)
    )  # fmt: skip
    said = (
        f"{{}} But the bore varies from {2 * least:.0f} to {2 * most:.0f} mm: how bright line and photo are "
        "at another distance of the wall is not known well enough. What to do: record a stretch of one bore."
    )
    withdrawn = tuple(replace(m, statement=said.format(m.statement)) for m in unsure)
    return tuple(m for m in found if m not in unsure), withdrawn
