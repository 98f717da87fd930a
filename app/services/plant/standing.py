"""What the charts mark of the evidence: the stretch that was judged, and where in it OP travels and PV stands."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from app.engine.features import standing_as_sampled
from app.engine.oscillation import Oscillation
from app.nanoseconds import NS_PER_S
from app.storage.samples import FloatArray

OF_STRETCHES = "stretches"


def judged_part(detail: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """Of a long record the stretch that speaks for it, where its verdict was reached by stretches; else None."""
    if not any(reason["code"] == OF_STRETCHES for reason in detail.get("reasons", ())):
        return None
    return detail.get("identified")


def where_pv_stands(
    time_ns: np.ndarray, pv: FloatArray, op: FloatArray, judged: np.ndarray, detail: Mapping[str, Any]
) -> np.ndarray:
    """(n,) True where OP travels and PV stands, by the engine's own definition, among the samples that are `judged`."""
    found, told = np.zeros(len(pv), np.bool_), detail.get("oscillation")
    if told is None:
        return found
    places = np.flatnonzero(judged & np.isfinite(pv) & np.isfinite(op))
    at_s = (time_ns[places] - time_ns[places[:1]]) / NS_PER_S
    found[places] = standing_as_sampled(at_s, pv[places], op[places], Oscillation(**told))
    return found
