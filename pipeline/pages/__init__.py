"""Pages that are one offline file: a common frame of style and policy, own templates, and figures."""

from __future__ import annotations

from base64 import b64encode
from io import BytesIO
from typing import TYPE_CHECKING, Literal

from pipeline.pages.notation import measured

if TYPE_CHECKING:  # who wants only this package's words need not wait for what fills templates and draws
    from jinja2 import Template
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Format = Literal["png", "svg"]


def data_uri(picture: bytes) -> str:
    """Return a PNG, JPEG or SVG picture as a data URI, so that a page is one file."""
    kinds = {b"\x89PNG": "png", b"\xff\xd8": "jpeg"}
    kind = next((kind for start, kind in kinds.items() if picture.startswith(start)), "svg+xml")
    return f"data:image/{kind};base64,{b64encode(picture).decode('ascii')}"


def page_template(name: str) -> Template:
    """Return the template ``{name}.html`` of this package, which may extend ``base.html``.

    Numbers in millimetres go through the filters ``um`` and ``um_or_mm``, shares through ``percent``,
    the bytes of pictures through ``data_uri``, values with their 1 σ and unit through ``figure``.

    Raises
    ------
    jinja2.TemplateNotFound
        When there is no such template.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("pipeline.pages", ".")
    environment = Environment(loader=loader, undefined=StrictUndefined, autoescape=True)
    environment.filters |= {
        "data_uri": data_uri,
        "um": lambda mm: f"{1000 * mm:.1f}",
        # Below a tenth of a millimetre a reader counts in µm.
        "um_or_mm": lambda mm: f"{1000 * mm:.1f} µm" if abs(mm) < 0.1 else f"{mm:.3f} mm",
        "percent": lambda share: "not stated" if share is None else f"{100 * share:.1f} %",
        "number": lambda value: f"{value:.4g}",
        "figure": lambda f: measured(f["value"], f["sd"], f["unit"]),
    }
    return environment.get_template(f"{name}.html")


def tidy(axes: Axes) -> None:
    """Give axes a faint grid, no frame on the far sides, and a legend where something has a label."""
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=9)


def rendered(figure: Figure, kind: Format = "png", dpi: float = 130, salt: str = "boresight") -> bytes:
    """Return a figure as a picture, always the same bytes; ``salt`` seeds the ids inside an SVG."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    FigureCanvasAgg(figure)
    out = BytesIO()
    metadata: dict[str, None] = {"Software": None} if kind == "png" else {"Date": None, "Creator": None}
    with rc_context({"svg.hashsalt": salt}):
        figure.savefig(out, format=kind, dpi=dpi, metadata=metadata)
    return out.getvalue()
