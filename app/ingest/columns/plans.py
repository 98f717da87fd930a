"""What a layout says about a file: where its columns are. The readers of tables do the rest, so a new layout is a new
description."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import chain

from app.ingest.times.stamps import TimeForm


@dataclass(frozen=True)
class ValueColumn:
    """A column of values of one tag; `off_line` and `quality` are columns that say whether its values can be used.
    may_judge: one that says so if further rows show qualities there; in_percent: the quality is a confidence. unit: as
    a row of units tells it; empty where none does."""

    index: int
    tag: str
    off_line: int | None = None
    quality: int | None = None
    unit: str = ""
    may_judge: int | None = None
    in_percent: bool = False


@dataclass(frozen=True)
class Fraction:
    """The column of what times of whole seconds have beyond them, counted in units of `unit_ns`."""

    index: int
    unit_ns: int


@dataclass(frozen=True)
class TimedColumns:
    """Columns of values and the column (or date and time columns) in which their times stand; `fraction`: their parts
    of a second, where these stand apart."""

    time: tuple[int, ...]
    form: TimeForm
    values: tuple[ValueColumn, ...]
    fraction: Fraction | None = None


@dataclass(frozen=True)
class WidePlan:
    """A row holds one instant (of each group of columns). `first_row` is the index of the first row of data, `width`
    its fields, `heading` the rows between names and data that are neither. times_assumed: what was taken for times
    where no column is named so. `ends`: after how many fields, fewer than `width`, a row may end as well. `names`: the
    row of names, where there is one alone. `further_times`: columns of times that are none of the rows'."""

    layout: str
    first_row: int
    width: int
    groups: tuple[TimedColumns, ...]
    spread: bool = False
    notes: tuple[str, ...] = field(default=())
    heading: tuple[int, ...] = ()
    times_assumed: str = ""
    ends: frozenset[int] = frozenset()
    names: tuple[str, ...] = ()
    further_times: tuple[ValueColumn, ...] = ()

    @property
    def form(self) -> TimeForm:
        return self.groups[0].form

    @property
    def read(self) -> frozenset[int | None]:
        """The columns that are read."""
        values = [value for group in self.groups for value in group.values]
        times = chain.from_iterable(group.time for group in self.groups)
        fractions = (group.fraction.index for group in self.groups if group.fraction is not None)
        of_values = chain.from_iterable((one.index, one.off_line, one.quality) for one in values)
        return frozenset((*times, *fractions, *of_values))


@dataclass(frozen=True)
class LongPlan:
    """A row holds one value of one tag. `zero_is_good`: the quality column counts from 0 = good instead of OPC's 192
    = good; None where it is not told. `good_if_set`: whether flags there tell good values or bad ones; None where they
    are no flags. `signals`: where a row holds several values of the loop that stands in column
    `tag`, their columns, each with the word that makes a tag of the loop; `word` is the column that has this word,
    where it is not one for all rows. `others`: such columns of no signal, which are kept beside them. `ends`: as in a
    wide plan. `unit`: the column of the units of the values. `fraction`: as of timed columns.
    `state`: the column of the words of states, which stand for numbers."""

    layout: str
    first_row: int
    width: int
    time: tuple[int, ...]
    form: TimeForm
    tag: int
    value: int
    quality: int | None = None
    zero_is_good: bool | None = None
    notes: tuple[str, ...] = ()
    heading: tuple[int, ...] = ()
    signals: tuple[ValueColumn, ...] = ()
    word: int | None = None
    others: tuple[ValueColumn, ...] = ()
    ends: frozenset[int] = frozenset()
    unit: int | None = None
    good_if_set: bool | None = None
    fraction: Fraction | None = None
    state: int | None = None

    @property
    def read(self) -> frozenset[int | None]:
        """The columns that are read."""
        values = (value.index for value in (*self.signals, *self.others))
        fraction = None if self.fraction is None else self.fraction.index
        beside = (self.quality, self.word, self.unit, self.state)
        return frozenset((*self.time, fraction, self.tag, self.value, *beside, *values))

    @property
    def has_signals(self) -> bool:
        """Whether a row holds several values of its loop, each in a column of its own."""
        return bool(self.signals) and self.word is None

    @property
    def keys(self) -> tuple[int, ...]:
        """The columns that tell of which signal, or loop with all of its signals, a row is."""
        return (self.tag,) if self.word is None else (self.tag, self.word)

    def tags_of(self, cells: Iterable[str]) -> list[str]:
        """The tags that different cells of column `tag` stand for."""
        if not self.has_signals:
            return list(cells)
        return [f"{loop}.{signal.tag}" for loop in cells for signal in (*self.signals, *self.others)]


Plan = WidePlan | LongPlan


def name_of(index: int) -> str:
    return f"c{index}"
