"""A loop that stopped is told the next morning; one that is always late is not, nor is one that nobody has known."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import insert, update

from app.services.auditing.audits import start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.backend import Backend
from app.services.digests.making import digest_of
from app.services.digests.telling import as_text
from app.services.moments import ns_of
from app.services.plant import worst
from app.services.plant.arrivals import current_ns
from app.services.plant.listing import listing
from app.services.plant.silent import silences, silent
from app.services.telling.wording import brief, rely
from app.storage.tables import audits, loops, newest_rows, verdicts

AddLoops = Callable[..., dict[str, int]]
FIRST = datetime(2026, 3, 1, tzinfo=UTC)
TAGS = ("A", "B", "C", "D", "E")
STOPPED = "One loop has stopped while the others went on: no sample newer than"


@pytest.fixture
def nights(backend: Backend, add_loops: AddLoops) -> Callable[..., int]:
    """A night a row: how far each loop's record reached, in days since FIRST. Gives the last run."""
    ids = add_loops(*TAGS, n=150)
    run = start_audit(backend)
    audit_chunk(backend, int(run.id), "test")

    def told(*reached: dict[str, float]) -> int:
        with backend.database.write() as connection:
            like = dict(connection.execute(audits.select()).mappings().one())
            rows = {row["loop_id"]: dict(row) for row in connection.execute(verdicts.select()).mappings()}
            number = int(run.id)
            for days in reached:
                number += 1
                began = FIRST + timedelta(days=max(days.values()), hours=2)
                again = {"id": number, "created_at": began, "ended_at": began, "nightly_for": str(number)}
                connection.execute(insert(audits).values(like | again))
                for tag, day in days.items():
                    end_ns = ns_of(FIRST + timedelta(days=day))
                    verdict = rows[ids[tag]] | {"audit_id": number, "input_end_ns": end_ns}
                    connection.execute(insert(verdicts).values(verdict))
                    mine = loops.c.id == ids[tag]
                    connection.execute(update(loops).where(mine).values(newest_ns=end_ns, newest_audit_id=number))
                    kept = newest_rows.c.loop_id == ids[tag]
                    connection.execute(update(newest_rows).where(kept).values(audit_id=number))
        return number

    return told


def night(day: float, **others: float) -> dict[str, float]:
    return dict.fromkeys(TAGS, day) | others


def test_a_loop_that_stopped_is_told_the_next_morning(backend: Backend, nights: Callable[..., int]) -> None:
    run = nights(night(1), night(2), night(3, E=2))
    assert silences(backend, current_ns(backend), run, FIRST + timedelta(days=3, hours=2)) == [
        f"{STOPPED} E (2026-03-03 00:00)."
    ]
    assert silences(backend, current_ns(backend)) == [f"{STOPPED} E (2026-03-03 00:00)."]
    assert STOPPED in as_text(digest_of(backend, str(run)))


def test_it_is_told_no_more_once_it_came_and_was_not_before(backend: Backend, nights: Callable[..., int]) -> None:
    run = nights(night(1), night(2), night(3, E=2), night(4))
    assert silent(backend, current_ns(backend)) == []
    assert silent(backend, current_ns(backend), run - 2, FIRST + timedelta(days=2, hours=2)) == []


@pytest.mark.parametrize(
    "told",
    [
        pytest.param([night(1, E=0), night(2, E=1), night(3, E=2)], id="always a day late"),
        pytest.param([night(1), night(2, E=1), night(3), night(4, E=3)], id="every other day"),
        pytest.param([night(3, E=2.6)], id="some hours"),
        pytest.param([night(3, E=2)], id="a day late when it was first heard of"),
        pytest.param([night(5), night(6, C=5, D=5, E=5)], id="half of the plant did not come"),
    ],
)
def test_who_is_late_as_usual_is_not_told(backend: Backend, nights: Callable[..., int], told: list) -> None:
    nights(*told)
    assert silent(backend, current_ns(backend)) == []


def test_a_loop_without_earlier_runs_is_not_told(backend: Backend, nights: Callable[..., int]) -> None:
    nights(night(1), night(2), night(3))
    with backend.database.write() as connection:
        late = {"tag": "NEW", "created_at": FIRST, "newest_ns": ns_of(FIRST + timedelta(days=2))}
        connection.execute(insert(loops).values(**late))
    assert silent(backend, current_ns(backend)) == []


def test_the_verdict_of_an_old_record_does_not_read_as_if_it_were_of_today(
    backend: Backend, nights: Callable[..., int]
) -> None:
    run = nights(night(1), night(9, E=1))
    since_ns = ns_of(FIRST + timedelta(days=7))
    (row,) = worst.worst_of_old(backend, listing(backend, since_ns))
    assert (row["loop"], rely(row), brief(row)) == ("E", "from an old record", "from an old record")
    with backend.database.write() as connection:
        connection.execute(update(verdicts).values(verdict="stiction", reliability="reliable", reasons=""))
    (told,) = digest_of(backend, str(run)).old
    assert told.told.endswith("from an old record")
