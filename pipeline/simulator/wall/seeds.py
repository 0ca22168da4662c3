"""Random generators by purpose, so that one part of a scene changes without changing the others."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Seeds:
    """Hands out generators; ``seed`` is the scene's."""

    seed: int

    def of(self, purpose: str, index: int = 0) -> np.random.Generator:
        """Return the generator of a purpose; the same every time it is asked for."""
        return np.random.default_rng([self.seed, zlib.crc32(purpose.encode()), index])
