"""What was counted while a file is read."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from app.ingest.model import TimeArray
from app.ingest.numbers.no_data import NoData
from app.ingest.numbers.writing import Writing
from app.ingest.tables.contradictions import Contradictions
from app.ingest.tags.modes import ModesMet
from app.ingest.tags.quality import Quality
from app.ingest.times.read_once import TurnsMet
from app.ingest.times.set_back import SetBack

MOST_REPEATED = 100  # times that came twice, which are held


class UnsettledError(Exception):
    """Rows were read otherwise than all of them together tell; none of them was given away yet."""


@dataclass
class Tally:
    """Rows and values so far; `backward` says that rows were not in order of time; `stuttering` counts rows
    whose stamp repeated the one before and stood for the step after it; `spread` says that stamps of a long table were
    cut, and their rows spread inside of them; `comments` those that hold none but a
    comment, `repeats` those whose time their tags had already; `wordy` are columns of words
    that are no signals; `units` those of tags, by a column of units; `lacks_half`: hours go to 12 and begin again, and
    nothing tells AM from PM; `without_date` counts rows with a clock alone, which have the date of one above;
    `judging`: columns that all rows tell to be qualities, though the first ones do not;
    `unknown_qualities`: columns that are called as qualities of a value, of whose numbers nothing tells which are good;
    `repeated_ns`: some of the times that came twice;
    `in_other_order` counts dates that fit with day and month exchanged alone; `again`: what all rows tell is known from
    an earlier reading."""

    rows_read: int = 0
    rows_kept: int = 0
    values_kept: int = 0
    backward: bool = False
    stuttering: int = 0
    spread: bool = False
    comments: int = 0
    repeats: int = 0
    repeated_ns: set[int] = field(default_factory=set)
    wordy: list[str] = field(default_factory=list)
    unknown_qualities: list[str] = field(default_factory=list)
    units: dict[str, str] = field(default_factory=dict)
    lacks_half: bool = False
    in_other_order: int = 0
    without_date: int = 0
    first_time_ns: int | None = None
    last_time_ns: int | None = None
    writing: Writing = field(default_factory=Writing)
    quality: Quality = field(default_factory=Quality)
    no_data: NoData = field(default_factory=NoData)
    modes: ModesMet = field(default_factory=ModesMet)
    contradictions: Contradictions = field(default_factory=Contradictions)
    turns: TurnsMet = field(default_factory=TurnsMet)
    set_back: SetBack = field(default_factory=SetBack)

    again: bool = False
    judging: frozenset[int] = frozenset()

    def check_settled(self, kinds: Mapping[str, int], beside: bool = True) -> None:
        """When all rows were read. Raises UnsettledError where they would be read otherwise now. kinds: of the fields
        of tags whose marks are in doubt, as far as they were seen. beside: whether what stands beside values is
        settled."""
        numbers = self.writing.units.is_settled and self.writing.is_settled(kinds)
        if not self.again and not (beside and numbers and self.quality.is_settled):
            raise UnsettledError
        self.writing.settle()

    def saw_repeats(self, time_ns: TimeArray) -> None:
        """`time_ns` is in order; of some rows or of those of a tag."""
        repeated = time_ns[1:][time_ns[1:] == time_ns[:-1]]
        self.repeats += len(repeated)
        self.repeated_ns.update(repeated[: MOST_REPEATED - len(self.repeated_ns)].tolist())

    def saw_times(self, time_ns: TimeArray) -> None:
        """`time_ns` is in order, and not empty."""
        first, last = int(time_ns[0]), int(time_ns[-1])
        self.first_time_ns = first if self.first_time_ns is None else min(first, self.first_time_ns)
        self.last_time_ns = last if self.last_time_ns is None else max(last, self.last_time_ns)
