"""Reads a long table: a row a value of one tag. Rows are gathered as numbers and parted by tag, each loop whole."""

import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.columns.dates_once import DatesOnce
from app.ingest.columns.fractions import with_parts
from app.ingest.columns.plans import LongPlan, name_of
from app.ingest.model import NO_TIME, FloatArray, IngestOptions, SignalBlock, TimeArray
from app.ingest.numbers.evidence import Evidence
from app.ingest.numbers.kinds import IN_DOUBT, tells_nothing
from app.ingest.numbers.marks import marked
from app.ingest.numbers.values import odd_numbers, refused_as
from app.ingest.numbers.writing import MARKED
from app.ingest.rejecting import RejectLog
from app.ingest.tables.beside_values import BesideValues
from app.ingest.tables.cells import Cells
from app.ingest.tables.frames import NUMBERED, TOO_NARROW, RowReader, Rows
from app.ingest.tables.kinds_seen import KindsSeen
from app.ingest.tables.numbered_tags import NumberedTags
from app.ingest.tables.parting import BlocksByTag
from app.ingest.tables.pieces import Gathered, as_piece, in_whole_instants, joined
from app.ingest.tables.scanning import Scan, Scanner
from app.ingest.tables.spilling import VALUES_A_ROW, Spill
from app.ingest.tables.tally import Tally
from app.ingest.tags.loops import Grouping
from app.ingest.tags.modes import UNKNOWN_MODE, stand_for_no_data
from app.ingest.tags.quality import Quality
from app.ingest.times.half_clock import HalfClock
from app.ingest.times.time_reader import TimeReader


class LongTable:
    """Turns rows into blocks of signals."""

    def __init__(
        self, plan: LongPlan, grouping: Grouping, options: IngestOptions, log: RejectLog, tally: Tally
    ) -> None:
        self._plan, self._grouping, self._options, self._log, self._tally = plan, grouping, options, log, tally
        self._time = TimeReader(plan.form, options)
        self._time.half_clock = HalfClock(by_tag=True)
        self._dates = DatesOnce(plan.time)
        if not tally.again:
            tally.quality = Quality(plan.zero_is_good, plan.good_if_set)
        self._quality = tally.quality
        self._qualities_of = 0  # the first line of the rows whose qualities were learnt when they were scanned
        self._tag_type = pl.Categorical(pl.Categories.random())
        self._quality_type = pl.Categorical(pl.Categories.random())
        # polars forgets the codes of a type of which no series is left: between two chunks that it parsed, others may
        # have been scanned.
        self._held = tuple(pl.Series([], dtype=of) for of in (self._tag_type, self._quality_type))
        self._tags = NumberedTags(grouping, options)
        self._blocks = BlocksByTag(self._tags.places, self._time, log, tally)
        self._tags_before = 0  # the chunk that is read
        self._unsized: list[Gathered] = []  # of which `_largest` does not tell yet
        self._largest = np.zeros(0)  # by number of the tag, of the values that were read before
        self._scanner: Scanner | None = None
        self._beside = BesideValues(plan)
        self._kinds = KindsSeen()

    def types(self) -> dict[int, pl.DataType]:
        """The type in which each column is wanted from the text."""
        time = self._plan.time
        types: dict[int, pl.DataType] = dict.fromkeys(time, NUMBERED if len(time) == 1 else pl.String())
        types[self._plan.tag] = self._tag_type
        types[self._plan.value] = pl.Float64()
        if self._plan.quality is not None:
            types[self._plan.quality] = self._quality_type
        if self._plan.unit is not None:
            types[self._plan.unit] = pl.String()
        if self._plan.fraction is not None:
            types[self._plan.fraction.index] = pl.String()
        if self._plan.state is not None:
            types[self._plan.state] = pl.String()
        return types

    def batches(self, reader: RowReader) -> Iterator[list[SignalBlock]]:
        """Blocks, with all that the file holds of a loop in one batch."""
        self._scanner = self._scanning(reader)
        spill: Spill | None = None
        most_values = self._options.buffered_values
        batch: list[Gathered] = []
        try:
            if self._tally.again and self._beside.asked:
                self._look_ahead(reader)
            for rows in reader.rows(self._plan.first_row):
                self._tally.rows_read += rows.filled
                batch.append(self._gather(rows, reader))
                self._unsized.append(batch[-1])
                if sum(map(len, batch)) * VALUES_A_ROW >= most_values:
                    spill = spill or Spill(self._options.spill_folder, most_values)
                    self._size()
                    whole, rest = in_whole_instants(joined(batch))
                    spill.add(as_piece(whole), self._tags.loops())
                    batch = [rest]
                self._tally.writing.end_chunk()
            self._tally.check_settled(self.kinds(), self._beside.is_settled)
            self._tags.settle()
            self._tally.units = self._units()
            self._tally.in_other_order = self._time.in_other_order
            self._tally.without_date = self._dates.carried
            self._tally.modes.settle(self._log)
            last = [as_piece(joined(batch))] if any(map(len, batch)) else []
            if spill is None:
                yield list(self._blocks.parted(last))
                return
            for piece in last:
                spill.add(piece, self._tags.loops())
            for part in spill.parts():
                yield list(self._blocks.parted(part))
        finally:
            if spill is not None:
                spill.close()

    def _look_ahead(self, reader: RowReader) -> None:
        """What stands beside values is judged by all rows of their tags."""
        for rows in reader.rows(self._plan.first_row):
            for cells in self._cells(rows, reader):
                self._beside.see(cells)

    def tell(self, reader: RowReader, evidence: Evidence) -> None:
        """What all rows tell of how the numbers of its tags are written."""
        for rows in reader.rows(self._plan.first_row):
            for cells in self._cells(rows, reader):
                texts, missing = cells.texts(), cells.numbers().missing[:, 0]
                evidence.add(cells.tags.cast(pl.String), texts, missing | rows.doubtful(cells.column, texts))

    def kinds(self) -> dict[str, int]:
        """Of the fields of tags whose marks were in doubt, as far as they were seen."""
        return self._kinds.of({tag: self._tags.number(tag) for tag in self._tally.writing.marks.met()})

    def _cells(self, rows: Rows, reader: RowReader) -> Iterator[Cells]:
        yield Cells(rows, reader, rows.frame[name_of(self._plan.tag)], self._plan.value)

    def _units(self) -> dict[str, str]:
        """By tag, in the order in which they came."""
        return {at.tag: unit for code, at in self._tags.by_code() if (unit := self._beside.unit_of(code))}

    def _scanning(self, reader: RowReader) -> Scanner | None:
        beside = (self._plan.unit, self._plan.fraction, self._plan.state)
        return reader.scanning(self._plan) if all(column is None for column in beside) else None

    def _size(self) -> None:
        """Takes in how large the values of each tag are."""
        more = len(self._tags) - len(self._largest)
        self._largest = np.append(self._largest, np.zeros(more))
        for gathered in self._unsized:
            np.maximum.at(self._largest, gathered.codes, np.abs(np.nan_to_num(gathered.values)))
        self._unsized = []

    def _largest_before(self, tag: str) -> float | None:
        """Of the values of a tag that was there before the chunk that is read; None for others."""
        number = self._tags.number(tag)
        if number >= self._tags_before:
            return None
        if self._unsized:
            self._size()
        return float(self._largest[number])

    def _gather(self, rows: Rows, reader: RowReader) -> Gathered:
        self._tags_before = len(self._tags)
        if rows.scan is None:
            return self._of_frame(rows, reader)
        before = self._time.clock.before
        scanned = None if self._tally.writing.own else self._of_scan(rows, rows.scan)
        if scanned is None and self._scanner is not None:
            self._scanner.refused()
        if scanned is not None:
            return scanned
        self._time.clock.before = before
        return self._of_frame(reader.parted(rows), reader)

    def _of_scan(self, rows: Rows, scan: Scan) -> Gathered | None:
        """None where something of the rows cannot be used: their text tells more of it."""
        each_ns = self._time.read(scan.times.texts)
        if np.any(each_ns == NO_TIME):
            return None
        self._quality.learn(scan.qualities.texts, scan.qualities.lengths)
        self._qualities_of = rows.first
        if self._quality.bad(scan.qualities.texts).any():
            return None
        number_of_code = self._numbers_of_codes(scan)
        codes = number_of_code[scan.codes]
        if not self._tells_nothing(scan, codes, number_of_code):
            return None
        time_ns, values = np.repeat(each_ns, scan.times.lengths), scan.values
        if self._tags.modes.any():
            modes = np.flatnonzero(self._tags.modes[codes] & ~np.isnan(values))
            if not self._tally.modes.may_be_understood(values[modes]):
                return None
            self._take_modes(rows, values, codes, modes)
        lines = np.arange(rows.first, rows.first + len(codes), dtype=np.uint32)
        gathered = Gathered(codes, time_ns, values, lines)
        if not self._tags.usable.all():
            kept = self._without_long_names(rows, codes, np.ones(len(codes), dtype=bool))
            gathered = gathered.at(np.flatnonzero(kept))
        self._tally.rows_kept += len(gathered)
        return gathered

    def _numbers_of_codes(self, scan: Scan) -> NDArray[np.uint32]:
        numbers = [self._tags.numbered(tag) for tag in scan.new]
        self._learn_tags()
        return np.append(np.arange(scan.known, dtype=np.uint32), np.array(numbers, dtype=np.uint32))

    def _tells_nothing(self, scan: Scan, codes: NDArray[np.uint32], number_of_code: NDArray[np.uint32]) -> bool:
        """Whether the values of each tag are those that they are without what they tell of marks."""
        kinds = np.zeros(len(self._tags), dtype=np.uint8)
        kinds[number_of_code] = scan.kinds
        self._kinds.see(kinds, len(kinds))
        doubtful = (kinds & IN_DOUBT != 0) & self._tags.usable & ~self._tags.modes
        if not doubtful.any():
            return True
        self._tally.writing.learn_from(int(np.bitwise_or.reduce(kinds[doubtful])))
        thousands = self._tally.writing.thousands
        if not all(tells_nothing(int(found), thousands) for found in np.unique(kinds[doubtful])):
            return False
        given = codes[~np.isnan(scan.values)]
        return self._are_decimals(given[doubtful[given]])

    def _are_decimals(self, codes: NDArray[np.uint32]) -> bool:
        """Whether the marks of the tags of rows, in the order in which they come, stand before decimals."""
        first = np.full(len(self._tags), -1)
        first[codes[::-1]] = np.arange(len(codes))[::-1]
        numbers = np.flatnonzero(first >= 0)
        in_order = numbers[np.argsort(first[numbers])]
        return all(self._tally.writing.are_decimals(self._tags.places[number].tag) for number in in_order)

    def _of_frame(self, rows: Rows, reader: RowReader) -> Gathered:
        texts, time_ns = self._timed(rows, reader)
        (cells,) = self._cells(rows, reader)
        gathered = self._of_cells(cells, texts, time_ns)
        self._tally.rows_kept += len(gathered)
        return gathered

    def _timed(self, rows: Rows, reader: RowReader) -> tuple[pl.Series, TimeArray]:
        """What stands in the rows for their times, and the times. Rows cut short lost the place of their fields:
        without a time they are refused as such."""
        texts, time_ns = self._dates.read(rows.frame, self._read_times)
        texts, time_ns = with_parts(rows.frame, self._plan.fraction, texts, time_ns)
        short = reader.short_rows(rows, rows.may_be_short())
        time_ns = np.where(np.isin(np.arange(len(time_ns)), short), NO_TIME, time_ns) if len(short) else time_ns
        return texts, time_ns

    def _of_cells(self, cells: Cells, texts: pl.Series, time_ns: TimeArray) -> Gathered:
        """The values in rows with a time and a tag; texts: of the times."""
        codes = self._numbered(cells, time_ns != NO_TIME)
        kept = self._kept(cells, texts, codes, time_ns)
        if self._beside.asked and not self._tally.again:
            self._beside.see(cells)
        values = self._values(cells, codes, kept)
        self._refuse_quality(cells, kept, values)
        self._refuse_other_units(cells, kept, values)
        at = np.flatnonzero(kept)
        if len(at) < len(codes):
            codes, time_ns, values = codes[at], time_ns[at], values[at]
        return Gathered(codes, time_ns, values, (at + cells.rows.first).astype(np.uint32))

    def _numbered(self, cells: Cells, timed: NDArray[np.bool_]) -> NDArray[np.uint32]:
        numbers = self._tags.of_codes(cells.codes(), cells.tags, timed)
        self._learn_tags()
        return numbers

    def _learn_tags(self) -> None:
        new = self._tags.taken_in()
        if new and self._scanner is not None:
            self._scanner.learn(new)

    def _read_times(self, texts: pl.Series) -> TimeArray:
        """Rows of one instant follow each other in most files: each run of one text is read once."""
        if len(texts) < 1000 or texts.dtype != pl.String:
            return self._time.read(texts)
        runs = texts.rle_id()
        distinct = int(runs[-1]) + 1
        if distinct > len(texts) // 2:
            return self._time.read(texts)
        first = np.flatnonzero(np.diff(runs.to_numpy(), prepend=-1))
        return self._time.read(texts[first])[runs.to_numpy()]

    def _kept(self, cells: Cells, texts: pl.Series, codes: NDArray[np.uint32], time_ns: TimeArray) -> NDArray[np.bool_]:
        timed, named = time_ns != NO_TIME, cells.tags.is_not_null().to_numpy()
        kept = timed & named
        if cells.telling and not np.all(kept):
            self._tell_left_out(cells, texts, timed, kept)
        return self._without_long_names(cells.rows, codes, kept)

    def _tell_left_out(self, cells: Cells, texts: pl.Series, timed: NDArray[np.bool_], kept: NDArray[np.bool_]) -> None:
        """Refuses the rows without a time or a tag, but for empty ones and comments."""
        rows, tags = cells.rows, cells.tags
        short = cells.reader.short_rows(rows, np.flatnonzero(~kept))
        self._log.add_many("ragged_row", rows.lines(short), (f"fewer than {self._plan.width} fields" for _ in short))
        values = rows.frame[name_of(cells.column)]
        narrow = texts.cast(pl.String).str.contains(TOO_NARROW).fill_null(False).to_numpy()
        narrow &= (tags.is_not_null() | values.is_not_null()).to_numpy()
        comments = (_begin_with("*#", texts) & ~narrow) | _begin_with("*#[", tags)
        self._tally.comments += int(np.count_nonzero(comments & ~kept))
        passed = comments | _hold_nothing(texts, tags, values)
        at = np.setdiff1d(np.flatnonzero(~kept & ~passed), short, assume_unique=True)
        late = at[~timed[at]]
        words = (f"{texts[int(row)] or ''!r} is no time that can be read" for row in late)
        self._log.add_many("bad_time", rows.lines(late), words, (tags[int(row)] for row in late))
        bare = at[timed[at]]
        self._log.add_many("no_tag", rows.lines(bare), ("a row without a tag" for _ in bare))

    def _without_long_names(self, rows: Rows, codes: NDArray[np.uint32], kept: NDArray[np.bool_]) -> NDArray[np.bool_]:
        known = self._tags.usable
        if known.all():
            return kept
        at = np.flatnonzero(kept & ~known[codes])
        if len(at):
            text = f"a tag of more than {self._options.max_name} characters"
            self._log.add_many("name_too_long", rows.lines(at), (text for _ in at))
        return kept & known[codes]

    def _values(self, cells: Cells, codes: NDArray[np.uint32], kept: NDArray[np.bool_]) -> FloatArray:
        numbers = cells.numbers()
        values, missing = numbers.values[:, 0], numbers.missing[:, 0]
        modes = self._are_modes(codes)
        states = self._beside.states(cells, modes, missing)
        if states is not None:
            cells = replace(cells, states=states)
            missing |= states.is_not_null().to_numpy()
        if self._may_tell(cells, values, codes, kept & ~modes):
            missing |= marked(cells.texts())
        if missing.any() or self._tally.writing.own:
            self._read_odd(cells, values, missing, codes, kept)
        if modes.any():
            self._read_numbers_of_modes(cells, values, codes, np.flatnonzero(modes & ~missing & kept))
        if np.isfinite(values).all():
            return values
        at = np.flatnonzero(kept & ~np.isfinite(values) & ~missing)
        if len(at):
            self._refuse(cells, "not_finite", at, (f"{values[row]}" for row in at))
        values[~np.isfinite(values)] = np.nan
        return values

    def _are_modes(self, codes: NDArray[np.uint32]) -> NDArray[np.bool_]:
        return self._tags.modes[codes] if self._tags.modes.any() else np.zeros(len(codes), dtype=bool)

    def _by_tag(self, codes: NDArray[np.uint32], at: NDArray[np.int64]) -> Iterator[tuple[str, NDArray[np.int64]]]:
        """The rows of `at` tag by tag."""
        order = at[np.argsort(codes[at], kind="stable")]
        for rows in np.split(order, np.flatnonzero(np.diff(codes[order])) + 1) if len(order) else ():
            yield self._tags.places[codes[rows[0]]].tag, rows

    def _read_numbers_of_modes(
        self, cells: Cells, values: FloatArray, codes: NDArray[np.uint32], at: NDArray[np.int64]
    ) -> None:
        numbers = values[at]
        self._take_modes(cells.rows, values, codes, at)
        unknown = np.flatnonzero(values[at] == UNKNOWN_MODE)
        self._refuse(cells, "unknown_mode", at[unknown], (f"{numbers[i]:g}" for i in unknown))

    def _take_modes(self, rows: Rows, values: FloatArray, codes: NDArray[np.uint32], at: NDArray[np.int64]) -> None:
        for tag, of_tag in self._by_tag(codes, at):
            values[of_tag] = self._tally.modes.of_numbers(values[of_tag], tag, of_tag + rows.first)

    def _may_tell(
        self, cells: Cells, values: FloatArray, codes: NDArray[np.uint32], of_numbers: NDArray[np.bool_]
    ) -> bool:
        """Whether marks are in doubt, and not for sure those that they were taken for."""
        kinds = cells.kinds()
        self._kinds.see(None if cells.rows.kinds is None else np.array([kinds], np.uint8), len(self._tags))
        if not kinds & IN_DOUBT:
            return False
        if of_numbers.all():
            self._tally.writing.learn_from(kinds)
        if self._tally.writing.own or not tells_nothing(kinds, self._tally.writing.thousands):
            return True
        return not self._are_decimals(codes[of_numbers & np.isfinite(values)])

    def _read_odd(
        self,
        cells: Cells,
        values: FloatArray,
        missing: NDArray[np.bool_],
        codes: NDArray[np.uint32],
        kept: NDArray[np.bool_],
    ) -> None:
        """Words of modes are modes; other text in place of a number is refused with the text as the reason."""
        texts = cells.texts()
        given = texts.is_not_null().to_numpy() & kept
        left = missing & given
        modes = self._are_modes(codes)
        of_modes = np.flatnonzero(left & modes)
        for tag, of_tag in self._by_tag(codes, of_modes):
            values[of_tag] = self._tally.modes.of_texts(texts[of_tag], tag, of_tag + cells.rows.first)
        unknown = of_modes[values[of_modes] == UNKNOWN_MODE]
        all_tags = cells.tags.cast(pl.String)
        left &= ~modes
        read = pl.Series(given & ~left & ~modes)
        writing = self._tally.writing
        writing.learn(
            texts.filter(pl.Series(left)),
            all_tags.filter(pl.Series(left)),
            lambda: pl.DataFrame({"tag": all_tags.filter(read), "text": texts.filter(read)}),
            self._largest_before,
        )
        if writing.own:
            left |= (read & all_tags.is_in(list(writing.own)) & texts.str.contains(MARKED)).fill_null(False).to_numpy()
            missing |= left  # what is refused here is not refused once more for what is left of it
        no_data = of_modes[stand_for_no_data(texts[of_modes])]
        self._refuse(cells, "not_a_number", no_data, (texts[int(row)] for row in no_data))
        others = np.flatnonzero(left)
        tags = all_tags[others]
        found = odd_numbers(texts[others], tags, writing)
        values[others] = found.values
        refused = {code: others[at] for code, at in found.refused.items()}
        for code, at in {"unknown_mode": unknown, **refused}.items():
            self._refuse(cells, code, at, (refused_as(code, texts[int(row)]) for row in at))

    def _refuse_quality(self, cells: Cells, kept: NDArray[np.bool_], values: FloatArray) -> None:
        if self._plan.quality is None:
            return
        texts = cells.rows.frame[name_of(self._plan.quality)]
        if cells.rows.first != self._qualities_of:
            self._quality.learn(texts)
        bad = self._quality.bad(texts)
        at = np.flatnonzero(bad & kept & np.isfinite(values))
        self._refuse(cells, "bad_quality", at, (str(texts[int(row)]) for row in at))
        values[at] = np.nan

    def _refuse_other_units(self, cells: Cells, kept: NDArray[np.bool_], values: FloatArray) -> None:
        for at, words in self._beside.in_other_units(cells, kept & np.isfinite(values)):
            self._refuse(cells, "other_unit", at, words)
            values[at] = np.nan

    def _refuse(self, cells: Cells, code: str, at: NDArray[np.int64], words: Iterator[str]) -> None:
        tags = cells.tags
        self._log.add_many(code, cells.rows.lines(at), words, (tags[int(row)] for row in at))


def _hold_nothing(texts: pl.Series, tags: pl.Series, values: pl.Series) -> NDArray[np.bool_]:
    return (texts.is_null() & tags.is_null() & values.is_null()).to_numpy()


def _begin_with(marks: str, fields: pl.Series) -> NDArray[np.bool_]:
    return fields.cast(pl.String).str.contains(f"^[{re.escape(marks)}]").fill_null(False).to_numpy()
