"""Scans that a historian was asked for more often than they were made: each of their values stands several times."""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.fitness.config import FitnessConfig
from app.engine.fitness.resample import is_regular, typical_interval
from app.engine.recording import BoolArray, FloatArray, IntArray, Recording

# By chance so many moves fall on every second sample in one record of a million.
_FEWEST_MOVES = 20
# Of the moves: one that came a sample late, or by hand, makes no scan of each sample.
_ON_SCANS = 0.98


@dataclass(frozen=True, eq=False)
class Scanned:
    """A recording with one sample a scan, and how many it had of each (1: as it came)."""

    recording: Recording
    repeats: int


def once_a_scan(recording: Recording, config: FitnessConfig) -> Scanned:
    """A recording whose PV and OP move on every `repeats`-th sample only, with one sample a scan: the last values that
    it had before the next one, at the time when PV may move.

    All that is counted in samples counts what was measured then: a scan of 10 s exported each second is the record that
    it would have been each 10 s. As it came where either moves on other samples, or too seldom to tell.
    """
    ticks = _ticks(recording.time_s, config)
    if ticks is None:
        return Scanned(recording, 1)
    pv, op = _moves(recording.pv, ticks), _moves(recording.op, ticks)
    if min(len(pv), len(op)) < _FEWEST_MOVES:
        return Scanned(recording, 1)
    repeats = int(np.argmax(np.bincount(np.diff(pv))))
    if repeats < 2 or not (_on_one_phase(pv, repeats) and _on_one_phase(op, repeats)):
        return Scanned(recording, 1)
    return Scanned(_last_of_each(recording, ticks - _phase(pv, repeats), repeats), repeats)


def _ticks(time_s: FloatArray, config: FitnessConfig) -> IntArray | None:
    """(N,) the place of each sample on the even clock that `time_s` (N,) in s shows; None where it shows none."""
    if len(time_s) <= _FEWEST_MOVES or not np.all(np.isfinite(time_s)):
        return None
    if is_regular(time_s, config):
        return np.arange(len(time_s))
    intervals = np.diff(time_s) / typical_interval(time_s)
    whole = np.rint(intervals)
    if np.any(whole < 1.0) or np.any(np.abs(intervals - whole) > config.off_clock):
        return None
    return np.concatenate(([0], np.cumsum(whole))).astype(np.int64)


def _moves(signal: FloatArray, ticks: IntArray) -> IntArray:
    """The ticks at which `signal` (N,) is not what it was one tick before."""
    before, after = signal[:-1], signal[1:]
    moved = np.isfinite(before) & np.isfinite(after) & (before != after) & (np.diff(ticks) == 1)
    return ticks[1:][moved]


def _phase(moves: IntArray, repeats: int) -> int:
    return int(np.argmax(np.bincount(moves % repeats)))


def _on_one_phase(moves: IntArray, repeats: int) -> bool:
    return bool(np.mean(moves % repeats == _phase(moves, repeats)) >= _ON_SCANS)


def _last_of_each(recording: Recording, since: IntArray, repeats: int) -> Recording:
    """One sample of each scan that has any, without one that the recording begins amid. since: (N,) ticks from the
    first scan on, below 0 before it.
    """
    scan = since // repeats
    whole = scan > scan[0] if since[0] % repeats else np.ones(len(scan), dtype=np.bool_)
    starts = np.flatnonzero(whole & np.concatenate(([True], np.diff(scan) > 0)))
    part, first = recording.part(whole), starts - int(starts[0])
    late = (since[starts] % repeats) * typical_interval(recording.time_s)

    def last(signal: FloatArray) -> FloatArray:
        return signal[_last_known(np.isfinite(signal), first)]

    rest = recording.part(starts)
    automatic = part.automatic
    return replace(
        rest,
        time_s=recording.time_s[starts] - late,
        pv=last(part.pv),
        op=last(part.op),
        sp=None if part.sp is None else last(part.sp),
        automatic=None if automatic is None else np.logical_and.reduceat(automatic, first),
    )


def _last_known(known: BoolArray, first: IntArray) -> IntArray:
    """The last True of `known` (N,) from each of `first` (K,) up to the next; where there is none the first."""
    places = np.where(known, np.arange(len(known)), -1)
    found: IntArray = np.maximum(np.maximum.reduceat(places, first), first)
    return found
