"""What the charts mark of the evidence: the stretch that was judged, and where in it OP travels and PV stands."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from app.engine.features import cycle_samples, standing
from app.engine.oscillation import Oscillation
from app.engine.recording import UniformRecord
from app.nanoseconds import NS_PER_S
from app.storage.samples import FloatArray

FEWEST = 16
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
    places = np.flatnonzero(judged & np.isfinite(pv) & np.isfinite(op))
    found = np.zeros(len(pv), np.bool_)
    told = detail.get("oscillation")
    if told is None or len(places) < FEWEST:
        return found
    oscillation = Oscillation(**told)
    at_s = (time_ns[places] - time_ns[places[0]]) / NS_PER_S
    interval_s = float(np.median(np.diff(at_s)))
    grid = np.arange(0.0, at_s[-1] + 0.5 * interval_s, interval_s)
    even = UniformRecord(
        interval_s,
        np.interp(grid, at_s, pv[places]),
        np.interp(grid, at_s, op[places]),
        None,
        np.zeros(len(grid), np.bool_),
    )
    marked = standing(even.pv, even.op, cycle_samples(even, oscillation))
    found[places] = marked[np.minimum(np.rint(at_s / interval_s).astype(np.int64), len(grid) - 1)]
    return found
