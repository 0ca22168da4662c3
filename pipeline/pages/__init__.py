"""Pages that are one offline file: a common frame of style and policy, and each page's own template."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:  # who wants only this package's words need not wait for what fills templates
    from jinja2 import Template


def page_template(name: str) -> Template:
    """Return the template ``{name}.html`` of this package, which may extend ``base.html``.

    Numbers in millimetres go through the filters ``um`` and ``um_or_mm``, shares through ``percent``.

    Raises
    ------
    jinja2.TemplateNotFound
        When there is no such template.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("pipeline.pages", ".")
    environment = Environment(loader=loader, undefined=StrictUndefined, autoescape=True)
    environment.filters |= {
        "um": lambda mm: f"{1000 * mm:.1f}",
        "um_or_mm": lambda mm: f"{1000 * mm:.1f} µm" if abs(mm) < 0.1 else f"{mm:.3f} mm",
        "percent": lambda share: "not stated" if share is None else f"{100 * share:.1f} %",
        "number": lambda value: f"{value:.4g}",
    }
    return environment.get_template(f"{name}.html")
