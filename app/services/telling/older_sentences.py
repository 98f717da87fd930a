"""The sentences in which engines up to 0.1.18 told shapes: rows that they stored without `measured` keep them."""

_FOR = {
    "sticking": "PV stands while OP moves, and then follows it, for 0 % of the time",
    "ccf_odd": "OP and PV run in quadrature (odd part of their cross-correlation 0)",
    "op_dpv": "OP goes with the slope of PV, not with PV (correlation 0)",
    "loop_area": "PV over OP encloses a wide loop (0 of a full ellipse)",
    "op_pv_direction": "PV turns where OP crosses its middle (0)",
    "coherence_odd": "at the period of the oscillation PV lags OP by about a quarter (0)",
    "flat_eighth": "0 % of the travel of OP finds PV standing still",
    "flat_quarter": "0 % of the travel of OP finds PV standing still for a quarter of a swing",
    "causal_gain": "closing the loop, a linear valve leaves 0 times as much of PV as a sticky one",
    "held_sticky": "a sticky valve explains 0 % of PV on halves that were not fitted",
    "op_kurtosis": "OP has the spread of a triangle or sine, not of noise",
    "op_fundamental": "0 % of the power of OP is in one oscillation",
    "op_fast": "OP has little fast movement",
    "op_triangle": "OP runs in triangles",
    "pv_bicoherence": "PV has phase-coupled harmonics, as a nonlinear element makes them (0)",
    "S_share": "a valve with a band of 0 % of OP's swing explains PV best of the few tried (not the size)",
    "integral_share": "the controller mostly integrates, as it does against a stuck valve",
    "together_quarter": "over a quarter of a swing PV moves where OP does not, and stands where OP travels",
    "together_eighth": "PV moves where OP does not, and stands where OP travels",
}
_AGAINST = {
    "sticking": "PV hardly ever stands while OP moves and then follows it (0 % of the time)",
    "ccf_odd": "OP and PV run in line, not in quadrature (odd part of their cross-correlation 0)",
    "op_dpv": "OP does not go with the slope of PV (correlation 0)",
    "loop_area": "PV over OP encloses hardly a loop (0 of a full ellipse)",
    "op_pv_direction": "the direction of PV does not depend on where OP is (0)",
    "coherence_odd": "at the period of the oscillation OP and PV are in line (0)",
    "flat_quarter": "PV hardly ever stands still for a quarter of a swing while OP travels (0 %)",
    "causal_gain": "closing the loop, a linear valve leaves hardly more of PV than a sticky one (0 times)",
    "causal_sticky": "even with a sticky valve only 0 % of PV follows from OP",
    "held_sticky": "the sticky valve does not hold on halves that were not fitted",
    "op_kurtosis": "OP is spread like noise",
    "op_fundamental": "only 0 % of the power of OP is in one oscillation",
    "op_fast": "OP is full of fast movement",
    "op_slow": "OP mostly wanders slowly",
    "op_triangle": "OP does not run in triangles",
    "op_bursts": "OP makes most of its movement in a small part of the time",
    "oscillation_strength": "there is hardly an oscillation (0)",
    "pv_quantum": "PV steps by its resolution, 0 of its standard deviation",
    "op_at_limit": "OP stands at an extreme for 0 % of the time",
    "pv_moves_at_limit": "PV moves while OP stands at an extreme (0 % of its movement)",
    "integral_share": "the controller mostly follows PV in proportion",
    "together_quarter": "over a quarter of a swing PV moves when OP moves",
}


def older_sentence(name: str, speaks_for: bool) -> str | None:
    """What engines up to 0.1.18 said of a shape on that side, 0 in place of its value; None where they said what is
    said now, or nothing."""
    return (_FOR if speaks_for else _AGAINST).get(name)
