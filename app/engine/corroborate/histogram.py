"""Horch's histogram: how PV moves is spread like a bell under stiction, and like a camel's humps for a sine."""

import numpy as np

from app.engine.corroborate.case import Case
from app.engine.corroborate.corroboration import Corroboration, Method
from app.engine.recording import FloatArray

METHOD = Method(
    "histogram",
    threshold=0.5,
    source="Horch 2006, in Ordys, Uduehi, Johnson (eds.), Process Control Performance Assessment, 227-257",
)
_EDGES = np.linspace(-2.5, 2.5, 21)
_CENTRES = 0.5 * (_EDGES[1:] + _EDGES[:-1])
_NOISE_SHARES = np.array([0.02, 0.05, 0.1, 0.2, 0.3])


def _bell(x: FloatArray, variance: FloatArray | float) -> FloatArray:
    return np.exp(-0.5 * x**2 / variance) / np.sqrt(2.0 * np.pi * variance)


def _camels() -> FloatArray:
    """(M, bins) densities of a sine with Gaussian noise, together at unit variance, noise at _NOISE_SHARES of it."""
    phase = (np.arange(400) + 0.5) / 400 * np.pi
    share = _NOISE_SHARES[:, None, None]
    sine = np.sqrt(2.0 * (1.0 - share)) * np.cos(phase)
    return _bell(_CENTRES[None, :, None] - sine, share).mean(axis=2)


_BELL, _CAMELS = _bell(_CENTRES, 1.0), _camels()


def histogram(case: Case) -> Corroboration:
    """E_camel / (E_camel + E_bell), the misfits of two densities to the histogram of the slope of PV.

    For loops that oscillate regularly; of the second difference of PV where the process integrates, so that a stuck
    valve's constant slope counts as standing still. Stiction where the bell fits better. Camel: the density of a sine
    with Gaussian noise, whose share is free up to 0.3 of the variance. The source leaves the filter open: here PV is
    smoothed over about an eighth of a cycle. Misleads wherever noise hides the sine: noise is a bell, too.
    """
    if case.why_not:
        return METHOD.refuse(case.why_not)
    order, name = (2, "second difference") if case.integrating else (1, "slope")
    density = np.mean([_density(np.diff(window.pv_smooth, order)) for window in case.windows], axis=0)
    bell, camel = float(np.sum((density - _BELL) ** 2)), float(np.min(np.sum((density - _CAMELS) ** 2, axis=1)))
    what = f"one peak against two in the histogram of the {name} of PV{case.assumed}"
    return METHOD.answer(camel / (camel + bell + 1e-12), what)


def _density(x: FloatArray) -> FloatArray:
    spread = float(np.std(x))
    scaled = np.clip((x - x.mean()) / (spread or 1.0), _CENTRES[0], _CENTRES[-1])
    return np.histogram(scaled, _EDGES, density=True)[0]
