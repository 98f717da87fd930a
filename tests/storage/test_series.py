"""Series in the database: sending again and overlapping windows change nothing; windows are read for many loops."""

import tracemalloc
from typing import Any

import numpy as np
import pytest
from psycopg.adapt import PyFormat, Transformer
from psycopg.pq import Format
from sqlalchemy import event, func, select, text, update

from app.settings import Settings
from app.storage import Database, loops, retention, series
from app.storage.samples import DamagedStretchError, Samples, merged, news, unpack_stored
from app.storage.series import Place, Stretch
from app.storage.tables import series as series_table
from tests.storage.stored import SECOND, START, add, add_as, first, placed, ramp, steps, window


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


def unpacked(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Which stored stretches are unpacked from now on."""
    ids: list[int] = []

    def counted(stretch_id: int, packed: bytes) -> Samples:
        ids.append(stretch_id)
        return unpack_stored(stretch_id, packed)

    monkeypatch.setattr(series, "unpack_stored", counted)
    return ids


def night(number: int, *, offset: float = 0.0) -> Samples:
    """Ten minutes of the day of that number."""
    return ramp(number * 86_400, number * 86_400 + 600, offset)


def test_a_sample_of_long_ago_has_nothing_unpacked_of_the_nights_since_then(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As of a dead transmitter, whose historian gives its last value with every export."""
    tags = [f"FIC{n}" for n in range(6)]
    nights = 40
    with database.write() as connection:
        ids = loops.ensure(connection, tags)
        for number in range(nights):
            series.add(connection, [Stretch(ids[tag], night(number)) for tag in tags], None)
    of_long_ago = merged([ramp(7, 8), night(nights)])
    read = unpacked(monkeypatch)
    with database.write() as connection:
        tonight = [Stretch(ids[tag], of_long_ago if tag == tags[0] else night(nights)) for tag in tags]
        added = series.add(connection, tonight, None)
    assert added == series.Added(len(tags), 600 * len(tags))
    assert len(read) == 1


def test_stored_stretches_are_read_by_some_loops_at_a_time_and_each_once(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(series, "STORED_AT_ONCE", 1500)
    tags = [f"FIC{n}" for n in range(5)]
    with database.write() as connection:
        ids = loops.ensure(connection, tags)
        series.add(connection, [Stretch(ids[tag], night(n)) for tag in tags for n in range(2)], None)
        read = unpacked(monkeypatch)
        both = [Stretch(ids[tag], merged([night(0), night(1, offset=0.5)])) for tag in tags]
        assert series.add(connection, both, None) == series.Added(len(tags), 0, replaced=600 * len(tags))
    assert len(read) == len(set(read)) == 2 * len(tags)
    for tag in tags:
        assert window(database, tag, hours=25).signals["pv"][[0, 600]].tolist() == [0.0, 86_400.5]


def test_the_later_upload_holds_where_values_differ(database: Database) -> None:
    add(database, "FIC1", ramp(0, 100))
    assert add(database, "FIC1", ramp(90, 110, offset=0.5)) == series.Added(1, 10, replaced=10)
    found = window(database, "FIC1")
    assert list(found.signals["pv"][88:92]) == [88, 89, 90.5, 91.5]


UPLOADS = 5


class Trial:
    """Uploads of one loop, numbered as they were received, and read in another order."""

    def __init__(self, random: np.random.Generator) -> None:
        self.sent = {number: drawn(random) for number in range(1, UPLOADS + 1)}
        self.order = [int(one) for one in random.permutation(list(self.sent))]
        self.read: list[int] = []

    def next(self) -> tuple[Samples, Place]:
        number = self.order[len(self.read)]
        unread = set(self.sent).difference(self.read)
        self.read = sorted([*self.read, number])
        self.last = self.sent[number], Place(number, max((one for one in unread if one < number), default=0))
        return self.last


def drawn(random: np.random.Generator) -> Samples:
    """A few samples with a few values, of which some are missing: much of it is said twice."""
    seconds = np.sort(random.choice(6, size=random.integers(1, 7), replace=False))
    values = random.choice([1.0, 2.0, np.nan], size=(2, len(seconds)))
    return Samples((START + seconds) * SECOND, {"pv": values[0], "sp": values[1]})


def test_whatever_is_read_first_the_one_that_was_received_later_holds(database: Database) -> None:
    """And nothing is stored that does not have to be: read again, nothing is new."""
    random = np.random.default_rng(2026)
    trials = [Trial(random) for _ in range(60)]
    # One transaction for all: each trial has a loop of its own, and who commits when is no matter here.
    with database.write() as connection:
        ids = loops.ensure(connection, [f"L{number}" for number in range(len(trials))]).values()
        windows = dict.fromkeys(ids)
        for _ in range(UPLOADS):
            new = {
                loop_id: placed(connection, loop_id, *trial.next()) for loop_id, trial in zip(ids, trials, strict=True)
            }
            before, windows = windows, series.windows(connection, ids, 24.0, 10**6)
            for loop_id, trial in zip(ids, trials, strict=True):
                held, was, expected = windows[loop_id], before[loop_id], merged([trial.sent[one] for one in trial.read])
                for name in ("pv", "sp"):
                    got = held.signals[name][np.searchsorted(held.time_ns, expected.time_ns)]
                    assert np.array_equal(got, expected.signals[name], equal_nan=True), (loop_id, trial.read, name)
                stretch, place = trial.last
                assert new[loop_id] == (len(stretch) if was is None else np.count_nonzero(news(held, was)))
                assert placed(connection, loop_id, stretch, place) == 0
        for loop_id, held in windows.items():
            whole = series.between(connection, loop_id, 0, 2**62)
            assert all(np.array_equal(whole.signals[name], held.signals[name], equal_nan=True) for name in held.signals)


def test_two_that_are_read_at_the_same_time_take_no_key_from_each_other(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the first one said, the second corrected and the third said again: the third holds, though it found nothing
    stored under its key when it looked."""
    monkeypatch.setattr(series, "_known", lambda *_: {})
    add_as(database, "FIC1", ramp(0, 10), Place(1))
    add_as(database, "FIC1", ramp(0, 10), Place(3, unread_before=2))
    add_as(database, "FIC1", ramp(0, 10, offset=0.5), Place(2))
    assert window(database, "FIC1").signals["pv"].tolist() == list(range(10))


def test_pieces_of_a_time_lie_within_it_and_are_cut_once_at_a_place(database: Database) -> None:
    for number, (begun, last) in enumerate(((0, 100), (10, 90), (60, 120), (60, 130)), 1):
        add_as(database, "FIC1", ramp(begun, last, offset=number), Place(number))
    start, cut, end = ((START + second) * SECOND for second in (50, 60, 125))
    with database.read() as connection:
        assert series.pieces(connection, 1, start, end, 1) == [(start, cut - 1), (cut, end)]
        assert series.pieces(connection, 1, start, end, 10**6) == [(start, end)]


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


def test_of_a_chunk_of_long_windows_one_is_in_memory_at_a_time(database: Database) -> None:
    tags, a_loop = [f"FIC{k}" for k in range(12)], 3 * 8 * 100_000
    for tag in tags:
        add(database, tag, ramp(0, 100_000))
    with database.read() as connection:
        ids = loops.ids_of(connection, tags)
        tracemalloc.start()
        found = series.windows(connection, ids.values(), 24.0, 1000)
        kept, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert len(found) == len(tags)
    assert all(len(samples) == 1000 for samples in found.values())
    assert kept < 0.3 * a_loop
    assert most < 5 * a_loop


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


def test_what_is_stored_at_the_times_of_a_batch_is_found_span_by_span(database: Database) -> None:
    """Whatever is known of the table: taken for one join, PostgreSQL read all of it."""
    batch = [Stretch(loop, merged([ramp(0, 1), night(9)])) for loop in range(1, 101)]
    asked: list[tuple[str, Any]] = []

    def note(_: Any, __: Any, statement: str, parameters: Any, *___: Any) -> None:
        asked.append((statement, parameters))

    with database.write() as connection:
        event.listen(connection, "before_cursor_execute", note)
        assert series._touched(connection, batch) == {}
        explain = "EXPLAIN QUERY PLAN" if database.is_sqlite else "EXPLAIN"
        [(statement, parameters)] = asked
        told = [str(row) for row in connection.exec_driver_sql(f"{explain} {statement}", parameters)]
    if database.is_sqlite:
        assert "SEARCH series USING INDEX ix_series_loop_end (loop_id=? AND end_ns>?)" in str(told)
    else:
        assert "Nested Loop" in str(told)
        assert "Hash Join" not in str(told)


def test_no_loop_and_no_stretch_is_nothing_found(database: Database) -> None:
    with database.write() as connection:
        assert loops.ids_of(connection, []) == {}
        assert series.add(connection, [], None) == series.Added(0, 0)


def test_bytes_go_to_postgresql_as_bytes(settings: Settings) -> None:
    database = Database(settings.resolved_database_url)
    if database.is_sqlite:
        pytest.skip("how PostgreSQL is sent arrays")
    try:
        with database.write() as connection:
            own = connection.connection.driver_connection
            assert Transformer(own).get_dumper([b"packed"], PyFormat.AUTO).format == Format.BINARY
            casts = "(CAST(:b AS bytea[]))[1], CAST(:i AS bigint[]), CAST(:x AS float8[]), CAST(:n AS bigint[])"
            sent = text(f"SELECT {casts}")
            given = {"b": [b"\0\xff\\", None], "i": [1, None, 2**40], "x": [0.1, None], "n": [None, None]}
            told = (b"\0\xff\\", [1, None, 2**40], [0.1, None], [None, None])
            assert connection.execute(sent, given).one() == told
    finally:
        database.close()


def test_a_damaged_stretch_keeps_nothing_else_from_being_stored(
    database: Database, caplog: pytest.LogCaptureFixture
) -> None:
    add(database, "FIC1", ramp(0, 100))
    with database.write() as connection:
        connection.execute(update(series_table).values(packed=b"damaged"))
        ids = loops.ensure(connection, ["FIC1", "FIC2"])
        added = series.add(connection, [Stretch(loop_id, ramp(50, 150)) for loop_id in ids.values()], None)
    assert added == series.Added(2, 200)
    assert "are damaged" in caplog.text
    assert len(window(database, "FIC2")) == 100


def damage(database: Database, tag: str, start_ns: int) -> None:
    """Turns bytes of the stretches that begin then."""
    with database.write() as connection:
        at = series_table.c.start_ns == start_ns
        packed = connection.scalars(select(series_table.c.packed).where(at)).all()[0]
        turned = packed[:-9] + bytes(255 - byte for byte in packed[-9:])
        connection.execute(update(series_table).where(at).values(packed=turned))


def test_what_is_not_damaged_is_read_and_the_rest_told(database: Database) -> None:
    add(database, "TIC1", ramp(0, 60))
    add(database, "TIC1", ramp(60, 120))
    damage(database, "TIC1", (START + 60) * SECOND)
    with database.read() as connection:
        loop_id = loops.ids_of(connection, ["TIC1"])["TIC1"]
        asked = (loop_id, (START + 30) * SECOND, (START + 99) * SECOND)
        with pytest.raises(DamagedStretchError):
            series.between(connection, *asked)
        found = series.readable(connection, *asked)
        alone = series.readable(connection, loop_id, (START + 60) * SECOND, (START + 99) * SECOND)
    assert found.samples is not None
    assert found.samples.signals["pv"].tolist() == list(range(30, 60))
    assert found.damaged == (((START + 60) * SECOND, (START + 99) * SECOND),)
    assert (alone.samples, alone.damaged) == (None, found.damaged)


def test_what_was_sent_again_is_not_told_as_damaged(database: Database) -> None:
    add(database, "TIC1", ramp(0, 60))
    damage(database, "TIC1", START * SECOND)
    with database.write() as connection:
        loop_id = loops.ids_of(connection, ["TIC1"])["TIC1"]
        series.add(connection, [Stretch(loop_id, ramp(0, 60))], None, Place(7))
    with database.read() as connection:
        found = series.readable(connection, loop_id, START * SECOND, (START + 59) * SECOND)
    assert found.samples is not None
    assert (len(found.samples), found.damaged) == (60, ())


STRAY = 10**7
UNTIL_NS = (START + 9000) * SECOND


def seen(database: Database, hours: float) -> Samples:
    with database.read() as connection:
        loop_id = loops.ids_of(connection, ["FIC1"])["FIC1"]
        return series.windows(connection, [loop_id], hours, 10**6, until_ns=UNTIL_NS)[loop_id]


def test_a_sample_ahead_of_the_clock_hides_nothing_from_the_window(database: Database) -> None:
    stray = merged([ramp(2000, 4000), ramp(STRAY, STRAY + 1)])
    add(database, "FIC1", ramp(0, 2000), steps("sp", (-50, 7.0)), stray)
    found = seen(database, 1.0)
    assert found.time_ns[[0, -1]].tolist() == [(START + 399) * SECOND, (START + 3999) * SECOND]
    assert first(found, "sp") == 7.0
    add(database, "FIC1", ramp(4000, 5000))
    assert seen(database, 1.0).time_ns[[0, -1]].tolist() == [(START + 1399) * SECOND, (START + 4999) * SECOND]
    assert window(database, "FIC1", hours=1e6).time_ns[-1] == (START + STRAY) * SECOND  # kept all the same


def test_a_loop_that_has_nothing_but_samples_ahead_is_looked_at_as_it_stands(database: Database) -> None:
    add(database, "FIC1", ramp(STRAY, STRAY + 4000))
    assert len(seen(database, 1.0)) == 3601


def test_a_sample_ahead_of_the_clock_makes_nothing_old(database: Database) -> None:
    add(database, "FIC1", ramp(-9000, -8000), ramp(0, 2000), merged([ramp(2000, 4000), ramp(STRAY, STRAY + 1)]))
    with database.write() as connection:
        assert retention.drop_series(connection, 1.0, 500, UNTIL_NS) == 1
    assert seen(database, 100.0).time_ns[[0, -1]].tolist() == [START * SECOND, (START + 3999) * SECOND]


def test_the_newest_sample_that_is_not_ahead_of_the_clock(database: Database) -> None:
    add(database, "FIC1", ramp(0, 2000), merged([ramp(2000, 4000), ramp(STRAY, STRAY + 1)]))
    add(database, "FIC2", ramp(STRAY, STRAY + 4000))
    add(database, "FIC3", ramp(0, 2000), ramp(STRAY, STRAY + 1))
    for tag, newest in (("FIC1", 3999), ("FIC2", STRAY + 3999), ("FIC3", 1999)):
        with database.read() as connection:
            loop = loops.by_tag(connection, tag)
            assert loop is not None
            assert loop.newest_ns is not None
            told = (connection, loop.id, loop.newest_ns)
            assert series.newest_before(*told, UNTIL_NS) == (START + newest) * SECOND
            assert series.newest_before(*told, loop.newest_ns) == loop.newest_ns
            until = {"FIC1": 2000, "FIC2": newest, "FIC3": 1999}[tag]  # itself, where there is a sample of that time
            assert series.newest_before(*told, (START + 2000) * SECOND) == (START + until) * SECOND
    damage(database, "FIC1", (START + 2000) * SECOND)
    with database.read() as connection:
        assert series.newest_before(connection, 1, (START + STRAY) * SECOND, UNTIL_NS) == (START + 1999) * SECOND
