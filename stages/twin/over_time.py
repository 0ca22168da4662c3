"""What changes over the run or along the laser line: causes, and what hides or resembles them."""

from __future__ import annotations

from pipeline.artefacts.twin import Mismatch
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
    coding = sums.fine.step(scene.ring)
    found, beside = beside_coding(found, coding)
    return (*found, *coding, *colour_over_run(scene, state, coloured)), (*slow, *beside)
