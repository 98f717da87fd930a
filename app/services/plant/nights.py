"""What the last nights said of a loop: one verdict may be a bad night's, seven that agree are none."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.services.backend import Backend
from app.services.wording import RELIABILITY_BRIEF, VERDICT_WORDS
from app.storage import nights as stored

NIGHTS = 7
AUDITS = 6 * NIGHTS
"""Who audits a loop again by day has some verdicts of one date: the last of them counts."""

MARKS = {"stiction": "S", "inconclusive": "?", "not_auditable": "×", "no_stiction": "–"}


@dataclass(frozen=True)
class Night:
    """The last verdict of one date (UTC)."""

    date: str
    verdict: str
    reliability: str

    @property
    def mark(self) -> str:
        return MARKS[self.verdict]

    @property
    def words(self) -> str:
        return f"{self.date} {VERDICT_WORDS[self.verdict]} ({RELIABILITY_BRIEF[self.reliability]})"


def nights(backend: Backend, tags: Sequence[str]) -> dict[str, tuple[Night, ...]]:
    """Of each loop the last verdict of each of its newest dates, the oldest first; a loop without one is left out."""
    with backend.database.read() as connection:
        rows = stored.recent(connection, tags, AUDITS)
    found: dict[str, dict[str, Night]] = {}
    for row in rows:
        date = row.audited_at.date().isoformat()
        found.setdefault(row.tag, {})[date] = Night(date, row.verdict, row.reliability)
    return {tag: tuple(dated.values())[-NIGHTS:] for tag, dated in found.items()}
