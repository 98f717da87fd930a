"""Horch's histogram: the derivative of PV is bell-shaped under stiction and two-humped for a sine."""

import numpy as np

from app.engine.corroborate.corroboration import Corroboration, Method
from app.engine.features import ShapeWindow
from app.engine.oscillation import Oscillation
from app.engine.recording import FloatArray

METHOD = Method("histogram", "10.1007/978-1-84628-624-7_7", sticky_from=0.6, healthy_to=0.4)
_BINS = 15
_EDGE = 0.98


def histogram(windows: list[ShapeWindow], oscillation: Oscillation, integrating: bool | None) -> Corroboration:
    """Misfit of the histogram to a sine's against its misfit to a bell, 0..1; for loops that oscillate regularly.

    Of the slope of PV where the process is self-regulating, of its second difference where it integrates.
    """
    if not oscillation.regular:
        return METHOD.refuse("the loop does not oscillate regularly")
    order = 2 if integrating else 1
    shares = [camel_or_bell(np.diff(window.pv_smooth, order)) for window in windows]
    name = "second difference" if integrating else "slope"
    return METHOD.answer(float(np.mean(shares)), f"histogram of the {name} of PV, bell against two humps")


def camel_or_bell(x: FloatArray) -> float:
    """E_camel / (E_camel + E_bell) of the histogram of x (n,): 1 for a bell, 0 for a sine's two humps."""
    spread = float(np.std(x))
    if spread <= 0.0:
        return 0.5
    edges = np.linspace(-2.5, 2.5, _BINS + 1)
    density, _ = np.histogram(np.clip((x - x.mean()) / spread, -2.49, 2.49), edges, density=True)
    centre = 0.5 * (edges[1:] + edges[:-1])
    bell = np.exp(-0.5 * centre**2) / np.sqrt(2 * np.pi)
    amplitude = np.sqrt(2.0)
    inside = np.clip(centre / amplitude, -_EDGE, _EDGE)
    camel = np.where(np.abs(centre) < amplitude, 1.0 / (np.pi * amplitude * np.sqrt(1.0 - inside**2)), 0.0)
    to_camel, to_bell = float(np.sum((density - camel) ** 2)), float(np.sum((density - bell) ** 2))
    return to_camel / (to_camel + to_bell + 1e-12)
