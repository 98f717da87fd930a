"""What is written of loops, beside their verdicts, and what is to be done about them by both: the same on the pages, in
the table that others read and in reports."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from app.services.backend import Backend
from app.services.moments import PlantClock, iso_utc
from app.services.plant.contradicted import contradicted
from app.services.plant.repaired import SURELY_IN_VAIN, Outcome, asked_after, in_vain
from app.services.stating.shelving import Shelf, Shelved, shelf
from app.services.telling.naming import one_line
from app.services.telling.next_steps import Ask, Step, after_repair, step_for, step_of
from app.services.telling.repair_sides import of_before
from app.services.telling.wording import STICKS
from app.storage import explanations, notes
from app.storage.notes import Standing

NOTHING = Standing()


@dataclass(frozen=True)
class Written:
    """What stands of some loops, by tag, and which of them their newest explanation contradicts."""

    standing: Mapping[str, Standing]
    shelved: Mapping[str, Shelved]
    disagree: frozenset[str]
    in_vain: Mapping[str, Outcome]
    clock: PlantClock

    def beside(self, row: Mapping[str, Any]) -> dict[str, Any]:
        """A row of the reliability table with `WrittenFields`."""
        standing, shelved = self.standing.get(row["loop"], NOTHING), self.shelved.get(row["loop"])
        repaired_at = iso_utc(standing.repaired_at)
        return {
            **row,
            "next_step": self.step(row).text,
            "work_order": standing.work_order,
            "repaired_at": repaired_at,
            "shelved_until": None if shelved is None else shelved.until,
            "of_before_repair": of_before(row, repaired_at),
        }

    def step(self, row: Mapping[str, Any]) -> Step:
        """What to do: to wait, as long as the loop is shelved and nothing got worse; what did not help is named."""
        standing, shelved = self.standing.get(row["loop"], NOTHING), self.shelved.get(row["loop"])
        if shelved is not None and not shelved.worse:
            return step_for(Ask.WAIT_ON_SHELF, f"Wait: {shelved.words(self.clock)}.")
        if row["loop"] in self.disagree:
            return step_for(Ask.UNTIL_THEY_AGREE)
        if row["of_old_record"]:
            return step_for(Ask.NOTHING_NEWER)
        outcome = self.in_vain.get(row["loop"])
        step = step_of(row, self.clock, iso_utc(standing.repaired_at))
        if outcome is None or standing.repaired_at is None:
            return step
        order = one_line(standing.repair_order or "")
        return after_repair(step, self.clock.date(standing.repaired_at), order, sure=outcome in SURELY_IN_VAIN)

    def shelved_words(self, row: Mapping[str, Any]) -> str | None:
        shelved = self.shelved.get(row["loop"])
        return None if shelved is None else shelved.words(self.clock)


def written_of(
    backend: Backend,
    rows: Sequence[Mapping[str, Any]],
    shelved: Shelf | None = None,
    notes_until: datetime | None = None,
) -> Written:
    """What stands of the loops of these rows of the reliability table: as many questions of the database for a plant
    as for one loop. shelved: None: as of now; notes_until: orders, repairs and explanations as they were then (None:
    by now)."""
    known = shelf(backend) if shelved is None else shelved
    with backend.database.read() as connection:
        standing = notes.standing(connection, [row["loop"] for row in rows], notes_until)
        repaired = [tag for tag, one in standing.items() if one.repaired_at is not None]
        failed = in_vain(connection, rows, repaired, notes_until)
        disagree = contradicted(connection, rows, standing, notes_until, backend.settings.hold_days)
        return Written(standing, known.by_tag(), disagree, failed, backend.clock)


@dataclass(frozen=True)
class Marks:
    """Of which loops there is something that the row of a verdict does not tell by itself, and all that it depends
    on."""

    tags: frozenset[str]
    told: Sequence[Any]


def marks_of(backend: Backend, tags: Collection[str]) -> Marks:
    """Told without the rows: before a page is written it is known whether it would say anything new."""
    asked = frozenset(tags)
    on_shelf = {tag: one for tag, one in shelf(backend).by_tag().items() if tag in asked}
    with backend.database.read() as connection:
        standing = notes.standing(connection, tags)
        naming = explanations.naming_ids(connection, tags, STICKS)
    told = [
        sorted((tag, one.work_order, one.repair_order, *_of_repair(one)) for tag, one in standing.items()),
        sorted((tag, one.until, one.work_order, one.worse) for tag, one in on_shelf.items()),
        (sorted(naming.items()), backend.settings.hold_days) if naming else (),
    ]
    return Marks(frozenset({*standing, *on_shelf, *naming}), told)


def _of_repair(standing: Standing) -> tuple[str | None, bool]:
    """When, and whether it is so fresh that it is asked whether it helped."""
    at = standing.repaired_at
    return iso_utc(at), at is not None and asked_after(at)
