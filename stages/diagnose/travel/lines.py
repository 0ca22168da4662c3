"""Lines in the spectrum of the camera's position across the pipe, and which pictures show them.

Harmonic F-test over orthogonal tapers: D. Thomson, "Spectrum estimation and harmonic analysis", Proc. IEEE,
1982, § XIII. It compares a sinusoid with the noise close to its frequency, whatever the noise elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal.windows import dpss
from scipy.stats import f as fisher

from pipeline.arrays import Bool, Float
from stages.diagnose.agreement import Agreement, Part, agreement

_BANDWIDTH = 3.0
_TAPERS = 5
_PADDING = 4
_LEAST_MM = 0.003
_ABOVE_FLOOR = 4.0
_REPORTED = 1e-4
_MOST = 4
_SIGNIFICANT = 5.0
_TRIALS = 40
# Below this frequency the drift of a towed probe itself contains spectral lines. Debt: data/debts.md.
SLOWEST_HZ = 1.5
_WANDER_HZ = 1.2
# A probe rolls more slowly (chosen): once in 3 s.
_ROLL_HZ = 0.3
LEAST_SAMPLES = 48


def shows_apart(time_s: Float, frequency: float) -> bool:
    """Return whether pictures at these times separate the frequency from the probe's slow drift."""
    rate = 1 / float(np.median(np.diff(time_s)))
    alias = abs(frequency - rate * round(frequency / rate))
    return bool(alias > SLOWEST_HZ or frequency < rate / 2)


def amplitudes(
    time_s: Float, xy_mm: Float, lit: Bool, frequency: float, start_s: float | None = None
) -> tuple[Float, float]:
    """Return amplitudes (2, 2) along x and y of sine and cosine, mm, beside `_slow` changes, and their 1 σ.

    Phases count from ``start_s``, or else from the first picture. σ is that of the less certain phase: it is
    huge where the slow changes can take the oscillation's place.
    """
    solution, rest, strength, free = _fitted(time_s, xy_mm, lit, frequency, start_s)
    # Chosen: with fewer pictures, too few degrees of freedom are left for a σ.
    if free < 0.3 * (len(time_s) - free):
        return np.full((2, 2), np.nan), float("nan")
    noise = float(np.sqrt(np.sum(rest**2) / (xy_mm.shape[1] * free)))
    return np.asarray(solution.T), noise / max(strength, 1e-9)


def _fitted(
    time_s: Float, xy_mm: Float, lit: Bool, frequency: float, start_s: float | None = None
) -> tuple[Float, Float, float, int]:
    """Return sine and cosine (2, 2), the residual (N, 2), the less certain phase's strength, and freedom."""
    t = time_s - (time_s[0] if start_s is None else start_s)
    line = np.stack([np.sin(2 * np.pi * frequency * t), np.cos(2 * np.pi * frequency * t)], 1)
    slow = _slow(time_s, lit)
    both = np.concatenate([line, xy_mm], 1)
    both = both - slow @ np.linalg.lstsq(slow, both, rcond=1e-6)[0]
    line, xy_mm = both[:, :2], both[:, 2:]
    solution, _, _, strength = np.linalg.lstsq(line, xy_mm, rcond=1e-6)
    return solution, xy_mm - line @ solution, float(strength[-1]), len(t) - slow.shape[1] - line.shape[1]


def _slow(time_s: Float, lit: Bool) -> Float:
    """Return columns (N, K) for all that is no line: the probe's `wander`, and lit pictures that lie aside.

    An error of the stated probe may shift lit and laser pictures against each other, and turns with the roll.
    """
    if lit.all() or not lit.any():
        return wander(time_s)
    return np.concatenate([wander(time_s), lit[:, None] * wander(time_s, _ROLL_HZ)], 1)


def wander(time_s: Float, fastest_hz: float = _WANDER_HZ) -> Float:
    """Return columns (N, K) for whatever changes more slowly than ``fastest_hz``."""
    span = float(time_s[-1] - time_s[0])
    t = time_s - time_s[0]
    phase = np.pi / span * np.arange(1, int(2 * span * fastest_hz) + 1) * t[:, None]
    return np.concatenate([np.stack([np.ones_like(t), t / span], 1), np.cos(phase), np.sin(phase)], 1)


def swing_agreements(time_s: Float, xy_mm: Float, lit: Bool, frequency_hz: float) -> tuple[Agreement, ...]:
    """Return whether disjoint pictures show one oscillation: the same size, direction and phase."""
    early = time_s <= (time_s[0] + time_s[-1]) / 2
    pairs = (
        (("first half of the pictures", early), ("second half of the pictures", ~early)),
        (("pictures of the lit wall", lit), ("pictures of the laser's ring alone", ~lit)),
    )
    found = [[_part(time_s, xy_mm, lit, frequency_hz, *p) for p in pair] for pair in pairs]
    each = [agreement(a, b) for a, b in found if a is not None and b is not None]
    return tuple(a for a in each if a is not None)


def _part(time_s: Float, xy_mm: Float, lit: Bool, frequency_hz: float, where: str, use: Bool) -> Part | None:
    """Return the oscillation in these pictures; None if they show none."""
    t = time_s[use]
    if use.sum() < LEAST_SAMPLES / 2 or not shows_apart(t, frequency_hz):
        return None
    both, sigma = amplitudes(t, xy_mm[use], lit[use], frequency_hz, float(time_s[0]))
    if not np.isfinite(sigma):
        return None
    size = float(np.linalg.norm(both, 2))
    phase = float(np.degrees(np.arctan2(*np.linalg.svd(both)[2][0][::-1]))) % 180
    words = f"±{size:.4g} mm (± {sigma:.2g} mm) at phase {phase:.0f}° of {frequency_hz:.2f} Hz"
    return Part(where, words, both.ravel(), sigma**2 * np.eye(4))


@dataclass(frozen=True)
class Line:
    """A sinusoid in the position across the pipe.

    Attributes
    ----------
    frequency_hz : float
        Between 0 and half the frame rate; the true one may be any alias |f ± k · frame rate|.
    amplitude_mm, sigma_mm : float
        Along the direction in which it is largest.
    direction_deg : float
        Of that direction in P, 0 to 180.
    p_value : float
        Over all frequencies searched.
    lit_mm, laser_mm, share_sigma_mm : float
        The amplitudes in lit and in laser pictures alone, and their 1 σ; NaN where one kind is missing or its
        own rate aliases the frequency into the probe's slow drift.
    agreements : tuple of Agreement
        Whether disjoint pictures show the same oscillation.
    """

    frequency_hz: float
    amplitude_mm: float
    sigma_mm: float
    direction_deg: float
    p_value: float
    lit_mm: float
    laser_mm: float
    share_sigma_mm: float
    frequency_sigma_hz: float
    agreements: tuple[Agreement, ...] = ()

    @property
    def explained_by(self) -> tuple[str, ...]:
        """Possible effects: an oscillating camera shows in all pictures, a rocking sheet only in its own."""
        if not np.isfinite(self.lit_mm + self.laser_mm):
            return ("probe_vibration", "laser_rocking")
        # Amplitudes that differ by less than 3 σ or a fifth (chosen) count as equal.
        equal_mm = max(3 * self.share_sigma_mm, 0.2 * self.laser_mm)
        equal, at_rest = abs(self.lit_mm - self.laser_mm) < equal_mm, self.lit_mm < equal_mm
        # A small line may be equal in both kinds of pictures and absent from the lit ones, for all they show.
        if equal == at_rest:
            return ("probe_vibration", "laser_rocking")
        return ("probe_vibration",) if equal else ("laser_rocking",)


def find_lines(time_s: Float, xy_mm: Float, lit: Bool, shown: Bool | None = None) -> tuple[Line, ...]:
    """Return the lines in positions (N, 2), mm, at times (N,), s, the strongest first.

    ``lit`` (N,) marks the pictures in which the wall shows, with or without the laser; ``shown`` (N,) those
    that determine the sideways position themselves, default all. Interpolated positions oscillate too little
    to be used for the size.
    """
    lines: list[Line] = []
    if len(time_s) < LEAST_SAMPLES:
        return ()
    use = np.ones(len(time_s), bool) if shown is None else shown
    left = xy_mm
    while len(lines) < _MOST:
        found = _strongest(time_s, left, lit)
        if found is None:
            break
        line = _measured(time_s[use], left[use], lit[use], *found)
        if not line.amplitude_mm >= max(_LEAST_MM, _SIGNIFICANT * line.sigma_mm):
            break
        again = swing_agreements(time_s[use], left[use], lit[use], line.frequency_hz)
        lines.append(replace(line, agreements=again))
        left = _without(time_s, left, lit, line)
    return tuple(lines)


def _strongest(time_s: Float, xy_mm: Float, lit: Bool) -> tuple[float, float] | None:
    """Return frequency and p-value of the largest significant line."""
    rate = 1 / float(np.median(np.diff(time_s)))
    even = time_s[0] + np.arange(int(np.round((time_s[-1] - time_s[0]) * rate)) + 1) / rate
    slow = _slow(time_s, lit)
    left = xy_mm - slow @ np.linalg.lstsq(slow, xy_mm, rcond=1e-6)[0]
    centred = np.stack([np.interp(even, time_s, left[:, k]) for k in range(2)], 1)
    count = len(centred)
    tapers = dpss(count, _BANDWIDTH, _TAPERS)
    size = _PADDING * count
    spectrum = np.fft.rfft(tapers[:, :, None] * centred, size, axis=1)
    frequency = np.fft.rfftfreq(size, 1 / rate)
    area = tapers.sum(1)
    mean = np.einsum("k,kfi->fi", area, spectrum) / np.sum(area**2)
    rest = np.sum(np.abs(spectrum - area[:, None, None] * mean) ** 2, (0, 2))
    power = np.sum(area**2) * np.sum(np.abs(mean) ** 2, 1)
    ratio = (_TAPERS - 1) * power / np.maximum(rest, 1e-30)
    band = (frequency > SLOWEST_HZ) & (frequency < rate / 2 - _BANDWIDTH / count * rate)
    floor = np.median(np.sqrt(power[band])) if band.any() else np.inf
    ratio = np.where(band & (np.sqrt(power) > _ABOVE_FLOOR * floor), ratio, 0.0)
    chance = np.minimum(fisher.sf(ratio, 4, 4 * (_TAPERS - 1)) * count, 1.0)
    if chance.min() > _REPORTED:
        return None
    # Sampling at two kinds of moments makes images of one line, which are weaker.
    best = int(np.argmax(np.where(chance < _REPORTED, power, 0.0)))
    return float(frequency[best]), float(chance[best])


def _measured(time_s: Float, xy_mm: Float, lit: Bool, frequency: float, p_value: float) -> Line:
    laser_only = ~lit
    frequency = _refined(time_s, xy_mm, lit, frequency)
    both, sigma = amplitudes(time_s, xy_mm, lit, frequency)
    told = np.isfinite(sigma) and np.any(both)
    direction = np.linalg.svd(both)[0][:, 0] if told else np.array([1.0, 0.0])
    shares = []
    for kind in (lit, laser_only):
        clear = kind.sum() >= LEAST_SAMPLES / 2 and shows_apart(time_s[kind], frequency)
        if clear:
            shares.append(amplitudes(time_s[kind], xy_mm[kind], lit[kind], frequency))
        else:
            shares.append((both * np.nan, np.nan))
    size, span = float(np.linalg.norm(direction @ both)), float(time_s[-1] - time_s[0])
    turning = float(np.hypot(_frequency_sigma(time_s, xy_mm, lit, frequency), 1 / _TRIALS / span))
    in_lit, in_laser = (float(np.linalg.norm(direction @ s[0])) for s in shares)
    # Close to the drift, the size depends on the frequency.
    around = [amplitudes(time_s, xy_mm, lit, frequency + k * turning)[0] for k in (-1, 1)]
    below, above = (float(np.linalg.norm(direction @ swing)) for swing in around)
    return Line(
        frequency, size, float(np.hypot(sigma, (above - below) / 2)),
        float(np.degrees(np.arctan2(direction[1], direction[0]))) % 180.0, p_value, in_lit, in_laser,
        float(np.hypot(shares[0][1], shares[1][1])), turning,
    )  # fmt: skip


def _refined(time_s: Float, xy_mm: Float, lit: Bool, frequency: float) -> float:
    """Return the frequency at which a sinusoid is clearest, reached from ``frequency`` uphill.

    Beside a probe's drift the spectrum is largest up to a whole width of a line away from it.
    """
    width = 1 / (time_s[-1] - time_s[0])
    most = 0.5 / float(np.median(np.diff(time_s)))
    while True:
        trial = np.clip(frequency + width * np.linspace(-0.5, 0.5, _TRIALS + 1), SLOWEST_HZ, most)
        best = int(np.argmin([np.linalg.norm(_fitted(time_s, xy_mm, lit, f)[1]) for f in trial]))
        if trial[best] == frequency or 0 < best < _TRIALS:
            return float(trial[best])
        frequency = float(trial[best])


def _frequency_sigma(time_s: Float, xy_mm: Float, lit: Bool, frequency: float) -> float:
    """Return the 1 σ, Hz, by which noise and the probe's drift displace the clearest sinusoid."""
    step = 1 / _TRIALS / float(time_s[-1] - time_s[0])
    fitted = [_fitted(time_s, xy_mm, lit, frequency + k * step) for k in (-1, 0, 1)]
    below, here, above = (float(np.sum(rest**2)) for _, rest, _, _ in fitted)
    variance = here / (xy_mm.shape[1] * max(fitted[1][3], 1))
    return float(step * np.sqrt(2 * variance / max(below + above - 2 * here, 1e-30)))


def _without(time_s: Float, xy_mm: Float, lit: Bool, line: Line) -> Float:
    """Return the positions minus the line, as lit and as laser pictures show it where both determine it."""
    out = xy_mm.copy()
    whole = np.ones(len(time_s), bool)
    for kind in (lit, ~lit) if np.isfinite(line.share_sigma_mm) else (whole,):
        swing = amplitudes(time_s[kind], xy_mm[kind], lit[kind], line.frequency_hz)[0]
        phase = 2 * np.pi * line.frequency_hz * (time_s[kind] - time_s[kind][0])
        out[kind] -= np.stack([np.sin(phase), np.cos(phase)], 1) @ swing.T
    return out
