"""What the last nights said of a loop."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import update

from app.services.auditing.audits import start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.backend import Backend
from app.services.moments import ns_of
from app.services.plant.course import course
from app.services.plant.nights import NIGHTS, Night, nights
from app.storage.tables import audits, verdicts

AddLoops = Callable[..., dict[str, int]]
FIRST = datetime(2026, 3, 1, 3, tzinfo=UTC)


def audited(backend: Backend, at: datetime, *, fresh: bool = True, **told: str) -> None:
    """fresh: whether samples of that moment were recorded before."""
    run = int(start_audit(backend).id)
    audit_chunk(backend, run, "test")
    with backend.database.write() as connection:
        mine = verdicts.c.audit_id == run
        connection.execute(update(audits).where(audits.c.id == run).values(created_at=at))
        connection.execute(update(verdicts).where(mine).values(audited_at=at, **told))
        if fresh:
            connection.execute(update(verdicts).where(mine).values(input_end_ns=ns_of(at), window_end=at))


def test_a_night_without_new_samples_is_marked(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("A")
    for day in range(4):
        audited(backend, FIRST + timedelta(days=day), fresh=day in (0, 3), verdict="stiction", reliability="reliable")
    found = nights(backend, ["A"])["A"]
    assert [night.mark for night in found] == ["S", "S", "=", "S"]  # the second is of what add_loops stored
    assert found[2].words == "2026-03-03 valve sticks (rely on it, nothing new was recorded)"


def test_another_verdict_of_the_same_samples_is_marked_as_what_it_says(backend: Backend, add_loops: AddLoops) -> None:
    """As where a repair was written down, or the method changed."""
    add_loops("A")
    for day, verdict in enumerate(("stiction", "no_stiction", "no_stiction")):
        audited(backend, FIRST + timedelta(days=day), fresh=False, verdict=verdict, reliability="reliable")
    assert [night.mark for night in nights(backend, ["A"])["A"]] == ["S", "–", "="]


def test_a_night_that_was_caught_up_stands_where_it_was_said(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("A", n=120)
    for day in range(2):
        audited(backend, FIRST + timedelta(days=day), verdict="no_stiction", reliability="reliable")
    audited(backend, FIRST + timedelta(days=1, hours=5), verdict="stiction", reliability="reliable")
    with backend.database.write() as connection:
        last = audits.c.created_at == FIRST + timedelta(days=1, hours=5)
        connection.execute(update(audits).where(last).values(nightly_for="2026-02-28"))
    told = [(night.date, night.mark) for night in nights(backend, ["A"])["A"]]
    assert told == [("2026-03-01", "–"), ("2026-03-02", "–"), ("2026-02-28", "S")]


def test_a_loop_without_a_verdict_has_no_nights(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("A")
    assert nights(backend, ["A", "unknown"]) == {}
    assert nights(backend, []) == {}


def test_the_last_verdict_of_each_date_counts_the_oldest_first(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("A", "B")
    audited(backend, FIRST, verdict="no_stiction", reliability="reliable")
    audited(backend, FIRST + timedelta(hours=5), verdict="inconclusive", reliability="not_reliable")
    audited(backend, FIRST + timedelta(days=1), verdict="stiction", reliability="reliable")
    found = nights(backend, ["A"])
    assert found == {
        "A": (
            Night("2026-03-01", "inconclusive", "not_reliable", is_first=True),
            Night("2026-03-02", "stiction", "reliable"),
        )
    }
    assert [night.mark for night in found["A"]] == ["?", "S"]
    assert found["A"][1].words == "2026-03-02 valve sticks (rely on it)"


def test_the_newest_nights_are_kept(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("A", n=120)
    for day in range(NIGHTS + 2):
        audited(backend, FIRST + timedelta(days=day), verdict="no_stiction", reliability="reliable")
    assert [night.date for night in nights(backend, ["A"])["A"]] == [f"2026-03-{day:02d}" for day in range(3, 10)]


def test_nights_beyond_those_looked_at_are_told_to_be_there(
    backend: Backend, add_loops: AddLoops, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a loop that is audited each hour a few dates fill what is looked at."""
    monkeypatch.setattr("app.services.plant.nights.AUDITS", 3)
    add_loops("A", n=120)
    for hours in (0, 24):
        audited(backend, FIRST + timedelta(hours=hours), verdict="inconclusive", reliability="not_reliable")
    assert nights(backend, ["A"])["A"][0].is_first
    for hours in (48, 50):
        audited(backend, FIRST + timedelta(hours=hours), verdict="inconclusive", reliability="not_reliable")
    last = nights(backend, ["A"])["A"]
    assert [night.date for night in last] == ["2026-03-02", "2026-03-03"]
    assert not any(night.is_first for night in last)


def test_a_run_across_midnight_is_of_one_date(backend: Backend, add_loops: AddLoops) -> None:
    """The one that the plant's nights and the digest give it, for whichever loop it came to late."""
    add_loops("A", n=120)
    audited(backend, FIRST, verdict="no_stiction", reliability="reliable")
    with backend.database.write() as connection:
        connection.execute(update(verdicts).values(audited_at=FIRST + timedelta(days=1)))
    dates = [night.date for night in nights(backend, ["A"])["A"]]
    assert dates == ["2026-03-01"] == [night.date for night in course(backend)]
