"""Scans that a historian was asked for more often than they were made: each of their values stands several times."""

from dataclasses import dataclass

import numpy as np

from app.engine.fitness.config import FitnessConfig
from app.engine.fitness.resample import is_regular, typical_interval
from app.engine.recording import FloatArray, IntArray, Recording

# By chance so many moves fall on every second sample in one record of a million.
_FEWEST_MOVES = 20


@dataclass(frozen=True, eq=False)
class Scanned:
    """A recording with one sample a scan, and how many it had of each (1: as it came)."""

    recording: Recording
    repeats: int


def once_a_scan(recording: Recording, config: FitnessConfig) -> Scanned:
    """A recording whose PV and OP move on every `repeats`-th sample only, with the samples on which PV may.

    All that is counted in samples counts what was measured then: a scan of 10 s exported each second is the record that
    it would have been each 10 s. As it came where either moves on other samples, or too seldom to tell.
    """
    ticks = _ticks(recording.time_s, config)
    if ticks is None:
        return Scanned(recording, 1)
    pv, op = _moves(recording.pv, ticks), _moves(recording.op, ticks)
    if min(len(pv), len(op)) < _FEWEST_MOVES:
        return Scanned(recording, 1)
    repeats = int(np.gcd.reduce(np.concatenate((np.diff(pv), np.diff(op)))))
    if repeats < 2:
        return Scanned(recording, 1)
    return Scanned(recording.part((ticks - pv[0]) % repeats == 0), repeats)


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
