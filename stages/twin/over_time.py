"""What changes over the run or along the laser line: causes, and what hides or resembles them."""

from __future__ import annotations

from pipeline.artefacts.twin import Mismatch
from stages.twin.causes import causes
from stages.twin.colours import Coloured, colour_over_run
from stages.twin.fine_noise import beside_coding
from stages.twin.lamps import faded, flicker_of_measured
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
    found, slow = causes(*sums.cells(), scene.probe.lighting, scene.ring, samples)
    found = or_on_window(found)
    for also in (flicker_of_measured, faded):
        found = (*found, *also(state, found, scene.ring))
    coding = sums.fine.step(scene.ring)
    found, beside = beside_coding(found, coding)
    return (*found, *coding, *colour_over_run(scene, state, coloured)), (*slow, *beside)
