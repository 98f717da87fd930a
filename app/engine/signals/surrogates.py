"""Linear surrogates of two signals: their spectra and what goes together in them, and all else by chance."""

from collections.abc import Iterator, Sequence

import numpy as np

from app.engine.recording import FloatArray


def linear_surrogates(first: FloatArray, second: FloatArray, seed: int = 0) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Pairs of signals (n,) as a linear loop under a Gaussian load would make them, without end, the same for a seed.

    Each line of both spectra is turned by one random phase: power, coherence and the phase between the two stay as
    they are, corners, ramps and rests do not. The straight line between first and last sample is put back, so that the
    jump from the end to the start is not taken for something fast.
    Misleads: a signal that is not stationary (one step, one transient) is spread over the whole surrogate.
    Source: Prichard, Theiler 1994, doi 10.1103/PhysRevLett.73.951; Theiler et al. 1992, doi
    10.1016/0167-2789(92)90102-S.
    """
    rng = np.random.default_rng(seed)
    lines = [_line(x) for x in (first, second)]
    spectra = [np.fft.rfft(x - line) for x, line in zip((first, second), lines, strict=True)]
    free = slice(1, (len(first) + 1) // 2)
    while True:
        turn = np.ones(len(spectra[0]), dtype=np.complex128)
        turn[free] = np.exp(2j * np.pi * rng.random(len(turn[free])))
        one, other = (
            np.fft.irfft(spectrum * turn, len(first)) + line for spectrum, line in zip(spectra, lines, strict=True)
        )
        yield one, other


def kept_step(x: FloatArray, lags: Sequence[int], slowest: float, fastest: float) -> FloatArray:
    """(L,) how far any linear surrogate of x (n,) repeats itself after each of L lags in samples, from 0 to 1: at 1 it
    is one line.

    Of what has between `slowest` and `fastest` samples a cycle, whatever its phase then.
    """
    power = np.abs(np.fft.rfft(x - _line(x))) ** 2
    cycles = np.arange(len(power))
    power = np.where((cycles * slowest >= len(x)) & (cycles * fastest <= len(x)), power, 0.0)
    turned = np.exp(2j * np.pi / len(x) * np.outer(lags, cycles))
    total = float(np.sum(power))
    return np.abs(turned @ power) / total if total > 0.0 else np.zeros(len(lags))


def _line(x: FloatArray) -> FloatArray:
    """From the first sample to the last."""
    return np.linspace(x[0], x[-1], len(x))
