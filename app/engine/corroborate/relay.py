"""Rossi and Scali's relay technique: PV as the answer to a relay, as a triangle, or as a sine."""

import numpy as np

from app.engine.corroborate.case import FEWEST_HALF_CYCLES, Case
from app.engine.corroborate.corroboration import Corroboration, Method
from app.engine.corroborate.half_cycles import PHASE, SINE, misfit, triangles
from app.engine.recording import FloatArray

METHOD = Method(
    "relay",
    threshold=0.21,
    lower=-0.21,
    source="Rossi, Scali 2005, J. Process Control 15, 505-514",
)


def _relay_responses() -> FloatArray:
    """Answers of a first-order process to a relay, from zero crossing to zero crossing.

    With its lag tau and the time t since the relay switched, in half cycles, PV runs on 1 - c exp(-t / tau) from its
    lowest to its highest point, c = 2 / (1 + exp(-1 / tau)). Dead time delays the switch behind the zero crossing.
    """
    lags = np.geomspace(0.02, 2.0, 12)[:, None]
    t = np.linspace(0.0, 2.0, 401)
    c = 2.0 / (1.0 + np.exp(-1.0 / lags))
    up = 1.0 - c * np.exp(-np.minimum(t, 1.0) / lags)
    down = c * np.exp(-np.maximum(t - 1.0, 0.0) / lags) - 1.0
    waves = np.where(t <= 1.0, up, down)
    crossings = -lags[:, 0] * np.log(1.0 / c[:, 0])
    return np.array([np.interp(z + PHASE, t, wave) for z, wave in zip(crossings, waves, strict=True)])


_OTHERS = np.concatenate([_relay_responses(), triangles(np.array([0.5]))])


def relay(case: Case) -> Corroboration:
    """S_I = (E_sine - E_other) / (E_sine + E_other) on PV, E_other the better of relay and triangle.

    For loops that oscillate regularly, integrating (triangle) or not (relay). Above 0.21 stiction, below -0.21 not,
    undecided between. The source fits gain, lag and dead time of the relay's answer numerically; here the lag is
    searched over twelve values from 0.02 to 2 half cycles, and each half cycle starts at its zero crossing, which is
    all that dead time moves. Misleads where PV keeps only the first harmonic, because the process is slow against the
    oscillation: relay and sine are then alike.
    """
    if case.why_not:
        return METHOD.refuse(case.why_not)
    halves = case.pv_halves
    if len(halves) < FEWEST_HALF_CYCLES:
        return METHOD.refuse(f"{len(halves)} whole half cycles in PV, needed {FEWEST_HALF_CYCLES}")
    sine, other = misfit(halves, SINE), misfit(halves, _OTHERS)
    return METHOD.answer((sine - other) / (sine + other + 1e-12), "relay or triangle against sine on PV")
