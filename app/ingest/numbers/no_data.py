"""What stands for 'no data': codes, and words, that historians and instruments write in the place of a value."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.ingest.model import FloatArray
from app.ingest.numbers.writing import SENTINELS
from app.ingest.rejecting import RejectLog

NO_WORD = frozenset(("", "-", "null", "none", "na", "n/a"))
"""What is written where there is nothing; `nan` is a number that is none."""
_NINES = [10.0**digits - 1 for digits in range(4, 10)]
_CODES = np.array(
    [
        *SENTINELS,
        -999.0,
        -999.25,
        999.25,
        -9999.25,
        9999.25,
        *_NINES,
        *(-nines for nines in _NINES),
        32767,
        -32768,
        -32767,
        65535,
    ]
)
_HUGE = 1e30  # of single and double precision's ends: no signal has such values
_FAR = 3.0
_SHOWN = 5


@dataclass(frozen=True)
class Span:
    """What a tag's other values reach from and to; nothing where `low` is above `high`."""

    low: float = np.inf
    high: float = -np.inf

    def with_values(self, values: FloatArray) -> "Span":
        if not len(values):
            return self
        return Span(min(self.low, float(values.min())), max(self.high, float(values.max())))


NO_SPAN = Span()


@dataclass
class NoData:
    """What was refused as no data, to be told."""

    times: Counter[float] = field(default_factory=Counter)

    def refused(
        self,
        values: FloatArray,
        lines: NDArray[np.integer[Any]],
        tag: str,
        log: RejectLog,
        span: Span = NO_SPAN,
        alone: bool = False,
    ) -> FloatArray:
        """(n,) values of a tag, NaN in the place of codes. alone: also where it has nothing else: a PV that stands
        still on one of them is none, an OP or a set point may be."""
        found = stand_for_nothing(values, span, alone)
        at = np.flatnonzero(found)
        if not len(at):
            return values
        codes, times = np.unique(values[at], return_counts=True)
        self.times.update(dict(zip(codes.tolist(), times.tolist(), strict=True)))
        texts = (f"{values[row]:g} stands for no data" for row in at)
        log.add_many("sentinel", [int(line) for line in lines[at]], texts, tag)
        return np.where(found, np.nan, values)

    def notes(self) -> list[str]:
        shown = ", ".join(f"{code:g} ({times})" for code, times in self.times.most_common(_SHOWN))
        what = "numbers far from their tag's others, or the only ones of a PV, were refused as codes for no data"
        return [f"{what}: {shown}"] if shown else []


def are_codes(values: FloatArray) -> NDArray[np.bool_]:
    """(n,) whether a number may be a code: by itself, whatever its tag's others are."""
    return np.isin(values, _CODES) | ((np.abs(values) >= _HUGE) & np.isfinite(values))


def ends_are_codes(lowest: FloatArray, highest: FloatArray) -> NDArray[np.bool_]:
    """(m,) by the least and the greatest value of each tag, whether codes may stand apart in it: one that does is an
    end."""
    return are_codes(lowest) | are_codes(highest)


def stand_for_nothing(values: FloatArray, span: Span = NO_SPAN, alone: bool = False) -> NDArray[np.bool_]:
    """(n,) where codes stand apart from a tag's other values, those of `span` included: 9999 among values around 10000
    is a value. Of a tag that has nothing else, a code that can be a value is one, unless `alone`."""
    found = are_codes(values)
    if not np.any(found):
        return found
    span = span.with_values(values[np.isfinite(values) & ~found])
    kept = [code for code in np.unique(values[found]) if not _stands_apart(float(code), span, alone)]
    return found & ~np.isin(values, kept)


def _stands_apart(code: float, others: Span, alone: bool) -> bool:
    """A sentinel lies further from the others than they lie from each other, other codes are much further away and much
    larger."""
    if abs(code) >= _HUGE:
        return True
    if others.low > others.high:
        return alone or code in SENTINELS
    width = others.high - others.low
    away = max(others.low - code, code - others.high)
    if code in SENTINELS:
        return away > width
    return away > _FAR * width and abs(code) > _FAR * max(abs(others.low), abs(others.high))
