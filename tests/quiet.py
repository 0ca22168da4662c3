"""A context without display, log or cancel, for tests that call a stage's function by itself."""

from __future__ import annotations

import numpy as np

from pipeline.machine.stage import Context


def quiet_context(seed: int = 0, workers: int = 2) -> Context:
    """Return a context that reports nothing."""
    return Context(
        lambda done, total: None,
        lambda name, value, unit="": None,
        np.random.default_rng(seed),
        workers,
    )
