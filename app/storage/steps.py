"""Set points and modes hold until they change: what was known of them before a window begins.

A historian that stores them only when they change has their last change anywhere in the past, and maybe in another
file than PV. Each stored stretch names its last known set point and mode, so that looking back unpacks nothing.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from sqlalchemy import ColumnElement, Connection, select

from app.nanoseconds import NS_PER_DAY
from app.storage.samples import Samples, merged, unpack_stored
from app.storage.tables import AS_RECEIVED, loops, series

HOLDING = {"sp": "sp", "automatic": "mode"}
"""Signals that hold, and how their columns begin."""


class Known(NamedTuple):
    """A value and its time."""

    time_ns: int
    value: float


def last_known(samples: Samples) -> dict[str, Any]:
    """The columns of a stretch's row that name the last value of each signal that holds; None where it has none."""
    columns: dict[str, Any] = {}
    for name, begin in HOLDING.items():
        known = _last(samples, name)
        columns[f"{begin}_ns"], columns[f"{begin}_last"] = (None, None) if known is None else known
    return columns


def known_before(read: Samples, window: Samples) -> dict[str, Known]:
    """The last value of each signal that holds in what was read from before a window, by the signal's name."""
    before = slice(0, int(np.searchsorted(read.time_ns, window.time_ns[0])) if len(window) else 0)
    values = {name: _last(read.part(before), name) for name in HOLDING}
    return {name: value for name, value in values.items() if value is not None}


def led_in(
    connection: Connection,
    cut: Mapping[int, Samples],
    known: Mapping[int, Mapping[str, Known]],
    since: ColumnElement[int] | int,
    hold_days: float,
) -> dict[int, Samples]:
    """Windows by loop, with what held when they began at their first sample, where that has no value of its own.

    known: what was stated from `since` on, before each window. hold_days: what was stated longer before the first
    sample is not known any more.
    """
    found = dict(cut)
    for name, begin in HOLDING.items():
        unknown = [loop_id for loop_id, samples in found.items() if _begins_unknown(samples, name)]
        older = _older(connection, unknown, begin, since)
        for loop_id in unknown:
            stated = {one for one in (older.get(loop_id), known[loop_id].get(name)) if one is not None}
            if not stated:
                continue
            last = max(stated)
            if found[loop_id].time_ns[0] - last.time_ns > hold_days * NS_PER_DAY:
                continue
            torn = min(stated).time_ns == last.time_ns and len(stated) > 1
            value = _at(connection, loop_id, name, last.time_ns) if torn else last.value
            found[loop_id] = _beginning(found[loop_id], name, Known(last.time_ns, value))
    return found


def _last(samples: Samples, name: str) -> Known | None:
    values = samples.signals.get(name)
    if values is None:
        return None
    known = np.flatnonzero(np.isfinite(values))
    if not len(known):
        return None
    return Known(int(samples.time_ns[known[-1]]), float(values[known[-1]]))


def _begins_unknown(samples: Samples, name: str) -> bool:
    return len(samples) > 0 and (name not in samples.signals or bool(np.isnan(samples.signals[name][0])))


def _older(
    connection: Connection, loop_ids: Iterable[int], begin: str, since: ColumnElement[int] | int
) -> dict[int, Known]:
    """The last value before `since`, by loop; of two for one time the one that came later."""
    ids = list(loop_ids)
    if not ids:
        return {}
    other = series.alias()
    at = other.c[f"{begin}_ns"]
    newest = select(other.c.id).where(other.c.loop_id == loops.c.id, at < since)
    last = (at.desc(), other.c.receipt_number.desc(), other.c.id.desc())
    newest = newest.order_by(*last).limit(1).correlate(loops)
    query = (
        select(loops.c.id, series.c[f"{begin}_ns"], series.c[f"{begin}_last"])
        .select_from(loops.join(series, series.c.id == newest.scalar_subquery()))
        .where(loops.c.id.in_(ids))
    )
    return {row[0]: Known(row[1], row[2]) for row in connection.execute(query)}


def _at(connection: Connection, loop_id: int, name: str, time_ns: int) -> float:
    """The value at a time for which stretches have different ones: the later stretch holds."""
    query = select(series.c.id, series.c.packed).where(series.c.loop_id == loop_id)
    query = query.where(series.c.end_ns >= time_ns, series.c.start_ns <= time_ns).order_by(*AS_RECEIVED)
    samples = merged([unpack_stored(row.id, row.packed) for row in connection.execute(query).all()])
    return float(samples.signals[name][np.searchsorted(samples.time_ns, time_ns)])


def _beginning(samples: Samples, name: str, known: Known) -> Samples:
    values = samples.signals.get(name)
    values = np.full(len(samples), np.nan) if values is None else values.copy()
    values[0] = known.value
    signals, held_ns = {**samples.signals, name: values}, {**samples.held_ns, name: known.time_ns}
    return replace(samples, signals=signals, held_ns=held_ns)
