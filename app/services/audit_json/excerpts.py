"""What is kept of OP and SP, between the engine and a few hundred characters of JSON."""

import base64
import json
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from app.engine.plant_wide.excerpts import LENGTH, Excerpts
from app.engine.recording import FloatArray, Steps
from app.json_texts import short_json
from app.services.moments import FIRST_DATED

if TYPE_CHECKING:  # an audit of files stores nothing
    from app.storage.verdicts import ExcerptsRow

STEPS = 60_000


def as_json(kept: Excerpts) -> str:
    told = {
        "interval_s": kept.interval_s,
        "numbers": kept.numbers.tolist(),
        "op": None if kept.op is None else _packed(kept.op),
        "sp": None if kept.sp is None else _packed(kept.sp),
    }
    return short_json(told).decode()


def from_json(text: str) -> Excerpts:
    """With OP and SP on other scales, which the comparison does not look at."""
    told = json.loads(text)
    op, sp = (None if told[name] is None else _unpacked(told[name]) for name in ("op", "sp"))
    return Excerpts(told["interval_s"], np.array(told["numbers"], np.int64), op, sp)


def by_tag(rows: Sequence["ExcerptsRow"]) -> dict[str, Excerpts]:
    """Those of records without a date have no clock that others share."""
    found = {}
    for row in rows:
        kept = from_json(row.excerpts_json)
        if kept.numbers[0] * LENGTH * kept.interval_s >= FIRST_DATED.timestamp():
            found[row.tag] = kept
    return found


def _packed(values: FloatArray | Steps) -> str:
    """In steps of the range, by halves first: the range of -1e308 to 1e308 is no number."""
    low, high = 0.5 * float(np.min(values)), 0.5 * float(np.max(values))
    share = (0.5 * values - low) / (high - low) if high > low else np.zeros_like(values)
    return base64.b64encode(np.rint(STEPS * share).astype("<u2").tobytes()).decode()


def _unpacked(text: str) -> Steps:
    """In the steps that were kept: a quarter of what the excerpts of a plant would take as numbers of 64 bits."""
    return np.frombuffer(base64.b64decode(text), dtype="<u2").reshape(-1, LENGTH)
