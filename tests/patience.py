"""How long tests wait before they call a program hung. Slow machines get longer.

No test measures this time.
"""

import time

# This work takes so long on one idle core of 3 GHz (Python 3.11).
_WORK, _USUAL_S = 100_000, 0.008


def _slowness() -> float:
    """Return how many times slower than usual this machine is at present, at least 1."""
    took = []
    for _ in range(3):
        start = time.perf_counter()
        sum(i * i for i in range(_WORK))
        took.append(time.perf_counter() - start)
    return max(1.0, min(took) / _USUAL_S)


SLOWNESS = _slowness()


def patience(seconds: float) -> float:
    """Return how long to wait at most, in s, for what usually takes less than ``seconds``."""
    return seconds * SLOWNESS
