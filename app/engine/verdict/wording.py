"""What a feature says for or against stiction, in an engineer's words."""

import math
import re

_FIGURE = re.compile(r"\{[^}]*\}")
_LARGEST_LOG = 700.0
_FOR = {
    "sticking": "PV stands still while OP moves, then follows it, for {percent:.0f} % of the time",
    "ccf_odd": "OP and PV are in quadrature (odd part of their cross-correlation {value:.2f})",
    "op_dpv": "OP follows the slope of PV, not PV itself (correlation {value:.2f})",
    "loop_area": "PV plotted against OP traces a wide loop ({value:.2f} of a full ellipse)",
    "op_pv_direction": "PV reverses where OP crosses its mean ({value:.2f})",
    "pv_direction": "PV is high on one leg of OP and low on the other ({value:.2f})",
    "coherence_odd": "at the oscillation period PV lags OP by about a quarter of a cycle ({value:.2f})",
    "leg_still": "PV stands still over {percent:.0f} % of a typical leg of OP",
    "leg_contrast": "PV differs between rising and falling legs of OP by {value:.1f} standard deviations",
    "flat_eighth": "PV stands still during {percent:.0f} % of OP's travel",
    "flat_quarter": "PV stands still, for a quarter of a cycle at a time, during {percent:.0f} % of OP's travel",
    "gain": "in free run a linear valve leaves {ratio:.2f} times as much of PV unexplained as a sticky one",
    "causal_gain": "in closed loop a linear valve leaves {ratio:.2f} times as much of PV unexplained as a sticky one",
    "causal_sticky": "a sticky valve explains {percent:.0f} % of PV in free run",
    "held_sticky": "a sticky valve explains {percent:.0f} % of PV on the halves held out of the fit",
    "op_kurtosis": "OP is distributed like a triangle wave or a sine, not like noise",
    "op_fundamental": "{percent:.0f} % of OP's power is in a single oscillation",
    "op_fast": "OP has little high-frequency movement",
    "op_roughness": "OP is smooth",
    "op_triangle": "OP is close to a triangle wave",
    "pv_bicoherence": "PV has phase-coupled harmonics, as a nonlinear element produces them ({value:.2f})",
    "oscillation_strength": "the oscillation is strong ({value:.2f})",
    "oscillation_regularity": "the oscillation is regular",
    "S_share": "of a few valves tried, a band of {percent:.0f} % of OP's swing explains PV best (not a size estimate)",
    "integral_share": "the controller acts mostly by integration, as it does against a stuck valve",
    "together_quarter": "over a quarter of a cycle PV moves where OP does not, and stands still where OP travels",
    "together_eighth": "PV moves where OP does not, and stands still where OP travels",
}
_AGAINST = {
    "sticking": "PV hardly ever stands still while OP moves and then follows it ({percent:.0f} % of the time)",
    "ccf_odd": "OP and PV are in phase or antiphase, not quadrature (odd part of their cross-correlation {value:.2f})",
    "op_dpv": "OP does not follow the slope of PV (correlation {value:.2f})",
    "loop_area": "PV plotted against OP traces hardly any loop ({value:.2f} of a full ellipse)",
    "op_pv_direction": "the direction of PV does not depend on the position of OP ({value:.2f})",
    "pv_direction": "PV does not depend on the direction of OP ({value:.2f})",
    "coherence_odd": "at the oscillation period OP and PV are in phase or antiphase ({value:.2f})",
    "leg_still": "PV moves along a typical leg of OP (still over {percent:.0f} %)",
    "leg_contrast": "PV is the same on rising and falling legs of OP",
    "flat_eighth": "PV hardly ever stands still while OP travels ({percent:.0f} %)",
    "flat_quarter": "PV hardly ever stands still for a quarter of a cycle while OP travels ({percent:.0f} %)",
    "gain": "in free run a linear valve leaves hardly more of PV unexplained than a sticky one ({ratio:.2f} times)",
    "causal_gain": "in closed loop a linear valve leaves hardly more unexplained than a sticky one ({ratio:.2f} times)",
    "causal_sticky": "even a sticky valve explains only {percent:.0f} % of PV from OP",
    "held_sticky": "the sticky-valve model does not hold on the halves held out of the fit",
    "op_kurtosis": "OP is distributed like noise",
    "op_fundamental": "only {percent:.0f} % of OP's power is in a single oscillation",
    "op_fast": "OP has much high-frequency movement",
    "op_slow": "OP mostly drifts slowly",
    "op_roughness": "OP is rough",
    "pv_roughness": "PV is rough",
    "op_triangle": "OP is not close to a triangle wave",
    "op_bursts": "most of OP's movement falls into a small part of the time",
    "op_slope_kurtosis": "OP moves in bursts, not in ramps",
    "oscillation_strength": "there is hardly any oscillation ({value:.2f})",
    "oscillation_regularity": "the oscillation is irregular",
    "pv_quantum": "PV moves in steps of its resolution, {value:.2g} of its standard deviation",
    "op_at_limit": "OP is at one of its extremes for {percent:.0f} % of the time",
    "pv_moves_at_limit": "PV moves while OP is at one of its extremes ({percent:.0f} % of its movement)",
    "integral_share": "the controller acts mostly in proportion to PV",
    "together_quarter": "over a quarter of a cycle PV moves when OP moves",
    "together_eighth": "PV moves when OP moves",
}

WORDED = frozenset(_FOR) | frozenset(_AGAINST)
"""Features that have a sentence for or against."""


def is_spoken(name: str, speaks_for: bool) -> bool:
    """Whether a feature has a sentence for that side."""
    return name in (_FOR if speaks_for else _AGAINST)


def sentence(name: str, speaks_for: bool, value: float) -> str:
    """What a feature of this value says. Raises KeyError if it has no sentence for that side."""
    return (_FOR if speaks_for else _AGAINST)[name].format(**_as_told(value))


def figure(name: str, value: float) -> str | None:
    """A value as the sentences of its feature state it; None if none of them states one."""
    for said in (_FOR, _AGAINST):
        if found := _FIGURE.search(said.get(name, "")):
            unit = " %" if found[0].startswith("{percent") else ""
            return found[0].format(**_as_told(value)) + unit
    return None


def _as_told(value: float) -> dict[str, float]:
    """ratio: of a value that is a logarithm; e^700 at most, as other values are asked for theirs too."""
    return {"value": value, "percent": 100.0 * value, "ratio": math.exp(min(value, _LARGEST_LOG))}


def sentence_without_value(name: str, speaks_for: bool) -> str:
    """The same for any value, with x in its place."""
    return _FIGURE.sub("x", (_FOR if speaks_for else _AGAINST)[name])
