"""Charts of the page, drawn from its figures."""

from __future__ import annotations

import io
from collections.abc import Callable

from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

COLOURS = ("#0a5ea8", "#c2571a", "#4c8c2b", "#8a4fa3")


def chart(draw: Callable[[Axes], None], title: str, x: str, y: str, legend: bool = True) -> str:
    """Return a chart as SVG; ``draw`` puts the curves on its axes."""
    figure = Figure(figsize=(7.2, 3.6), layout="constrained")
    FigureCanvasSVG(figure)
    axes = figure.add_subplot()
    draw(axes)
    axes.set(title=title, xlabel=x, ylabel=y)
    axes.grid(alpha=0.3)
    if legend:
        axes.legend(frameon=False)
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()[text.getvalue().index("<svg") :]


def bars(values: dict[str, float], title: str, unit: str, own: int = 1) -> str:
    """Return horizontal bars; the first ``own`` are boresight's and have its colour."""

    def draw(axes: Axes) -> None:
        colours = [COLOURS[0] if k < own else COLOURS[1] for k in range(len(values))]
        drawn = axes.barh(list(values), list(values.values()), color=colours)
        axes.invert_yaxis()
        axes.bar_label(drawn, fmt="%.3g", padding=3)
        axes.margins(x=0.12)

    return chart(draw, title, unit, "", legend=False)
