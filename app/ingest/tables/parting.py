"""Rows of a long table parted by tag: blocks of signals, in order of time and without what stands for no data."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from app.ingest.model import FloatArray, SignalBlock, TimeArray
from app.ingest.numbers.no_data import ends_are_codes
from app.ingest.rejecting import RejectLog
from app.ingest.tables.pieces import Gathered, Grid, Piece, joined, joined_grid
from app.ingest.tables.spreading import come_in_threes, shown_resolution, spread, stamps_are_cut
from app.ingest.tables.tally import Tally
from app.ingest.tags.grouping import Place
from app.ingest.times.doubled_hour import hours_apart
from app.ingest.times.order import in_order, last_of_repeats, runs_back
from app.ingest.times.time_reader import TimeReader, from_utc

MOST_CODES = 1 << 16


class BlocksByTag:
    """`places`, by the code of a tag, grow while rows are gathered. times: as they were read."""

    def __init__(self, places: list[Place], times: TimeReader, log: RejectLog, tally: Tally) -> None:
        self._places, self._zone, self._resolution_ns = places, times.wall_zone, times.form.resolution_ns
        self._half_clock = times.half_clock
        self._log, self._tally = log, tally

    def parted(self, pieces: Sequence[Piece]) -> Iterator[SignalBlock]:
        """Blocks by tag, the rows of a tag in the order in which they came."""
        if not any(map(len, pieces)):
            return
        self._tally.contradictions.rows += sum(map(len, pieces))
        grid = joined_grid(pieces)
        if grid is not None:
            yield from self._of_grid(grid)
        else:
            yield from self._of_rows(joined([p.rows() if isinstance(p, Grid) else p for p in pieces]))

    def _of_grid(self, grid: Grid) -> Iterator[SignalBlock]:
        """Blocks of tags that were sampled together: they share their times."""
        doubtful = ends_are_codes(np.fmin.reduce(grid.values, axis=1), np.fmax.reduce(grid.values, axis=1))
        self._tally.saw_times(grid.time_ns)
        self._tally.turns.saw(grid.time_ns, self._zone, of_tag=True)
        for row in np.argsort(grid.codes):
            place, values = self._places[grid.codes[row]], grid.values[row]
            if doubtful[row]:
                values = self._without_codes(place, values, grid.lines + grid.places[row])
            yield self._signal(place, grid.time_ns, values)

    def _of_rows(self, rows: Gathered) -> Iterator[SignalBlock]:
        counts = np.bincount(rows.codes, minlength=len(self._places))
        bounds = np.concatenate(([0], np.cumsum(counts)))
        rows = rows.at(np.argsort(_few(rows.codes, counts), kind="stable"))
        time_ns, values, lines = rows.time_ns, rows.values, rows.lines
        odd = self._odd_tags(rows.codes, time_ns, values, counts)
        differ = _differ_in_a_stamp(rows)
        self._tally.saw_times(np.array([time_ns.min(), time_ns.max()]))
        for code in np.flatnonzero(counts):
            part = slice(int(bounds[code]), int(bounds[code + 1]))
            place = self._places[code]
            if odd[code]:
                self._half_clock.look_on(from_utc(time_ns[part], self._zone))
                times = self._spread(time_ns[part]) if differ else time_ns[part]
                yield self._block(place, times, values[part], lines[part])
            else:
                self._tally.turns.saw(time_ns[part], self._zone, of_tag=True)
                yield self._signal(place, time_ns[part], values[part])
        self._tally.lacks_half = self._half_clock.lacks_half

    def _odd_tags(
        self, codes: NDArray[np.uint32], time_ns: TimeArray, values: FloatArray, counts: NDArray[np.int64]
    ) -> NDArray[np.bool_]:
        """By code: whether a tag has times that go back or repeat, or values that may stand for 'no data'. Most have
        neither."""
        odd = np.zeros(len(self._places), dtype=bool)
        same = codes[1:] == codes[:-1]
        odd[codes[1:][same & (time_ns[1:] <= time_ns[:-1])]] = True
        there = np.flatnonzero(counts)
        starts = (np.cumsum(counts) - counts)[there]
        odd[there] |= ends_are_codes(np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts))
        return odd

    def _without_codes(self, place: Place, values: FloatArray, lines: NDArray[np.uint32]) -> FloatArray:
        if place.signal == "MODE":
            return values
        return self._tally.no_data.refused(values, lines, place.tag, self._log, alone=place.signal == "PV")

    def _signal(self, place: Place, time_ns: TimeArray, values: FloatArray) -> SignalBlock:
        self._tally.values_kept += int(np.count_nonzero(np.isfinite(values)))
        if place.signal == "MODE":
            values = self._tally.modes.flags(values, place.tag)
        return SignalBlock(place.tag, place.loop, place.signal, time_ns, values)

    def _spread(self, time_ns: TimeArray) -> TimeArray:
        """A tag's times in the order of its rows; where stamps are cut, spread inside of them. Of two values of a stamp
        the later one holds."""
        resolution_ns = shown_resolution(time_ns, self._resolution_ns)
        if not (stamps_are_cut(time_ns, resolution_ns) and come_in_threes(time_ns)):
            return time_ns
        self._tally.spread = True
        way = slice(None, None, -1 if time_ns[0] > time_ns[-1] else 1)
        return spread(time_ns[way], resolution_ns)[way]

    def _block(self, place: Place, time_ns: TimeArray, values: FloatArray, lines: NDArray[np.uint32]) -> SignalBlock:
        if runs_back(time_ns):
            self._tally.backward = True
            time_ns, values, lines = time_ns[::-1], values[::-1], lines[::-1]
        self._tally.set_back.look(time_ns, values[:, None])
        order = in_order(time_ns)
        if order is not None:
            self._tally.backward = True
            time_ns, values, lines = time_ns[order], values[order], lines[order]
        time_ns = hours_apart(time_ns, self._zone)
        values = self._without_codes(place, values, lines)
        if place.signal != "MODE":
            self._tally.contradictions.look(time_ns, values[:, None], lines)
        once_ns, matrix = last_of_repeats(time_ns, values[:, None], lines, [place.tag], self._log)
        self._tally.saw_repeats(time_ns)
        self._tally.turns.saw(once_ns, self._zone, of_tag=True)
        return self._signal(place, once_ns, matrix[:, 0])


def _differ_in_a_stamp(rows: Gathered) -> bool:
    """Whether some tag has different values in one stamp; rows that were sent twice have not. Tag by tag."""
    again = (rows.codes[1:] == rows.codes[:-1]) & (rows.time_ns[1:] == rows.time_ns[:-1])
    earlier, later = rows.values[:-1][again], rows.values[1:][again]
    return bool(np.any(np.isfinite(earlier) & np.isfinite(later) & (earlier != later)))


def _few(codes: NDArray[np.uint32], counts: NDArray[np.int64]) -> NDArray[np.unsignedinteger]:
    """The codes in as few bits as they need: sixteen are sorted ten times as fast."""
    present = np.flatnonzero(counts)
    if len(present) > MOST_CODES:
        return codes
    short = np.zeros(len(counts), dtype=np.uint16)
    short[present] = np.arange(len(present), dtype=np.uint16)
    return short[codes]
