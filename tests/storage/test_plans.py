"""What is asked most is answered by index: on PostgreSQL at a size at which reading whole tables would be felt; SQLite
plans the same whatever the tables hold."""

import json
import re
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest
from sqlalchemy import Connection, event
from zstandard import ZstdError

from app.services.recency import OLD_FROM
from app.storage import (
    Database,
    arrivals,
    audits,
    changes,
    deliveries,
    explanations,
    figures,
    items,
    loops,
    nights,
    receipts,
    retention,
    series,
    set_apart,
    standstill,
    unanswered,
    uploads,
    verdicts,
)
from app.storage.asked_rows import Order, RowFilter
from app.storage.audits import LoopFilter
from app.storage.details import detail_of
from app.storage.samples import Samples, pack
from tests.conftest import own_postgres

NIGHTS = 20
TAGS = [f"L{number}" for number in range(1, 101)]
RUN = {
    "trigger": "request",
    "plant": "p",
    "config_json": "{}",
    "config_fingerprint": "",
    "window_h": 24.0,
    "window_samples": 1000,
}
PACKED = pack(Samples(np.array([150]), {"pv": np.array([1.0])})).hex()

FILL = (
    "INSERT INTO loops (tag, created_at, newest_ns) SELECT 'L' || n, now(), 1000 FROM generate_series(1, 1500) n",
    "INSERT INTO audits (trigger, plant, nightly_for, state, config_json, config_fingerprint, window_h, window_samples,"
    " created_at, total)"
    " SELECT 'nightly', 'p', n::text, CASE n WHEN 20 THEN 'running' ELSE 'done' END, '', '', 1, 1, now(), 1"
    " FROM generate_series(1, 20) n",
    "INSERT INTO verdicts (loop_id, audit_id, audited_at, samples, verdict, reliability, engine_version, elapsed_s,"
    " input_fingerprint, config_fingerprint, reasons, reasons_text)"
    " SELECT l.id, a.id, now(), 1, 'stiction', 'reliable', '', 0, '', '', repeat('r', 200), repeat('t', 600)"
    " FROM audits a CROSS JOIN loops l",
    "INSERT INTO verdict_details SELECT loop_id, audit_id, repeat('p', 300)::bytea FROM verdicts",
    "INSERT INTO newest_rows (loop_id, audit_id, form, row_json) SELECT id, 20, 'f', repeat('x', 1500) FROM loops",
    "UPDATE loops SET newest_audit_id = (SELECT max(id) FROM audits)",
    "INSERT INTO audit_items (audit_id, loop_id, state) SELECT a.id, l.id, CASE WHEN a.id = "
    "(SELECT max(id) FROM audits) AND mod(l.id, 10) = 0 THEN 'open' ELSE 'done' END FROM audits a CROSS JOIN loops l"
    " ORDER BY a.id, l.id",
    "INSERT INTO series (loop_id, start_ns, end_ns, samples, fingerprint, packed)"
    " SELECT l.id, n * 100, n * 100 + 99, 1, n::text, decode('PACKED', 'hex')"
    " FROM loops l CROSS JOIN generate_series(1, 10) n",
    "INSERT INTO audits (trigger, plant, state, config_json, config_fingerprint, window_h, window_samples, created_at,"
    " ended_at, total) SELECT 'request', 'p', 'done', '', '', 1, 1, now(), now(), 1 FROM generate_series(1, 3000) n",
    "INSERT INTO uploads (content_key, fingerprint, filename, size_bytes, received_at, ended_at, state)"
    " SELECT n::text, md5(n::text), 'f', 1, now(), now(), 'done' FROM generate_series(1, 3000) n",
    "INSERT INTO explanations (loop_id, state, asked_at, ended_at)"
    " SELECT 1 + mod(n, 1500), 'done', now(), now() FROM generate_series(1, 3000) n",
    "INSERT INTO deliveries (audit_id, receiver, state, ended_at)"
    " SELECT id, 'mailto:me@example.org', 'done', now() FROM audits WHERE state = 'done'",
)


@pytest.fixture(scope="module")
def filled_postgres() -> Iterator[Database]:
    """Filled once, for five seconds of the server's."""
    with own_postgres() as url:
        database = Database(url)
        with database.write() as connection:
            for statement in FILL:
                connection.exec_driver_sql(statement.replace("PACKED", PACKED))
        with database.writer.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
            connection.exec_driver_sql("VACUUM ANALYZE")
        yield database
        database.close()


@pytest.fixture
def plant(filled_postgres: Database) -> Iterator[Connection]:
    """In a transaction that is rolled back: the next test finds the same rows."""
    with filled_postgres.write() as connection:
        yield connection
        connection.get_transaction().rollback()


def _one_detail(connection: Connection) -> None:
    with pytest.raises(ZstdError):  # what is stored here is no detail; how it is found is what counts
        detail_of(connection, 77, 3)


ASKED = {
    "the newest verdict of a loop": lambda c: verdicts.newest(c, "L77"),
    "a loop's history": lambda c: verdicts.history(c, 77, 30, None),
    "the detail of a verdict": _one_detail,
    "a loop by its tag": lambda c: loops.by_tag(c, "L77"),
    "a page of loops": lambda c: loops.page(c, 100, "L5"),
    "samples of a chunk of loops": lambda c: series.windows(c, range(1, 33), 1e-9, 10),
    "samples between two times": lambda c: series.between(c, 77, 150, 400),
    "a claim": lambda c: items.claim(c, NIGHTS, "w", 32, 45.0),
    "progress of a run": lambda c: audits.progress(c, [NIGHTS]),
    "runs by the page": lambda c: audits.page(c, 50, None),
    "last nights of a page": lambda c: nights.recent(c, TAGS, 14),
    "last nights up to a run": lambda c: nights.recent(c, TAGS, 14, NIGHTS - 1),
    "since when PVs are still": lambda c: unanswered.unanswered_before(c, range(1, 51)),
    "whether anything is new": lambda c: arrivals.anything_new(c, NIGHTS),
}
LARGE = {"verdicts", "verdict_details", "series", "audit_items"}


def test_large_tables_are_read_by_index(plant: Connection) -> None:
    read_whole = {}
    for name, ask in ASKED.items():
        nodes = [node for plan in _plans(plant, ask) for node in _nodes(plan)]
        assert nodes, name
        read_whole[name] = LARGE & {node["Relation Name"] for node in nodes if node["Node Type"] == "Seq Scan"}
    assert not any(read_whole.values()), read_whole


def test_a_claim_touches_what_it_takes_however_many_loops_wait(plant: Connection) -> None:
    """Of a run that was planned a moment ago, of which the planner knows nothing yet."""
    run = audits.plan(plant, RUN, LoopFilter()) or 0
    touched = [
        (node["Actual Rows"] + node.get("Rows Removed by Filter", 0)) * node["Actual Loops"]
        for plan in _plans(plant, lambda c: items.claim(c, run, "w", 32, 45.0), "ANALYZE, ")
        for node in _nodes(plan)
    ]
    assert audits.progress(plant, [run])[run].claimed >= 32
    assert max(touched) <= 3 * 32  # of 1500


@pytest.mark.parametrize("name", ["last nights of a page", "last nights up to a run", "since when PVs are still"])
def test_where_a_loops_last_nights_begin_is_looked_for_once_a_loop(plant: Connection, name: str) -> None:
    walks = [
        node["Actual Loops"]
        for plan in _plans(plant, ASKED[name], "ANALYZE, ")
        for node in _nodes(plan)
        if node.get("Relation Name") == "verdicts" and node.get("Alias") == "counted"
    ]
    assert walks
    assert max(walks) <= len(TAGS)


def test_the_whole_table_reads_no_verdict(plant: Connection) -> None:
    """Rows come as they were written; in the usual orders no other table than the two small ones is touched."""
    order = Order("stiction_probability", descending=True)
    plans = _plans(plant, lambda c: verdicts.sent_rows(c, 20_000, order, RowFilter(), None))
    nodes = [node for plan in plans for node in _nodes(plan)]
    assert {node["Relation Name"] for node in nodes if "Relation Name" in node} == {"loops", "newest_rows"}


@pytest.mark.parametrize(
    "ask",
    [figures.waiting, verdicts.swings, verdicts.said, lambda c: set_apart.of_newest(c, OLD_FROM)],
    ids=["waiting", "swings", "said", "set apart"],
)
def test_a_probe_and_the_end_of_a_night_read_no_verdict(database: Database, ask: Callable[[Connection], Any]) -> None:
    told: list[str] = []
    with database.write() as connection:
        event.listen(connection, "before_cursor_execute", lambda *told_: told.append(told_[2]))
        ask(connection)
    assert told
    assert not [statement for statement in told if re.search(r"\bverdicts\b", statement)]


def test_what_changed_is_found_without_the_wide_rows(database: Database) -> None:
    """SQLite begins where a condition tempts it to: of the loops, it would read the text of each one's row."""
    if not database.is_sqlite:
        pytest.skip("plans of SQLite")
    with database.write() as connection:
        told = _steps(connection, lambda c: changes.since_run(c, 1, 10))
    assert "SCAN newest_rows USING COVERING INDEX ix_newest_rows_board" in told


def test_what_is_set_apart_is_counted_without_the_wide_rows(database: Database) -> None:
    if not database.is_sqlite:
        pytest.skip("plans of SQLite")
    with database.write() as connection:
        told = _steps(connection, lambda c: set_apart.of_newest(c, OLD_FROM))
    assert [step for step in told if "COVERING INDEX ix_newest_rows_board" in step], told


def test_whether_anything_is_new_is_asked_of_few_loops_by_themselves(plant: Connection) -> None:
    """On a night without an export nothing is; two runs are compared as a whole then."""
    plant.exec_driver_sql("UPDATE verdicts SET input_end_ns = 1000")
    walks = [
        node["Actual Loops"]
        for plan in _plans(plant, lambda c: arrivals.anything_new(c, NIGHTS), "ANALYZE, ")
        for node in _nodes(plan)
        if node.get("Alias", "").startswith("earlier")
    ]
    assert walks
    assert max(walks) <= arrivals.FIRST_FEW


def test_tags_are_found_without_comparing_each_with_each(plant: Connection) -> None:
    """A plan made for an empty table, and kept, would do so for a whole plant: a quarter of the upload's time."""
    tags = [f"L{number}" for number in range(1, 1001)]
    plans = list(_plans(plant, lambda c: loops.ids_of(c, tags)))
    assert loops.ids_of(plant, [*tags, "none"]).keys() == set(tags)
    assert plans
    assert not any("ANY" in node.get("Filter", "") for plan in plans for node in _nodes(plan))


LEASE_S = 40.0
LONG_AGO = datetime(2020, 1, 1, tzinfo=UTC)
FINGERPRINT = "c4ca4238a0b923820dcc509a6f75849b"
ALWAYS = {
    "loops of lost workers": lambda c: items.reopen_expired(c, 3, LEASE_S),
    "explanations of lost workers": lambda c: explanations.reopen_expired(c, 3, LEASE_S),
    "digests of lost workers": lambda c: deliveries.reopen_expired(c, 8, LEASE_S),
    "runs that are complete": audits.complete,
    "runs to announce": lambda c: audits.to_announce(c, 20.0),
    "uploads of lost readers": lambda c: uploads.give_up(c, 10, LEASE_S),
    "uploads to announce": lambda c: uploads.to_announce(c, 20.0, LEASE_S),
    "uploads that wait for room": uploads.waiting_for_room,
    "uploads that are unread": uploads.unread_fingerprints,
    "uploads whose files are not seen": uploads.unseen,
    "an unread upload before another": lambda c: receipts.unread_before(c, 5),
    "uploads of the same bytes": lambda c: uploads.keys_of(c, FINGERPRINT, "{}"),
    "whether bytes are needed": lambda c: retention.must_keep(c, FINGERPRINT, LONG_AGO),
    "explanations to announce": lambda c: explanations.to_announce(c, 20.0),
    "whether an explanation waits": explanations.any_waiting,
    "an explanation to work on": lambda c: explanations.claim_next(c, "w", LEASE_S),
    "digests that are due": deliveries.due,
    "a digest to send": lambda c: deliveries.claim_next(c, "w", LEASE_S),
    "what waits": figures.waiting,
    "whether workers stand still": standstill.standstill_s,
}
GROWING = {"uploads", "explanations", "deliveries", "audits", *LARGE}
WALK = re.compile(r"(?:SCAN|SEARCH) (\w+)(?: USING (?:COVERING )?INDEX (\w+))?")  # of an index too, without a condition
OF_WHAT_IS_TO_DO = {
    *("ix_uploads_unread", "ix_audits_unfinished", "ix_explanations_unfinished", "ix_deliveries_unfinished"),
    *("ix_audit_items_open", "ix_audit_items_claimed"),
}
"""Indexes that stay small."""


@pytest.fixture
def filled(database: Database, request: pytest.FixtureRequest) -> Iterator[Connection]:
    if not database.is_sqlite:
        yield request.getfixturevalue("plant")
        return
    with database.write() as connection:
        yield connection


def test_what_is_asked_all_the_time_reads_what_is_to_do_however_much_was_done(filled: Connection) -> None:
    read = {name: _read_whole(filled, ask) & GROWING for name, ask in ALWAYS.items()}
    assert not any(read.values()), read


def test_a_claim_finds_what_is_open_among_what_is_done(filled: Connection) -> None:
    claim = lambda c: items.claim(c, NIGHTS, "w", 32, 45.0)  # noqa: E731
    if _is_sqlite(filled):
        told = _steps(filled, claim)
    else:
        told = [node.get("Index Name", "") for plan in _plans(filled, claim) for node in _nodes(plan)]
    assert any("ix_audit_items_open" in one for one in told), told


def test_failures_are_counted_without_those_of_all_runs(filled: Connection) -> None:
    assert "audit_items" not in _read_whole(filled, figures.collect)


def test_what_is_old_is_found_loop_by_loop_and_run_by_run(filled: Connection) -> None:
    """At the end of each night a statement finds that nothing is left: it must not walk all there is."""
    asked: list[Callable[[Connection], Any]] = [
        lambda c: retention.drop_details(c, LONG_AGO, 500),
        lambda c: retention.drop_verdicts(c, LONG_AGO, 500),
    ]
    if _is_sqlite(filled):  # PostgreSQL would rather read so few stretches as there are here
        asked.append(lambda c: retention.drop_series(c, 24.0, 500, 10**18, 10**17))
    assert not [found for ask in asked if (found := _read_whole(filled, ask) & LARGE)]


def _is_sqlite(connection: Connection) -> bool:
    return connection.dialect.name == "sqlite"


def _read_whole(connection: Connection, ask: Callable[[Connection], Any]) -> set[str]:
    """The tables that are read from one end to the other."""
    if _is_sqlite(connection):
        steps = _steps(connection, ask)
        assert steps
        walked = [found for step in steps if (found := WALK.fullmatch(step))]
        return {table for table, index in map(re.Match.groups, walked) if index not in OF_WHAT_IS_TO_DO}
    nodes = [node for plan in _plans(connection, ask) for node in _nodes(plan)]
    assert nodes
    return {node["Relation Name"] for node in nodes if node["Node Type"] == "Seq Scan"}


def _steps(connection: Connection, ask: Callable[[Connection], Any]) -> list[str]:
    """Of SQLite's plans of the statements that `ask` sends."""
    told: list[str] = []

    def note(_: Any, __: Any, statement: str, parameters: Any, *___: Any) -> None:
        told.extend(row[3] for row in connection.connection.execute(f"EXPLAIN QUERY PLAN {statement}", parameters))

    event.listen(connection, "before_cursor_execute", note)
    ask(connection)
    event.remove(connection, "before_cursor_execute", note)
    return told


def _plans(connection: Connection, ask: Any, how: str = "") -> Iterator[dict[str, Any]]:
    """The plans of the statements that `ask` sends; with `how` "ANALYZE, " they are sent again."""
    sent: list[tuple[str, Any]] = []

    def note(_: Any, __: Any, statement: str, parameters: Any, *___: Any) -> None:
        sent.append((statement, parameters))

    event.listen(connection, "before_cursor_execute", note)
    ask(connection)
    event.remove(connection, "before_cursor_execute", note)
    for statement, parameters in sent:
        found = connection.exec_driver_sql(f"EXPLAIN ({how}FORMAT JSON) {statement}", parameters).scalar()
        plan = json.loads(found) if isinstance(found, str) else found
        yield plan[0]["Plan"]


def _nodes(plan: dict[str, Any]) -> Iterator[dict[str, Any]]:
    yield plan
    for part in plan.get("Plans", ()):
        yield from _nodes(part)
