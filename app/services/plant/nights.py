"""What the last nights said of a loop: one verdict may be a bad night's, seven that agree are none."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from app.engine.long_records.episodes import BEGAN
from app.services.backend import Backend
from app.services.moments import iso_utc
from app.services.telling.reasons import extra_in
from app.services.telling.wording import RELIABILITY_BRIEF, VERDICT_WORDS, codes_in
from app.storage import continuing
from app.storage import nights as stored
from app.storage.nights import NightRow, StickingRow

NIGHTS = 7
AUDITS = 6 * NIGHTS
"""Who audits a loop again by day has some verdicts of one date: the last of them counts."""

MARKS = {"stiction": "S", "inconclusive": "?", "not_auditable": "×", "no_stiction": "–"}
NOTHING_NEW = "="


@dataclass(frozen=True)
class Night:
    """The last verdict of one date, by the plant's clock. again: why it is the same as before; empty:
    it is not. is_first: whether nothing is on record of the loop before that date."""

    date: str
    verdict: str
    reliability: str
    again: str = ""
    is_first: bool = False

    @property
    def mark(self) -> str:
        return NOTHING_NEW if self.again else MARKS[self.verdict]

    @property
    def words(self) -> str:
        again = f", {self.again}" if self.again else ""
        return f"{self.date} {VERDICT_WORDS[self.verdict]} ({RELIABILITY_BRIEF[self.reliability]}{again})"


def nights(backend: Backend, tags: Sequence[str], until: int | None = None) -> dict[str, tuple[Night, ...]]:
    """Of each loop the last verdict of each of its newest dates, the oldest first; a loop without one is left out.
    Those of the loop that it continues are among them.
    until: the last run that counts."""
    with backend.database.read() as connection:
        chains = continuing.earlier_of(connection, tags)
        before = [one for chain in chains.values() for one in chain]
        rows = stored.recent(connection, [*tags, *before], AUDITS, until)
    by_tag: dict[str, dict[str, NightRow]] = {}
    for row in rows:
        by_tag.setdefault(row.tag, {})[backend.clock.date_of_run(row.nightly_for, row.run_begun)] = row
    full = {tag for tag, count in Counter(row.tag for row in rows).items() if count == AUDITS}
    names = {tag: (*chains.get(tag, ())[::-1], tag) for tag in tags}
    found = {tag: _together([by_tag.get(one, {}) for one in theirs]) for tag, theirs in names.items()}
    found = {tag: dated for tag, dated in found.items() if dated}
    return {tag: _nights(dated, whole=full.isdisjoint(names[tag]))[-NIGHTS:] for tag, dated in found.items()}


def _together(parts: Sequence[Mapping[str, NightRow]]) -> dict[str, NightRow]:
    """By date, what was said last at the end, though it be of a night that was caught up; where a loop had two tags on
    one date, what was said under the later one."""
    whole = {date: row for part in parts for date, row in part.items()}
    return dict(sorted(whole.items(), key=lambda item: item[1].audited_at))


def _nights(dated: Mapping[str, NightRow], *, whole: bool) -> tuple[Night, ...]:
    """whole: whether all that is on record was looked at."""
    earlier = [None, *dated.values()]
    return tuple(
        Night(date, row.verdict, row.reliability, _again(row, before), whole and before is None)
        for (date, row), before in zip(dated.items(), earlier, strict=False)
    )


def _again(row: NightRow, before: NightRow | None) -> str:
    """Why the same is said of the same samples, or of the same window: what came after it could not be judged. A repair
    or the method may have changed it."""
    if before is None or row.input_end_ns is None or row.verdict != before.verdict:
        return ""
    if row.input_end_ns == before.input_end_ns:
        return "nothing new was recorded"
    same_window = row.window_end is not None and row.window_end == before.window_end
    return "judged on the same data as before" if same_window else ""


@dataclass(frozen=True)
class Onset:
    """When a valve began to stick that has stuck since without a break (ISO 8601, UTC): the hour, where its first
    verdict saw it begin (`seen`), else when that was said. first: whether nothing else was ever said of the loop."""

    at: str
    seen: bool
    first: bool


def onsets(backend: Backend, tags: Sequence[str], until: int | None = None) -> dict[str, Onset]:
    """By tag, of the loops that stick. As the first verdict told it: the later ones see less and less of it."""
    with backend.database.read() as connection:
        rows = stored.first_sticking(connection, tags, until)
    return {row.tag: _onset(row) for row in rows}


def _onset(row: StickingRow) -> Onset:
    began = extra_in(row.extra_json).get("episode_start") if BEGAN in codes_in(row.reasons) else None
    return Onset(began or iso_utc(row.audited_at) or "", bool(began), row.otherwise is None)
