"""Whether the repairs of the last fortnight helped: what is asked first on the morning after one."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any, Literal, NamedTuple

from sqlalchemy import Connection

from app.services.backend import Backend
from app.services.moments import iso_utc
from app.services.telling.repair_sides import side_of, span_of
from app.services.telling.wording import VERDICT_WORDS, brief, looked_at_today
from app.storage import repaired as stored
from app.storage.repaired import RepairRow

LOOKED_BACK = timedelta(days=14)
LISTED, LOOKED_AT = 30, 1000

Outcome = Literal["sticks", "doubtful", "unanswered", "new", "unsure", "open", "helped", "clean", "unmoved", "waiting"]
OUTCOME_WORDS: dict[Outcome, str] = {
    "sticks": "did not help: the valve sticks",
    "doubtful": "may not have helped: look first",
    "unanswered": "did not help: PV does not answer OP",
    "new": "the valve sticks now; before the repair the verdict was no stiction",
    "unsure": "seems to have helped",
    "open": "cannot tell whether it helped",
    "helped": "helped",
    "clean": "does not stick; what it did before is not known",
    "unmoved": "the valve was not said to stick before the repair either",
    "waiting": "not judged since",
}
"""In the order in which they are listed."""
IN_VAIN: tuple[Outcome, ...] = ("sticks", "doubtful", "unanswered")
SURELY_IN_VAIN: tuple[Outcome, ...] = ("sticks", "unanswered")


class Said(NamedTuple):
    """What a verdict said; None: there is none."""

    verdict: str | None = None
    likely_cause: str | None = None

    @property
    def unanswered(self) -> bool:
        return self.verdict is not None and looked_at_today(self._asdict())


UNSAID = Said()


@dataclass(frozen=True)
class RepairView:
    """What became of a repair. before: the verdict before it; now: the one that rests on samples since it; None where
    there is none."""

    loop: str
    unit: str | None
    repaired_at: str
    outcome: Outcome
    before: str | None
    now: str | None
    reliability: str | None
    likely_cause: str | None = None

    @property
    def said(self) -> dict[str, str | None]:
        """What the words of how far to rely on it go by."""
        return {"verdict": self.now, "reliability": self.reliability, "likely_cause": self.likely_cause}

    @property
    def words(self) -> str:
        return OUTCOME_WORDS[self.outcome]

    @property
    def verdicts(self) -> str:
        """ "before: valve sticks, since: no stiction (rely on it)", as far as they are known."""
        before = [f"before: {VERDICT_WORDS[self.before]}"] if self.before else []
        now = [f"since: {VERDICT_WORDS[self.now]} ({brief(self.said)})"] if self.now else []
        return ", ".join(before + now)


@dataclass(frozen=True)
class Repairs:
    """The first of the repairs of a fortnight; `more`: whether there were others."""

    listed: list[RepairView]
    more: bool


def repairs(backend: Backend, audit_id: int | None = None, at: datetime | None = None) -> Repairs:
    """Of the repairs of the fortnight up to now, by the newest verdicts, or those of a run, or up to a time; those that
    did not help come first."""
    at = at or datetime.now(UTC)
    with backend.database.read() as connection:
        rows = stored.between(connection, at - LOOKED_BACK, at, audit_id, LOOKED_AT)
    order = list(OUTCOME_WORDS)
    views = sorted((_view(row) for row in rows), key=lambda view: order.index(view.outcome))
    return Repairs(views[:LISTED], len(views) > LISTED)


def asked_after(repaired_at: datetime) -> bool:
    """Whether a repair is so fresh that it is asked whether it helped."""
    return repaired_at > datetime.now(UTC) - LOOKED_BACK


def in_vain(
    connection: Connection, rows: Sequence[Mapping[str, Any]], tags: Collection[str], at: datetime | None = None
) -> dict[str, Outcome]:
    """By tag of those rows of the reliability table whose loop was repaired in the fortnight up to now, or `at`, and
    sticks on, or answers as little as before: one of `IN_VAIN`. tags: the loops of which a repair is known."""
    at = at or datetime.now(UTC)
    known = stored.between(connection, at - LOOKED_BACK, at, None, len(tags), tags) if tags else []
    found = {row.tag: row for row in known}
    outcomes = {row["loop"]: _of_row(row, found[row["loop"]]) for row in rows if row["loop"] in found}
    return {tag: outcome for tag, outcome in outcomes.items() if outcome in IN_VAIN}


def _of_row(row: Mapping[str, Any], repair: RepairRow) -> Outcome:
    told = side_of(span_of(row), repair.repaired_at) == "after"
    now = Said(row["verdict"], row["likely_cause"]) if told else UNSAID
    return _outcome(_before(repair), now, reliable=row["reliability"] == "reliable")


def _before(repair: RepairRow) -> Said:
    return Said(repair.verdict_before, repair.cause_before)


def _view(row: RepairRow) -> RepairView:
    told = row.side == "after"
    now, reliability = (Said(row.verdict, row.likely_cause), row.reliability) if told else (UNSAID, None)
    return RepairView(
        loop=row.tag,
        unit=row.unit,
        repaired_at=iso_utc(row.repaired_at) or "",
        outcome=_outcome(_before(row), now, reliable=reliability == "reliable"),
        before=row.verdict_before,
        now=now.verdict,
        reliability=reliability,
        likely_cause=now.likely_cause,
    )


def _outcome(before: Said, now: Said, *, reliable: bool) -> Outcome:
    if now.verdict is None:
        return "waiting"
    if now.verdict == "stiction":
        return "new" if before.verdict == "no_stiction" else "sticks" if reliable else "doubtful"
    if now.verdict != "no_stiction":
        return "unanswered" if before.unanswered and now.unanswered else "open"
    if before.verdict != "stiction":
        return "unmoved" if before.verdict == "no_stiction" else "clean"
    return "helped" if reliable else "unsure"
