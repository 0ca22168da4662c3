"""Which effects a gauge run can show, and which it cannot distinguish, from its motion and bores alone.

Only the information matrix is used, with poses and stated uncertainties eliminated; the scores, which contain
the residuals, are not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.physics.catalogue import effect
from stages.diagnose.effects.base import EffectModel, Shape
from stages.diagnose.gauge.fit import Fit, evidence
from stages.diagnose.gauge.run import GaugeRun
from stages.diagnose.gauge.scan import span
from stages.diagnose.inference import Evidence, Stated, eliminated, instrument_places, places_of
from stages.diagnose.result import Feasible

_SIGMAS = 5.0
_NEAR = 0.5


def ability(
    run: GaugeRun, nothing: Fit, library: Mapping[str, EffectModel]
) -> tuple[Evidence, dict[str, Shape]]:
    """Return the evidence over all effects, each at one shape, and these shapes."""
    shapes = {name: _middle(model.shapes(*span(run))) for name, model in library.items()}
    asked = [(library[name], shape) for name, shape in shapes.items() if shape is not None]
    known = {name: shape for name, shape in shapes.items() if shape is not None}
    return evidence(run, nothing, asked, with_spread=False)[0], known


def feasibility(
    about: Evidence, shapes: Mapping[str, Shape], library: Mapping[str, EffectModel], stated: Stated
) -> tuple[Feasible, ...]:
    """Return, for every effect, the smallest size visible at 5 σ and the effect most similar to it here."""
    places = {name: places_of(about, library[name], shape) for name, shape in shapes.items()}
    seen = {
        name: block for name, block in places.items() if _least(own_information(about, stated, block)) > 0
    }
    return tuple(_feasible(name, about, seen, library, stated) for name in seen)


def own_information(about: Evidence, stated: Stated, block: Int, rival: Int | None = None) -> Float:
    """Return the information (Q, Q) on an effect, with the stated instrument and a rival free."""
    free = instrument_places(about)
    return eliminated(about, stated, block, free if rival is None else np.union1d(free, rival))[0]


def _feasible(
    name: str, about: Evidence, seen: Mapping[str, Int], library: Mapping[str, EffectModel], stated: Stated
) -> Feasible:
    own = own_information(about, stated, seen[name])
    left = {
        other: _share(own, own_information(about, stated, seen[name], block))
        for other, block in seen.items()
        if other != name
    }
    rival = min(left, key=lambda other: left[other], default="")
    quantity = effect(name).quantities[0]
    share = left.get(rival, 1.0)
    return Feasible(
        name, quantity.name, quantity.unit, float(_SIGMAS / np.sqrt(_least(own))), abs(quantity.typical),
        rival if share < _NEAR else "", share,
    )  # fmt: skip


def _share(own: Float, left: Float) -> float:
    """Return the least share of information that remains in any direction."""
    root = np.linalg.cholesky(own + 1e-12 * np.trace(own) * np.eye(len(own)))
    inner = np.linalg.solve(root, np.linalg.solve(root, left).T)
    return float(np.clip(np.linalg.eigvalsh(inner)[0], 0.0, 1.0))


def _least(information: Float) -> float:
    value = np.linalg.eigvalsh(information)
    return float(value[0]) if value[0] > 1e-9 * max(value[-1], 1e-300) else 0.0


def _middle(shapes: Sequence[Shape]) -> Shape | None:
    return shapes[len(shapes) // 2] if shapes else None
