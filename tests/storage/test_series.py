"""Series in the data base: sending again and overlapping windows change nothing; windows are read for many loops."""

import numpy as np
from sqlalchemy import func, select

from app.storage import Database, loops, series
from app.storage.samples import Samples
from app.storage.series import Stretch
from app.storage.tables import series as series_table

SECOND = 1_000_000_000
START = 1_750_000_000


def ramp(first: int, last: int, offset: float = 0.0) -> Samples:
    seconds = np.arange(first, last, dtype=np.int64)
    return Samples((START + seconds) * SECOND, {"pv": seconds + offset, "op": seconds / 2})


def add(database: Database, tag: str, *stretches: Samples) -> series.Added:
    with database.write() as connection:
        loop_id = loops.ensure(connection, [tag])[tag]
        return series.add(connection, [Stretch(loop_id, stretch) for stretch in stretches], None)


def window(database: Database, tag: str, hours: float = 24.0, most: int = 10**6) -> Samples:
    with database.read() as connection:
        loop_id = loops.ids_of(connection, [tag])[tag]
        return series.windows(connection, [loop_id], hours, most)[loop_id]


def rows(database: Database) -> int:
    with database.read() as connection:
        return connection.scalar(select(func.count()).select_from(series_table))


def test_sending_again_changes_nothing(database: Database) -> None:
    assert add(database, "FIC1", ramp(0, 100)).samples == 100
    assert add(database, "FIC1", ramp(0, 100)) == series.Added(0, 0)
    assert add(database, "FIC1", ramp(20, 60)) == series.Added(0, 0)
    assert rows(database) == 1


def test_overlapping_windows_add_only_what_is_new(database: Database) -> None:
    add(database, "FIC1", ramp(0, 100))
    assert add(database, "FIC1", ramp(50, 150)).samples == 50
    assert add(database, "FIC1", ramp(-50, 150)).samples == 50
    found = window(database, "FIC1")
    assert np.array_equal(found.signals["pv"], np.arange(-50, 150))


def test_the_later_upload_holds_where_values_differ(database: Database) -> None:
    add(database, "FIC1", ramp(0, 100))
    assert add(database, "FIC1", ramp(90, 110, offset=0.5)).samples == 20
    found = window(database, "FIC1")
    assert list(found.signals["pv"][88:92]) == [88, 89, 90.5, 91.5]


def test_a_window_is_bounded_in_time_and_samples(database: Database) -> None:
    add(database, "FIC1", ramp(0, 4000), ramp(4000, 8000))
    add(database, "FIC2", ramp(0, 10))
    with database.read() as connection:
        ids = loops.ids_of(connection, ["FIC1", "FIC2"])
        found = series.windows(connection, ids.values(), 1.0, 100_000)
    assert len(found[ids["FIC1"]]) == 3601
    assert len(found[ids["FIC2"]]) == 10
    newest = window(database, "FIC1", most=50)
    assert (newest.time_ns[0], newest.time_ns[-1]) == ((START + 7950) * SECOND, (START + 7999) * SECOND)


def test_a_loop_knows_its_newest_sample(database: Database) -> None:
    add(database, "FIC1", ramp(100, 200))
    add(database, "FIC1", ramp(0, 50))
    with database.read() as connection:
        assert loops.by_tag(connection, "FIC1").newest_ns == (START + 199) * SECOND


def test_windows_are_found_by_index(database: Database) -> None:
    if not database.is_sqlite:
        return
    with database.read() as connection:
        query = (
            "SELECT s.packed FROM series s JOIN loops l ON l.id = s.loop_id"
            " WHERE s.loop_id IN (1, 2, 3) AND s.end_ns >= l.newest_ns - 86400 ORDER BY s.loop_id, s.id"
        )
        plan = str(connection.exec_driver_sql(f"EXPLAIN QUERY PLAN {query}").all())
    assert "ix_series_loop_end (loop_id=? AND end_ns>?)" in plan
