"""Style and rendering of the reports' figures."""

from __future__ import annotations

from io import BytesIO
from typing import Literal

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

Format = Literal["png", "svg"]


def tidy(axes: Axes) -> None:
    """Give axes a faint grid, no frame on the far sides, and a legend where something has a label."""
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=9)


def rendered(figure: Figure, kind: Format = "png", dpi: float = 130, salt: str = "boresight") -> bytes:
    """Return a figure as a picture; the same figure gives the same bytes. ``salt`` is of an SVG's names."""
    FigureCanvasAgg(figure)
    out = BytesIO()
    metadata: dict[str, None] = {"Software": None} if kind == "png" else {"Date": None, "Creator": None}
    with rc_context({"svg.hashsalt": salt}):
        figure.savefig(out, format=kind, dpi=dpi, metadata=metadata)
    return out.getvalue()
