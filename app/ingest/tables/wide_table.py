"""Reads a wide table: a row an instant, a column a tag. Columns of a chunk share one array of times."""

from collections.abc import Collection, Iterable, Iterator
from dataclasses import replace
from itertools import chain

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.columns.dates_once import DatesOnce
from app.ingest.columns.fractions import with_parts
from app.ingest.columns.plans import TimedColumns, ValueColumn, WidePlan, name_of
from app.ingest.model import NO_TIME, FloatArray, IngestOptions, SignalBlock, TimeArray
from app.ingest.numbers.evidence import Evidence
from app.ingest.numbers.values import same_tag
from app.ingest.rejecting import RejectLog
from app.ingest.tables.blank_cells import are_blank, without_blanks
from app.ingest.tables.frames import TOO_NARROW, RowReader, Rows
from app.ingest.tables.further_names import FurtherNames
from app.ingest.tables.kinds_seen import KindsSeen
from app.ingest.tables.pieces import Grid, joined_grid
from app.ingest.tables.spilling import NumberOfLoop, Spill
from app.ingest.tables.spreading import Spreader
from app.ingest.tables.tally import Tally, UnsettledError
from app.ingest.tables.wide_chunk import Chunk, WholeStamps
from app.ingest.tables.wide_values import WideValues
from app.ingest.tags.grouping import AUDITED
from app.ingest.tags.loops import Grouping
from app.ingest.tags.quality import Quality
from app.ingest.times.doubled_hour import hours_apart
from app.ingest.times.order import are_shuffled, in_order, last_of_repeats, runs_back, without_stutter
from app.ingest.times.set_back import Border
from app.ingest.times.time_reader import TimeReader


class WideTable:
    """Turns rows into blocks of signals."""

    def __init__(
        self, plan: WidePlan, grouping: Grouping, options: IngestOptions, log: RejectLog, tally: Tally
    ) -> None:
        self._plan, self._grouping, self._options, self._log, self._tally = plan, grouping, options, log, tally
        self._times = [TimeReader(group.form, options) for group in plan.groups]
        self._dates = [DatesOnce(group.time) for group in plan.groups]
        if not tally.again:
            tally.quality = Quality()
        self._holding: list[Spreader | WholeStamps] = []  # back what goes on in the next chunk, by group
        self._borders: dict[int, Border] = {}  # by group, of the chunk that was read last
        self._forth = np.zeros((len(plan.groups), 2), dtype=np.int64)  # by group, steps of time forth and back
        self._further_names = FurtherNames(plan.names, plan.groups)
        grouping.place_all(value.tag for group in plan.groups for value in group.values)
        self._places = {value.index: grouping.place(value.tag) for group in plan.groups for value in group.values}
        self._judging = {v.may_judge for group in plan.groups for v in group.values if v.may_judge is not None}
        self._values = WideValues(self._places, self._judging, log, tally)
        self._group_of = {value.index: number for number, group in enumerate(plan.groups) for value in group.values}
        self._kinds = KindsSeen()
        self._first_columns = {group.values[0].index for group in plan.groups if group.values}
        number_of_loop = NumberOfLoop()
        self._loop_of_column = np.zeros(1 + max(self._places, default=0), dtype=np.uint32)
        self._is_audited = np.zeros(len(self._loop_of_column), dtype=np.bool_)
        for index, place in self._places.items():
            self._loop_of_column[index] = number_of_loop.of(place.loop)
            self._is_audited[index] = place.signal in AUDITED

    def types(self) -> dict[int, pl.DataType]:
        """The type in which each column is wanted from the text."""
        types: dict[int, pl.DataType] = {}
        for group in self._plan.groups:
            types.update(dict.fromkeys(_columns_of_times(group), pl.String()))
            for value in group.values:
                types[value.index] = pl.String() if self._values.is_mode(value) else pl.Float64()
                if value.off_line is not None:
                    types[value.off_line] = pl.Float64()
                if value.quality is not None:
                    types[value.quality] = pl.String()
        return types

    def batches(self, reader: RowReader) -> Iterator[list[SignalBlock]]:
        """Blocks, with all that the file holds of a loop in one batch."""
        passes = list(self._passes(reader))
        if len(passes) > 1 and not self._tally.again:
            self._look_ahead(reader, passes)
        for number, groups in enumerate(passes):
            yield from self._one_pass(reader, groups, first=number == 0, alone=len(passes) == 1)
        self._tally.wordy += self._values.wordy()
        others_judge = any(value.quality is not None for group in self._plan.groups for value in group.values)
        unknown = self._values.late_qualities.unknown(others_judge)
        self._tally.unknown_qualities = [self._places[at].tag for at in sorted(unknown)]

    def _passes(self, reader: RowReader) -> Iterator[list[TimedColumns]]:
        """The groups with the columns of so many loops as the reader can give at once: all, unless it reads columns
        apart from each other."""
        most = reader.most_columns
        if most is None or len(self._places) <= most:
            yield list(self._plan.groups)
            return
        loops = list(dict.fromkeys(place.loop for place in self._places.values()))
        each = max(1, most * len(loops) // len(self._places))
        pass_of = {loop: number // each for number, loop in enumerate(loops)}
        own: list[list[list[ValueColumn]]] = [[[] for _ in self._plan.groups] for _ in range(0, len(loops), each)]
        for number, group in enumerate(self._plan.groups):
            for value in group.values:
                own[pass_of[self._places[value.index].loop]][number].append(value)
        for values in own:
            yield [replace(group, values=tuple(v)) for group, v in zip(self._plan.groups, values, strict=True)]

    def _look_ahead(self, reader: RowReader, passes: list[list[TimedColumns]]) -> None:
        """Of several passes the first ones give blocks away before the others are read: columns that may be read
        otherwise once all rows are known are read ahead. Raises UnsettledError where there are any."""
        doubtful = [list(self._in_doubt(reader, groups)) for groups in passes]
        doubtful = [groups for groups in doubtful if any(group.values for group in groups)]
        for groups in doubtful:
            for _ in self._chunks(reader, groups, first=False):
                pass
        if doubtful:
            self._values.late_qualities.teach(self._tally.quality)
            raise UnsettledError

    def _in_doubt(self, reader: RowReader, groups: list[TimedColumns]) -> Iterator[TimedColumns]:
        """The groups with the columns of text, of values that are judged, and of what may judge others."""
        for group in groups:
            texts = reader.of_text([value.index for value in group.values])
            asked = (v for v in group.values if v.index in texts or v.quality is not None or v.index in self._judging)
            yield replace(group, values=tuple(asked))

    def late_qualities(self) -> frozenset[int]:
        """Columns that all rows tell to be qualities, though the first ones do not."""
        return self._values.late_qualities.found()

    def tell(self, reader: RowReader, evidence: Evidence) -> None:
        """What all rows tell of how the numbers of its tags are written."""
        columns = self._tags_of(evidence.tags)
        for rows in reader.rows(self._plan.first_row, _columns(self._plan.groups)):
            numbers, texts = rows.numbers(list(columns)), reader.texts(rows, list(columns))
            for (index, tag), missing in zip(columns.items(), numbers.missing.T, strict=True):
                of_column = texts[name_of(index)]
                evidence.add(same_tag(tag, len(of_column)), of_column, missing | rows.doubtful(index, of_column))

    def kinds(self) -> dict[str, int]:
        """Of the fields of tags whose marks were in doubt, as far as they were seen."""
        return self._kinds.of({tag: at for at, tag in self._tags_of(self._tally.writing.marks.met()).items()})

    def _tags_of(self, tags: Collection[str]) -> dict[int, str]:
        wanted = set(tags)
        return {
            value.index: value.tag
            for group in self._plan.groups
            for value in group.values
            if value.tag in wanted and not self._values.is_mode(value)
        }

    def _one_pass(
        self, reader: RowReader, groups: list[TimedColumns], first: bool, alone: bool
    ) -> Iterator[list[SignalBlock]]:
        """`first`: rows and their times are counted, and refused, once for all passes. alone: it is the only one, and
        may be made again."""
        spill: Spill | None = None
        held: list[list[Grid]] = [[] for _ in groups]
        self._tally.contradictions = self._tally.contradictions.of_other_columns()
        try:
            for number, chunk in self._chunks(reader, groups, first):
                held[number].append(self._grid(chunk, number))
                if sum(map(len, chain.from_iterable(held))) >= self._options.buffered_values:
                    spill = spill or Spill(self._options.spill_folder, self._options.buffered_values)
                    self._put_aside(spill, held)
            if alone:
                self._values.late_qualities.teach(self._tally.quality)
                self._tally.check_settled(self.kinds(), not self.late_qualities())
            self._tally.modes.settle(self._log)
            if spill is None:
                yield list(self._blocks(chain.from_iterable(held)))
                return
            self._put_aside(spill, held)
            for part in spill.parts():
                yield list(self._blocks(piece for piece in part if isinstance(piece, Grid)))
        finally:
            if spill is not None:
                spill.close()

    def _put_aside(self, spill: Spill, held: list[list[Grid]]) -> None:
        for grids in held:
            for grid in grids:
                spill.add(grid, self._loop_of_column)
            grids.clear()

    def _chunks(self, reader: RowReader, groups: list[TimedColumns], first: bool) -> Iterator[tuple[int, Chunk]]:
        """Chunks of each group, with the group's number."""
        self._times = [TimeReader(group.form, self._options) for group in self._plan.groups]
        self._dates = [DatesOnce(group.time) for group in self._plan.groups]
        self._further_names = FurtherNames(self._plan.names, groups)
        resolutions = [group.form.resolution_ns for group in groups]
        self._borders = {}
        self._holding = [Spreader(of_form) if self._plan.spread else WholeStamps() for of_form in resolutions]
        for rows in reader.rows(self._plan.first_row, _columns(groups)):
            self._tally.rows_read += rows.filled if first else 0
            short = self._short_rows(rows, reader)
            for number, group in enumerate(groups):
                chunk = self._chunk(rows, number, group, reader, short, first) if group.values else None
                if chunk is not None:
                    yield number, chunk
            self._kinds.see(rows.kinds, self._plan.width)
            self._tally.writing.end_chunk()
        self._tally.in_other_order = self._times[0].in_other_order
        self._tally.without_date = self._dates[0].carried
        self._tally.lacks_half = any(times.half_clock.lacks_half for times in self._times)
        for number, holding in enumerate(self._holding):
            rest = holding.rest()
            if rest is not None:
                yield number, rest

    def _short_rows(self, rows: Rows, reader: RowReader) -> NDArray[np.int64]:
        """Rows cut short lost the place of their fields: none of them is kept."""
        short = reader.short_rows(rows, rows.may_be_short())
        if len(short):
            self._log.add_many(
                "ragged_row", rows.lines(short), (f"fewer than {self._plan.width} fields" for _ in short)
            )
        return short

    def _chunk(
        self,
        rows: Rows,
        number: int,
        group: TimedColumns,
        reader: RowReader,
        short: NDArray[np.int64],
        first: bool,
    ) -> Chunk | None:
        texts, time_ns = self._dates[number].read(rows.frame, self._times[number].read)
        texts, time_ns = with_parts(rows.frame, group.fraction, texts, time_ns)
        kept = time_ns != NO_TIME
        if len(short):
            kept[short] = False
        if first and not np.all(kept):
            self._refuse_times(rows, group, texts, kept, short)
        kept &= ~self._below_others(rows, reader, texts, time_ns != NO_TIME, first)
        if not np.any(kept):
            return None
        matrix = self._values.of_chunk(rows, group, reader, kept)
        at = np.flatnonzero(kept)
        if len(at) < len(time_ns):
            time_ns, matrix = time_ns[at], matrix[at]
        if number == 0 and first:
            self._tally.rows_kept += len(at)
        chunk = Chunk(time_ns, at + rows.first, matrix, group.values)
        return self._holding[number].take(chunk)

    def _below_others(
        self, rows: Rows, reader: RowReader, texts: pl.Series, timed: NDArray[np.bool_], first: bool
    ) -> NDArray[np.bool_]:
        """Rows below other names than the first ones, which are refused."""
        below = self._further_names.below_others(rows, reader, texts, timed)
        if first and below.any():
            at = np.flatnonzero(below)
            line = self._further_names.lines[-1]
            words = f"below other names than the first ones, in line {line}: send that part as a file of its own"
            self._log.add_many("other_names", rows.lines(at), (words for _ in at))
        return below

    def _refuse_times(
        self,
        rows: Rows,
        group: TimedColumns,
        texts: pl.Series,
        kept: NDArray[np.bool_],
        short: NDArray[np.int64],
    ) -> None:
        """Rows whose time cannot be read, but for those that hold nothing and comments."""
        texts = texts.cast(pl.String).fill_null("")
        told = (texts.str.strip_chars().str.len_bytes() > 0).to_numpy()
        bad = ~kept & told
        narrow = texts.str.contains(TOO_NARROW).to_numpy()
        asked = np.flatnonzero(~kept & (~told | narrow))
        if len(asked):
            bad[asked] = rows.hold_something(asked, [value.index for value in group.values])
        comments = texts.str.contains("^[*#]").to_numpy() & ~(narrow & bad)
        bad[short] = False
        bad &= ~comments
        if group.time == self._plan.groups[0].time:
            self._tally.comments += int(np.count_nonzero(comments))
        at = np.flatnonzero(bad)
        words = (f"{texts[int(row)]!r} is no time that can be read" for row in at)
        self._log.add_many("bad_time", rows.lines(at), words)

    def _see_steps(self, number: int, time_ns: TimeArray) -> bool:
        """Whether a group's rows come newest first: those of a single stamp do as the ones before."""
        steps = np.diff(time_ns)
        self._forth[number] += (np.count_nonzero(steps > 0), np.count_nonzero(steps < 0))
        return runs_back(time_ns) if np.any(steps) else self._ran_back(number)

    def _ran_back(self, number: int) -> bool:
        forth, back = self._forth[number].tolist()
        return back > 2 * forth

    def _grid(self, chunk: Chunk, number: int) -> Grid:
        time_ns, matrix, lines, zone = chunk.time_ns, chunk.matrix, chunk.lines, self._times[number].wall_zone
        newest_first = self._see_steps(number, time_ns)
        if newest_first:
            self._tally.backward = True
            time_ns, matrix, lines = time_ns[::-1], matrix[::-1], lines[::-1]
        self._look_for_set_back(number, time_ns, matrix, newest_first)
        order, shuffled = in_order(time_ns), are_shuffled(time_ns)
        if order is not None:
            self._tally.backward = True
            time_ns, matrix, lines = time_ns[order], matrix[order], lines[order]
        time_ns = hours_apart(time_ns, zone)
        steady = time_ns if shuffled else without_stutter(time_ns, matrix)  # steps that lack here are in other pieces
        columns = np.array([value.index for value in chunk.columns], dtype=np.uint32)
        is_first = int(columns[0]) in self._first_columns  # rows are told once for all passes
        self._tally.stuttering += int(np.sum(steady != time_ns)) if is_first else 0
        order = in_order(steady)
        if order is not None:
            steady, matrix, lines = steady[order], matrix[order], lines[order]
        audited = self._audited(columns)
        self._tally.contradictions.rows += len(steady) if is_first else 0
        self._tally.contradictions.look(steady, matrix, lines, audited)
        once_ns, matrix = last_of_repeats(steady, matrix, lines, [value.tag for value in chunk.columns], self._log)
        if is_first:
            self._tally.saw_repeats(steady)
        self._tally.saw_times(once_ns)
        self._tally.turns.saw(once_ns, zone)
        self._tally.values_kept += int(np.count_nonzero(np.isfinite(matrix)))
        last = lines[np.append(steady[1:] != steady[:-1], True)].astype(np.uint32)
        return Grid(columns, once_ns, np.ascontiguousarray(matrix.T), last, np.zeros(len(columns), dtype=np.uint32))

    def _look_for_set_back(self, number: int, time_ns: TimeArray, matrix: FloatArray, newest_first: bool) -> None:
        """In a chunk of a group, and between it and the one before it."""
        self._tally.set_back.look(time_ns, matrix)
        piece = Border.of(time_ns, matrix, newest_first)
        self._borders[number] = self._tally.set_back.look_on(self._borders.get(number), piece)

    def _audited(self, columns: NDArray[np.uint32]) -> list[int]:
        """The positions of PV and OP: a number beside them may be that of the plant."""
        return np.flatnonzero(self._is_audited[columns]).tolist()

    def _blocks(self, grids: Iterable[Grid]) -> Iterator[SignalBlock]:
        """Signals whole, but for those without any value. Of a signal that was stored at times of its own the blank
        cells are no samples."""
        by_columns: dict[int, list[Grid]] = {}
        for grid in grids:
            by_columns.setdefault(int(grid.codes[0]), []).append(grid)
        for own in by_columns.values():
            whole = self._values.without_late_codes(self._whole(own))
            given, with_blanks = (
                np.any(cells, axis=1) for cells in (np.isfinite(whole.values), are_blank(whole.values))
            )
            for row in np.flatnonzero(given).tolist():
                place = self._places[int(whole.codes[row])]
                time_ns, values = whole.time_ns, whole.values[row]
                if with_blanks[row]:
                    time_ns, values = without_blanks(time_ns, values, place.signal)
                if place.signal == "MODE":
                    values = self._tally.modes.flags(values, place.tag)
                yield SignalBlock(place.tag, place.loop, place.signal, time_ns, values)

    def _whole(self, grids: list[Grid]) -> Grid:
        """Those of some columns, chunk by chunk, as one. Where time goes back from one to the next, rows may contradict
        those of another chunk, and of a time that is in two of them the later value holds."""
        grids = grids[::-1] if self._ran_back(self._group_of[int(grids[0].codes[0])]) else grids
        whole = joined_grid(grids)
        if whole is not None:
            return whole
        time_ns, lines = (np.concatenate(each) for each in zip(*((at.time_ns, at.lines) for at in grids), strict=True))
        matrix = np.concatenate([grid.values for grid in grids], axis=1).T
        order = in_order(time_ns)
        if order is not None:
            self._tally.backward = True
            time_ns, matrix, lines = time_ns[order], matrix[order], lines[order]
        columns = grids[0].codes.tolist()
        self._tally.contradictions.look(time_ns, matrix, lines, self._audited(grids[0].codes))
        tags = [self._places[column].tag for column in columns]
        once_ns, once = last_of_repeats(time_ns, matrix, lines, tags, self._log)
        if columns[0] in self._first_columns:
            self._tally.saw_repeats(time_ns)
        self._tally.values_kept -= int(np.count_nonzero(np.isfinite(matrix)) - np.count_nonzero(np.isfinite(once)))
        last = lines[np.append(time_ns[1:] != time_ns[:-1], True)]
        return Grid(grids[0].codes, once_ns, np.ascontiguousarray(once.T), last, grids[0].places)


def _columns(groups: Iterable[TimedColumns]) -> list[int]:
    """All columns that the groups need."""
    needed: set[int] = set()
    for group in groups:
        needed.update(_columns_of_times(group), (value.index for value in group.values))
        for value in group.values:
            needed.update(index for index in (value.off_line, value.quality) if index is not None)
    return sorted(needed)


def _columns_of_times(group: TimedColumns) -> tuple[int, ...]:
    return group.time if group.fraction is None else (*group.time, group.fraction.index)
