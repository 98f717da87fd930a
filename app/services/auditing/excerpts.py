"""What is kept of OP and SP, between the engine and a few hundred characters of JSON."""

import base64
import json
from collections.abc import Iterable
from typing import Any

import numpy as np

from app.engine.excerpts import LENGTH, Excerpts
from app.engine.recording import Array32, FloatArray

STEPS = 60_000


def as_json(kept: Excerpts) -> str:
    told = {
        "interval_s": kept.interval_s,
        "numbers": kept.numbers.tolist(),
        "op": None if kept.op is None else _packed(kept.op),
        "sp": None if kept.sp is None else _packed(kept.sp),
    }
    return json.dumps(told, separators=(",", ":"))


def from_json(text: str) -> Excerpts:
    """With OP and SP on other scales, which the comparison does not look at."""
    told = json.loads(text)
    op, sp = (None if told[name] is None else _unpacked(told[name]) for name in ("op", "sp"))
    return Excerpts(told["interval_s"], np.array(told["numbers"], np.int64), op, sp)


def by_tag(rows: Iterable[Any]) -> dict[str, Excerpts]:
    """Of rows of `verdicts.excerpts`."""
    return {row.tag: from_json(row.excerpts_json) for row in rows}


def _packed(values: FloatArray | Array32) -> str:
    """In steps of the range, by halves first: the range of -1e308 to 1e308 is no number."""
    low, high = 0.5 * float(np.min(values)), 0.5 * float(np.max(values))
    share = (0.5 * values - low) / (high - low) if high > low else np.zeros_like(values)
    return base64.b64encode(np.rint(STEPS * share).astype("<u2").tobytes()).decode()


def _unpacked(text: str) -> Array32:
    """Exact in 32 bits, half of what the excerpts of a plant would take in 64."""
    return np.frombuffer(base64.b64decode(text), dtype="<u2").astype(np.float32).reshape(-1, LENGTH)
