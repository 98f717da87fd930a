"""Blank cells of a wide table, which hold no sample. They are told from refused values by the bits of their NaN, as R
tells what is missing: every copy keeps them, on disk too, and elsewhere they are NaN like any other."""

import numpy as np
from numpy.typing import NDArray

from app.ingest.align import FEWEST, LONG, SHARED_TIMES, STEPS
from app.ingest.model import FloatArray, Signal, TimeArray

BoolArray = NDArray[np.bool_]

_BITS = np.uint64(0x7FF8_0000_0000_07A2)
BLANK = float(_BITS.view(np.float64))


def are_blank(values: FloatArray) -> BoolArray:
    return np.asarray(values.view(np.uint64) == _BITS)


def without_blanks(time_ns: TimeArray, values: FloatArray, signal: Signal) -> tuple[TimeArray, FloatArray]:
    """Times and values of a signal's samples: its cells (N,) but the blank ones where it was stored at times of its
    own. Else all of them, with blank ones missing as refused values are, in place where that can be."""
    blank = are_blank(values)
    if _stored_apart(blank, signal):
        return time_ns[~blank], values[~blank]
    return time_ns, _missing(values)


def _missing(values: FloatArray) -> FloatArray:
    values = values if values.flags.writeable else values.copy()
    values[are_blank(values)] = np.nan
    return values


def _stored_apart(blank: BoolArray, signal: Signal) -> bool:
    """By row, where a signal's cells are blank: whether it has rows of its own among those of others, as where signals
    that are stored when they change were joined on their times. Blanks lie between its values all along then; a few, of
    whatever length, are holes. What steps may be stored but once; blanks of an OP, if not few, may all be rests, which
    are told from holes where signals are aligned."""
    at = np.flatnonzero(~blank)
    mostly = len(at) < SHARED_TIMES * len(blank)
    if signal in STEPS and mostly:
        return True
    between = int(np.count_nonzero(np.diff(at) > 1))
    if signal == "OP" and between >= FEWEST:
        return True
    return (mostly or between >= FEWEST) and between > (1 - LONG) * len(at)
