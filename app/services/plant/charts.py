"""What the charts of a loop show: made from the stored samples and the stored verdict when somebody looks."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

import numpy as np

from app.engine.fitness import FitnessConfig
from app.engine.fitness.align import align
from app.engine.fitness.holes import newest_even
from app.engine.fitness.signals import resolution, usable_values
from app.engine.freerun import position_over_gaps
from app.engine.recording import Recording, UniformRecord
from app.engine.reference import yper
from app.engine.signals.extremes import extremes
from app.errors import DataError
from app.ingest import carried
from app.nanoseconds import NS_PER_S
from app.services.audit_json.numbers import listed
from app.services.audit_json.spectra import spectra
from app.services.backend import Backend
from app.services.damage import damage_in_words
from app.services.loops import find
from app.services.moments import iso_utc, moment_of, ns_of
from app.services.plant.loop_verdicts import verdict_detail
from app.services.plant.standing import judged_part, where_pv_stands
from app.storage import series, verdicts
from app.storage.samples import FloatArray, Samples

POINTS = 2400
SCATTERED = 1500
BINS = 41
MARGIN = 0.05
LEAST_OF_SPECTRUM = 16
MOST_HOLES = 500

_FITNESS = FitnessConfig()


@dataclass(frozen=True, eq=False)
class _Record:
    """Stored samples about the audited window. inside: (n,) True in the window; judged: in the stretch of it that
    speaks for it, which is all of it unless the record is long; standing: where OP travels and PV stands."""

    samples: Samples
    pv: FloatArray
    op: FloatArray
    sp: FloatArray | None
    inside: np.ndarray
    judged: np.ndarray
    standing: np.ndarray


@dataclass(frozen=True, eq=False)
class _Drawn:
    """What is drawn of a verdict's samples; None: nothing of them is there. window: ISO 8601 from and to."""

    record: _Record | None
    window: list[str] | None
    damage: str | None = None


def charts(backend: Backend, tag: str, audit_id: str | None = None) -> dict[str, Any]:
    """Trend with the valve's estimated position, PV over OP, control errors, spectra, RMSE over d and over (S, J).

    damage: what of the stored samples cannot be read, in words; the rest is drawn."""
    detail = verdict_detail(backend, tag, audit_id)
    drawn = _drawn(backend, tag, audit_id, detail)
    record, window, valve = drawn.record, drawn.window, _valve(detail)
    told: dict[str, Any] = {"window": window, "rmse_d": _curve(detail), "rmse_sj": _surface(detail), "valve": valve}
    told |= {"judged": judged_stretch(window, detail), "size": _size(detail), "damage": drawn.damage}
    if record is None:
        return told | {"trend": None, "pv_op": None, "errors": None, "spectra": detail.get("spectra")}
    return told | {
        "trend": _trend(record, valve),
        "pv_op": _scatter(record),
        "errors": _errors(record),
        "spectra": detail.get("spectra") or _spectra(record),
    }


def closer(backend: Backend, tag: str, start: datetime, end: datetime) -> dict[str, Any]:
    """The trend of `charts` from `start` to `end` alone, with a sample beyond either end: of an hour out of a day all
    samples, where the day is thinned to what a screen shows."""
    detail = verdict_detail(backend, tag)
    record = _drawn(backend, tag, None, detail).record
    if record is None:
        return {"trend": None}
    first = int(np.searchsorted(record.samples.time_ns, ns_of(start)))
    last = int(np.searchsorted(record.samples.time_ns, ns_of(end), side="right"))
    part = slice(max(first - 1, 0), last + 1)
    return {"trend": _trend(record, _valve(detail), part)}


def _drawn(backend: Backend, tag: str, audit_id: str | None, detail: dict[str, Any]) -> _Drawn:
    row = find(backend, tag)
    with backend.database.read() as connection:
        given = verdicts.input_of(connection, row.id, int(audit_id) if audit_id else row.newest_audit_id or 0)
        if given is None or given.input_start_ns is None or given.input_end_ns is None:
            return _Drawn(None, None)
        margin = int(MARGIN * (given.input_end_ns - given.input_start_ns))
        start_ns, end_ns = given.input_start_ns - margin, given.input_end_ns + margin
        found = series.readable(connection, row.id, start_ns, end_ns, backend.settings.hold_days)
    samples, damage = found.samples, damage_in_words(found.damaged, backend.clock) or None
    window: list[str] | None = None
    window_ns = given.input_start_ns, given.input_end_ns
    if given.window_start is not None and given.window_end is not None:
        window = [iso_utc(given.window_start) or "", iso_utc(given.window_end) or ""]
        window_ns = ns_of(given.window_start), ns_of(given.window_end)
    if samples is None or len(samples) < 2:
        return _Drawn(None, window, damage)
    return _Drawn(_together(samples, window_ns, detail, judged_stretch(window, detail)), window, damage)


def judged_stretch(window: list[str] | None, detail: Mapping[str, Any]) -> list[str] | None:
    """From when to when the stretch is that speaks for a long record; None where the window is judged as a whole."""
    part = judged_part(detail)
    if window is None or part is None:
        return None
    origin = datetime.fromisoformat(window[0]) - timedelta(seconds=detail["window"]["start_s"])
    return [iso_utc(origin + timedelta(seconds=part[name])) or "" for name in ("start_s", "end_s")]


def _size(detail: dict[str, Any]) -> dict[str, float] | None:
    """S with its interval (units of OP), where the record tells it."""
    size = detail.get("stiction_size") or {}
    if not size.get("identifiable"):
        return None
    widest = size["S_intervals"][-1]
    return {"S": size["S"], "low": widest["low"], "high": widest["high"]}


def _together(
    samples: Samples, window_ns: tuple[int, int], detail: dict[str, Any], stretch: list[str] | None
) -> _Record:
    """The samples with PV and OP side by side, also where they came at times of their own."""
    pv, op, sp = (_usable(samples.signals.get(name)) for name in ("pv", "op", "sp"))
    missing = np.full(len(samples), np.nan)
    sp = None if sp is None else carried(sp)
    time_s = (samples.time_ns - samples.time_ns[0]) / NS_PER_S
    recording = Recording("", time_s, missing if pv is None else pv, missing if op is None else op)
    joined = align(recording, _FITNESS)
    shown = joined.both if joined.interpolated else np.full(len(samples), True)
    times = samples.part(shown)
    sp = None if sp is None else sp[shown]
    pv, op, inside = joined.pv[shown], joined.op[shown], _between(times.time_ns, *window_ns)
    judged = inside
    if stretch is not None:
        judged = inside & _between(times.time_ns, *(ns_of(datetime.fromisoformat(end)) for end in stretch))
    return _Record(times, pv, op, sp, inside, judged, where_pv_stands(times.time_ns, pv, op, judged, detail))


def _between(time_ns: np.ndarray, first_ns: int, last_ns: int) -> np.ndarray:
    return (time_ns >= first_ns) & (time_ns <= last_ns)


def _usable(signal: FloatArray | None) -> FloatArray | None:
    """What the audit takes for missing is missing in its charts: one bad-value marker would be all they show."""
    return None if signal is None else np.where(usable_values(signal), signal, np.nan)


def _valve(detail: dict[str, Any]) -> dict[str, float] | None:
    """The S and J to show the valve with: the quantified S, which has no J, where there is one; else the best of the
    grid.
    """
    S, J = (detail.get("stiction_size") or {}).get("S"), 0.0
    if S is None and detail["rungs"] and detail["rungs"][-1]["two_parameter"]:
        two = detail["rungs"][-1]["two_parameter"]
        S, J = two["S"][two["best"]], two["J"][two["best"]]
    return {"S": S, "J": J} if S else None


def _trend(record: _Record, valve: dict[str, float] | None, part: slice = slice(None)) -> dict[str, Any]:
    """shown of samples: how many are drawn of how many there are."""
    # The valve's position hangs on where OP has been before: it is worked out for the whole, whatever is shown of it.
    position = None if valve is None else position_over_gaps(record.op, valve["S"], valve["J"])
    drawn = {"pv": record.pv, "op": record.op, "sp": record.sp, "valve": position}
    given = {name: signal[part] for name, signal in drawn.items() if signal is not None}
    time_ns = record.samples.time_ns[part]
    n = len(time_ns)
    kept = np.arange(n) if n <= POINTS else extremes(list(given.values()), n, POINTS)
    holes = _holes(time_ns, float(np.median(np.diff(record.samples.time_ns))))
    # A moment without values within each hole breaks the lines there.
    where, at = np.searchsorted(kept, holes, side="right"), (time_ns[holes] + time_ns[holes + 1]) // 2
    time = [iso_utc(moment_of(int(t))) for t in np.insert(time_ns[kept], where, at)]
    lines = {name: listed(np.insert(signal[kept], where, np.nan)) for name, signal in given.items()}
    standing = np.insert(record.standing[part][kept], where, False).astype(int).tolist()
    return {"samples": n, "shown": len(kept), "time": time, **lines, "standing": standing}


def _holes(time_ns: np.ndarray, interval_ns: float) -> np.ndarray:
    """The samples (H,) behind which the audit sees a hole that is wide enough to be seen in a chart. interval_ns: the
    usual one of the whole record, because a part may be little else than a hole."""
    steps = np.diff(time_ns)
    if not len(steps):
        return np.empty(0, np.int64)
    least = max(_FITNESS.max_gap_intervals * interval_ns, float(time_ns[-1] - time_ns[0]) / MOST_HOLES)
    return np.flatnonzero(steps > least)


def _scatter(record: _Record) -> dict[str, Any]:
    """Of what was judged: shown of samples, the newest ones in a row."""
    places = np.flatnonzero(record.judged & np.isfinite(record.pv) & np.isfinite(record.op))
    samples = len(places)
    # The newest ones in a row, not every tenth: it is the path from point to point that shows a sticking valve.
    places = places[-SCATTERED:]
    path = {"op": listed(record.op[places]), "pv": listed(record.pv[places])}
    standing = record.standing[places].astype(int).tolist()
    return {"samples": samples, "shown": len(places), **path, "standing": standing}


def _errors(record: _Record) -> dict[str, Any] | None:
    if record.sp is None:
        return None
    error = (record.sp - record.pv)[record.inside]
    error = error[np.isfinite(error)]
    if len(error) < 2 or np.ptp(error) <= resolution(error):
        return None
    count, edges = np.histogram(error, BINS)
    return {"middle": listed((edges[1:] + edges[:-1]) / 2), "share_pct": listed(100.0 * count / len(error))}


def _spectra(record: _Record) -> dict[str, Any] | None:
    """As the audit stores them, for a verdict that was reached without the published identification."""
    even = _evenly(record)
    if even is None:
        return None
    try:
        return spectra(yper.compute(even.pv, even.op, even.sampling_interval_s))
    except DataError:
        return None


def _evenly(record: _Record) -> UniformRecord | None:
    """PV and OP in the window as an audit takes them: the newest long stretch without a hole on a uniform time base,
    because a spectrum by the number of the sample has lines that no signal has; None where they are too few.
    """
    known = np.flatnonzero(record.inside & np.isfinite(record.pv) & np.isfinite(record.op))
    time_s = (record.samples.time_ns[known] - record.samples.time_ns[known[:1]]) / NS_PER_S
    return newest_even(time_s, record.pv[known], record.op[known], LEAST_OF_SPECTRUM, _FITNESS)


def _curve(detail: dict[str, Any]) -> dict[str, Any] | None:
    """RMSE over the stiction band, as the last rung of the ladder found it."""
    if not detail["rungs"]:
        return None
    curve = detail["rungs"][-1]["one_parameter"]
    return {name: curve[name] for name in ("d", "rmse", "best")}


def _surface(detail: dict[str, Any]) -> dict[str, Any] | None:
    if not detail["rungs"] or not detail["rungs"][-1]["two_parameter"]:
        return None
    return {name: detail["rungs"][-1]["two_parameter"][name] for name in ("S", "J", "rmse", "best")}
