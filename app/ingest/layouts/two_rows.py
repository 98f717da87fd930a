"""Wide, with the names in two rows: tags in one, signals in the other, as in `FIC101,,TIC2,` above `PV,OP,PV,OP`. A
name may stand above its first column alone, as merged cells are exported."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from app.ingest.columns.clocks import date_and_clock, is_date_or_clock
from app.ingest.columns.names import QUALITY_NAMES, name_at
from app.ingest.columns.plain_names import plain
from app.ingest.columns.plans import WidePlan
from app.ingest.columns.plans_by_names import wide_from
from app.ingest.columns.time_columns import first_row_below
from app.ingest.columns.time_names import time_columns
from app.ingest.files.head import PREAMBLE_ROWS, Head, is_number
from app.ingest.model import IngestOptions, Signal
from app.ingest.numbers.units import is_unit
from app.ingest.tags.grouping import AUDITED, like_a_tag, place, share_like_tags

_MOST_WORDS = 500  # that differ in a row of signals, which may have units
_SHOWN = 3


@dataclass(frozen=True)
class Names:
    """By column: the tag, and the word of its signal, where it has one. `rows`: those of the words and of the tags."""

    tags: Mapping[int, str]
    words: Mapping[int, str]
    rows: tuple[int, ...]

    def of(self, column: int) -> str:
        tag, word = self.tags.get(column, ""), self.words.get(column, "")
        if not tag or not word or plain(word) in QUALITY_NAMES:
            return word or tag
        signal = place(word, "").signal
        name = f"{tag}.{word}"
        return name if place(name, "").signal == signal else f"{tag}.{signal}"

    @property
    def like_tags(self) -> float:
        return share_like_tags(set(self.tags.values()))


def sniff(head: Head, options: IngestOptions) -> WidePlan | None:
    for at, row in enumerate(head.rows[:PREAMBLE_ROWS]):
        if not AUDITED.issubset(_signals(row).values()):
            continue
        near = head.rows[max(at - 2, 0) : at + 3]
        names = next((names for names in (row, *near) if time_columns(names)), ())
        time = time_columns(names) or (0,)
        first_row = first_row_below(head, at, time[0], options, name_at(names, time[0]))
        if first_row <= at:
            continue
        time = date_and_clock(head, time, (), first_row, options)
        best = max(_readings(head, at, first_row, time), key=lambda names: names.like_tags, default=None)
        if best is not None:
            return _plan(head, best, first_row, time, options)
    return None


def _plan(head: Head, names: Names, first_row: int, time: tuple[int, ...], options: IngestOptions) -> WidePlan | None:
    width = 1 + max(*names.tags, *names.words, *time)
    joined = tuple(_of_time(head, at, first_row) if at in time else names.of(at) for at in range(width))
    plan = wide_from(head, "two_rows", joined, names.rows, first_row, options, time)
    shown = ", ".join(joined[column] for column in sorted(names.tags)[:_SHOWN])
    note = f"names stand in two rows, of tags and of signals, and were read as {shown}, ..."
    return plan and replace(plan, notes=(note, *plan.notes))


def _of_time(head: Head, column: int, first_row: int) -> str:
    return next((row[column] for row in head.rows[:first_row] if column in time_columns(row)), "")


def _signals(words: tuple[str, ...]) -> dict[str, Signal]:
    """The signals that words without a tag name."""
    different = set(words)
    if len(different) > _MOST_WORDS:
        return {}
    places = [place(word, "") for word in different if word]
    return {found.tag: found.signal for found in places if found.loop == "" and found.signal != "OTHER"}


def _readings(head: Head, at: int, first_row: int, time: tuple[int, ...]) -> Iterator[Names]:
    """What the row of signals can be read as with another one of the heading, the nearest first."""
    signals = _signals(head.row(at))
    for other in sorted(range(first_row), key=lambda index: abs(index - at)):
        if other == at:
            continue
        width = max(len(head.row(at)), len(head.row(other)))
        words, tags = (_by_column(head.row(index), time) for index in (at, other))
        both = (tags, words), (_filled(tags, width, time), words), (tags, _filled(words, width, time))
        found = (Names(*pair, rows=(at, other)) for pair in both)
        yield from (names for names in found if _is_certain(names, signals, above=other < at))


def _by_column(row: tuple[str, ...], time: tuple[int, ...]) -> dict[int, str]:
    return {column: cell for column, cell in enumerate(row) if cell and column not in time}


def _filled(cells: Mapping[int, str], width: int, time: tuple[int, ...]) -> dict[int, str]:
    """Each cell goes on over the empty ones right of it."""
    filled: dict[int, str] = {}
    last = ""
    for column in range(width):
        last = cells.get(column, last)
        if last and column not in time:
            filled[column] = last
    return filled


def _is_certain(names: Names, signals: Mapping[str, Signal], above: bool) -> bool:
    """Whether each signal has a tag and each tag a signal once, whatever has an OP a PV, and tags are no units, types
    or titles."""
    of = {column: signals[word] for column, word in names.words.items() if word in signals}
    pairs = [(names.tags.get(column, ""), signal) for column, signal in of.items()]
    alone = [tag for column, tag in names.tags.items() if column not in names.words]
    tags = {tag for tag, _ in pairs}
    repeated = len(set(pairs)) < len(pairs) or len(set(alone)) < len(alone) or not tags.isdisjoint(alone)
    if repeated or not all(map(_may_be_tag, tags)) or _are_starts(tags):
        return False
    pv, op = ({tag for tag, signal in pairs if signal == wanted} for wanted in ("PV", "OP"))
    if not op or not op <= pv:
        return False
    if len(tags) > 1:
        return True
    tag = next(iter(tags))
    return above and like_a_tag(tag) and not is_number(tag)


def _may_be_tag(text: str) -> bool:
    """A loop may be called by its number; one with decimals is a limit or a range."""
    numbered = text.isdigit() or not is_number(text)
    return bool(text) and numbered and not is_unit(text) and place(text, "").loop != ""


def _are_starts(tags: set[str]) -> bool:
    """Whether dates or clocks tell when signals begin. Dates that differ may be numbers of loops."""
    told = [tag for tag in tags if is_date_or_clock(tag)]
    return len(told) == len(tags) == 1 or any(":" in tag for tag in told)
