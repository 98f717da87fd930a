"""PostgreSQL answers what is asked most by index, at a size at which reading whole tables would be felt."""

import json
import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from sqlalchemy import Connection, event
from zstandard import ZstdError

from app.storage import Database, audits, figures, items, loops, series, verdicts
from app.storage import plant as plants
from app.storage.audits import LoopFilter
from app.storage.samples import Samples, pack
from app.storage.verdicts import RowFilter

NIGHTS = 20
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
    " SELECT 'nightly', 'p', n::text, 'running', '', '', 1, 1, now(), 1 FROM generate_series(1, 20) n",
    "INSERT INTO verdicts (loop_id, audit_id, audited_at, samples, verdict, reliability, engine_version, elapsed_s,"
    " input_fingerprint, config_fingerprint, reasons, reasons_text)"
    " SELECT l.id, a.id, now(), 1, 'stiction', 'reliable', '', 0, '', '', repeat('r', 200), repeat('t', 600)"
    " FROM audits a CROSS JOIN loops l",
    "INSERT INTO verdict_details SELECT loop_id, audit_id, repeat('p', 300)::bytea FROM verdicts",
    "INSERT INTO newest_rows (loop_id, audit_id, form, row_json) SELECT id, 20, 'f', repeat('x', 1500) FROM loops",
    "UPDATE loops SET newest_audit_id = (SELECT max(id) FROM audits)",
    "INSERT INTO audit_items (audit_id, loop_id, state) SELECT a.id, l.id, CASE WHEN a.id = "
    "(SELECT max(id) FROM audits) AND mod(l.id, 10) = 0 THEN 'open' ELSE 'done' END FROM audits a CROSS JOIN loops l",
    "INSERT INTO series (loop_id, start_ns, end_ns, samples, fingerprint, packed)"
    " SELECT l.id, n * 100, n * 100 + 99, 1, n::text, decode('PACKED', 'hex')"
    " FROM loops l CROSS JOIN generate_series(1, 10) n",
)


@pytest.fixture
def plant(database: Database) -> Database:
    if database.is_sqlite:
        pytest.skip("plans of PostgreSQL")
    with database.write() as connection:
        for statement in FILL:
            connection.exec_driver_sql(statement.replace("PACKED", PACKED))
    with database.writer.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
        connection.exec_driver_sql("VACUUM ANALYZE")
    return database


def _one_detail(connection: Connection) -> None:
    with pytest.raises(ZstdError):  # what is stored here is no detail; how it is found is what counts
        verdicts.detail(connection, 77, 3)


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
}
LARGE = {"verdicts", "verdict_details", "series", "audit_items"}


def test_large_tables_are_read_by_index(plant: Database) -> None:
    read_whole = {}
    with plant.write() as connection:
        for name, ask in ASKED.items():
            nodes = [node for plan in _plans(connection, ask) for node in _nodes(plan)]
            assert nodes, name
            read_whole[name] = LARGE & {node["Relation Name"] for node in nodes if node["Node Type"] == "Seq Scan"}
    assert not any(read_whole.values()), read_whole


def test_a_claim_touches_what_it_takes_however_many_loops_wait(plant: Database) -> None:
    """Of a run that was planned a moment ago, of which the planner knows nothing yet."""
    with plant.write() as connection:
        run = audits.plan(connection, RUN, LoopFilter()) or 0
        touched = [
            (node["Actual Rows"] + node.get("Rows Removed by Filter", 0)) * node["Actual Loops"]
            for plan in _plans(connection, lambda c: items.claim(c, run, "w", 32, 45.0), "ANALYZE, ")
            for node in _nodes(plan)
        ]
        assert audits.progress(connection, [run])[run].claimed >= 32
    assert max(touched) <= 3 * 32  # of 1500


def test_the_whole_table_reads_no_verdict(plant: Database) -> None:
    """Rows come as they were written; in the usual orders no other table than the two small ones is touched."""
    with plant.write() as connection:
        ask = lambda c: verdicts.sent_rows(c, 20_000, "stiction_probability", True, RowFilter(), None)  # noqa: E731
        nodes = [node for plan in _plans(connection, ask) for node in _nodes(plan)]
    assert {node["Relation Name"] for node in nodes if "Relation Name" in node} == {"loops", "newest_rows"}


@pytest.mark.parametrize("ask", [figures.waiting, verdicts.swings, verdicts.said], ids=["waiting", "swings", "said"])
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
    told: list[str] = []

    def note(_: Any, __: Any, statement: str, parameters: Any, *___: Any) -> None:
        told.extend(row[3] for row in connection.connection.execute(f"EXPLAIN QUERY PLAN {statement}", parameters))

    with database.write() as connection:
        event.listen(connection, "before_cursor_execute", note)
        plants.changes(connection, 1, 10)
    assert "SCAN newest_rows USING COVERING INDEX ix_newest_rows_board" in told


def test_tags_are_found_without_comparing_each_with_each(plant: Database) -> None:
    """A plan made for an empty table, and kept, would do so for a whole plant: a quarter of the upload's time."""
    tags = [f"L{number}" for number in range(1, 1001)]
    with plant.write() as connection:
        plans = list(_plans(connection, lambda c: loops.ids_of(c, tags)))
        assert loops.ids_of(connection, [*tags, "none"]).keys() == set(tags)
    assert plans
    assert not any("ANY" in node.get("Filter", "") for plan in plans for node in _nodes(plan))


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
