"""deviation.png, uncertainty.png, misalignment.png …: error colours with axes and colour bars."""

from __future__ import annotations

from pathlib import Path

from pipeline.artefacts.model import Overlays


def write_overlays(overlays: Overlays, folder: Path) -> None:
    """Write one picture for each overlay: distance to the right, clock hours upward, 12 in the middle.

    Raises
    ------
    OSError
        When a file cannot be written.
    """
    # matplotlib is slow to import: a run is under way by then.
    from pipeline.export.overlay_figure import DPI, overlay_figure

    for overlay in overlays.pictures:
        figure = overlay_figure(overlays, overlay)
        figure.savefig(folder / f"{overlay.name}.png", dpi=DPI, metadata={"Software": "boresight"})
