"""A clock that was ahead takes no night from the plant, and two that differ do not begin nights for ever."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import update

from app.services.access.trail import list_trail
from app.services.auditing import audits, chunks, nightly
from app.services.backend import Backend
from app.services.upkeep import retention
from app.storage import audits as stored_audits
from app.storage import plant
from app.storage import retention as stored_retention
from app.storage import trail as stored_trail
from app.storage.tables import loops as loops_table

AddLoops = Callable[..., dict[str, int]]
SweepAt = Callable[[datetime], str | None]


@pytest.fixture
def sweep_at(backend: Backend, add_loops: AddLoops, monkeypatch: pytest.MonkeyPatch) -> SweepAt:
    """Begins the night, where one is due, by a clock that shows this time; the plant has been known for long."""
    add_loops("FIC1")
    with backend.database.write() as connection:
        connection.execute(update(loops_table).values(created_at=datetime(2026, 1, 1, tzinfo=UTC)))

    def swept(clock: datetime) -> str | None:
        for module, name in ((stored_audits, "now"), (nightly, "stored_now")):
            monkeypatch.setattr(module, name, lambda: clock)
        run = nightly.nightly_if_due(backend, clock)
        return None if run is None else run.night

    return swept


@pytest.mark.parametrize("ahead_h", [5, 12.5, 24 * 40])
def test_a_night_that_a_clock_ahead_had_begun_comes_all_the_same(
    backend: Backend, sweep_at: SweepAt, ahead_h: float
) -> None:
    """Begun to the second at its hour, or caught up at some other time of the day."""
    evening = datetime(2026, 3, 1, 21, tzinfo=UTC)
    assert sweep_at(evening) == "2026-03-01"
    ahead = sweep_at(evening + timedelta(hours=ahead_h))
    assert ahead == (evening + timedelta(hours=ahead_h)).date().isoformat()
    assert sweep_at(evening + timedelta(hours=1)) is None
    there = audits.get_audit(backend, "2")
    assert (there.trigger, there.night) == ("nightly", None)
    day = datetime.fromisoformat(f"{ahead}T02:00:00+00:00")
    assert [sweep_at(day + timedelta(seconds=5 * count)) for count in range(3)] == [ahead, None, None]
    told = [line.subject for line in list_trail(backend, limit=50).rows if line.action == "audit.ahead"]
    assert told == [f"night {ahead}"]


@pytest.mark.parametrize("apart_h", [3, 24 * 3 + 3])
def test_of_two_servers_whose_clocks_differ_none_begins_nights_over_and_over(
    backend: Backend, sweep_at: SweepAt, apart_h: float
) -> None:
    night = datetime(2026, 3, 2, 2, 1, tzinfo=UTC)
    for count in range(8):
        now = night + timedelta(seconds=5 * count)
        sweep_at(now + timedelta(hours=apart_h))
        sweep_at(now)
    with backend.database.read() as connection:
        assert len(stored_audits.page(connection, 50, None)) <= 3


def test_a_clock_that_is_behind_takes_no_night_its_date(backend: Backend, sweep_at: SweepAt) -> None:
    """As after a start whose clock is not set yet: the samples that the runs rest on are ahead of it as well."""
    days = [datetime(2026, 3, day, 3, tzinfo=UTC) for day in (1, 2, 3)]
    for day in days:
        with backend.database.write() as connection:
            recorded = int((day - timedelta(hours=2)).timestamp()) * 10**9
            connection.execute(update(loops_table).values(newest_ns=recorded))
        sweep_at(day)
    sweep_at(datetime(2026, 1, 15, 1, tzinfo=UTC))
    told = [audits.get_audit(backend, str(number)).night for number in (1, 2, 3)]
    assert told == ["2026-03-01", "2026-03-02", "2026-03-03"]
    assert sweep_at(days[-1] + timedelta(hours=1)) is None


@pytest.fixture
def retained_at(backend: Backend, monkeypatch: pytest.MonkeyPatch) -> Callable[[datetime], bool]:
    """Whether what is old is dropped by a clock that shows this time."""

    def retained(clock: datetime) -> bool:
        for module in (retention, stored_retention, stored_trail):
            monkeypatch.setattr(module, "now", lambda: clock)
        return retention.retain_if_due(backend, clock) is not None

    return retained


def test_what_would_be_old_by_a_clock_that_jumped_waits_a_day(
    backend: Backend, retained_at: Callable[[datetime], bool]
) -> None:
    day, ahead = datetime(2026, 3, 1, 9, tzinfo=UTC), datetime(2026, 4, 20, 9, tzinfo=UTC)
    hour = timedelta(hours=1)
    assert [retained_at(clock) for clock in (day, day + 24 * hour)] == [True, True]
    assert [retained_at(ahead + count * hour) for count in (0, 1, 23)] == [False, False, False]
    assert [retained_at(day + 48 * hour), retained_at(day + 49 * hour)] == [True, False]  # put right
    assert [retained_at(ahead + count * hour) for count in (0, 23, 24, 48)] == [False, False, True, True]  # was stopped
    told = [line.action for line in list_trail(backend, limit=50).rows]
    assert told.count(retention.WAITS) == 2


def test_a_weekend_without_the_service_is_no_clock_that_jumped(
    backend: Backend, retained_at: Callable[[datetime], bool]
) -> None:
    night, hour = datetime(2026, 3, 6, 2, tzinfo=UTC), timedelta(hours=1)
    assert [retained_at(night + count * hour) for count in (0, 24 * 3 + 6, 24 * 7, 24 * 10 + 6)] == [True] * 4
    assert retention.WAITS not in [line.action for line in list_trail(backend, limit=50).rows]


def test_what_another_sweep_drops_of_the_trail_meanwhile_ends_no_sweep(backend: Backend) -> None:
    day, last = timedelta(days=1), datetime.now(UTC) - timedelta(days=30)
    moments = [last + 30 * day, last + 30.5 * day, last + 32 * day]
    assert [retention._clock_may_be_ahead(backend, last, moment) for moment in moments] == [True, True, False]


def test_a_run_dated_ahead_is_not_the_newest_one(backend: Backend, sweep_at: SweepAt) -> None:
    day = datetime(2026, 3, 1, 9, tzinfo=UTC)
    for number, clock in enumerate((day, day + timedelta(days=40), day + timedelta(days=1)), 1):
        assert sweep_at(clock) is not None
        while chunks.audit_chunk(backend, number, "w"):
            pass
    with backend.database.read() as connection:
        newest = plant.last_whole_run(connection)
    assert newest is not None
    assert newest.id == 3
