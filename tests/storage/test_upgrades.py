"""Databases with rows in every table go up from each released version, down and up again, and lose nothing."""

import datetime
import json
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import zstandard
from alembic.script import ScriptDirectory
from sqlalchemy import (
    Boolean,
    DateTime,
    Float,
    Integer,
    LargeBinary,
    MetaData,
    Table,
    insert,
    inspect,
    select,
    text,
    update,
)
from sqlalchemy.exc import IntegrityError
from sqlalchemy.schema import Column

from app.storage import Database, receipts, schema
from app.storage.samples import HEADER, Samples, pack
from tests.conftest import bare_postgres

Row = tuple[Any, ...]
RELEASED = ["0001"]
BETWEEN = ["0011", "0021"]  # with rows in tables of later than the first release: an upgrade is one transaction
ROWS = 3
STRETCH = {"id": 1, "loop_id": 1, "start_ns": 10, "end_ns": 30, "samples": 3, "fingerprint": "f"}
WORDS = {"state": "done", "role": "read", "outcome": "done"}


@pytest.fixture(scope="module")
def postgres_alone() -> Iterator[str]:
    with bare_postgres() as url:
        yield url


@pytest.fixture(params=["sqlite", "postgresql"])
def empty(request: pytest.FixtureRequest, tmp_path) -> Iterator[Database]:
    """A database without any table."""
    if request.param == "sqlite":
        database = Database(f"sqlite:///{tmp_path / 'plant.db'}")
    else:
        database = Database(request.getfixturevalue("postgres_alone"))
        with database.write() as connection:
            connection.exec_driver_sql("DROP SCHEMA public CASCADE; CREATE SCHEMA public")
    yield database
    database.close()


def found(database: Database) -> dict[str, Table]:
    metadata = MetaData()
    with database.read() as connection:
        metadata.reflect(connection)
    return {table.name: table for table in metadata.sorted_tables if table.name != "alembic_version"}


def value(column: Column[Any], number: int) -> object:
    if column.foreign_keys or (column.primary_key and isinstance(column.type, Integer)):
        return number
    if column.name in WORDS:
        return WORDS[column.name]
    kinds: list[tuple[type, object]] = [
        (Boolean, number % 2 == 0),
        (DateTime, datetime.datetime(2026, 1, 1, tzinfo=datetime.UTC) + datetime.timedelta(days=number - 1)),
        (Float, number + 0.5),
        (Integer, number),
        (LargeBinary, b"\x00\xff" * number),
    ]
    text_ = f'{{"{column.name}": {number}}}'
    return next((made for kind, made in kinds if isinstance(column.type, kind)), text_)


def fill(database: Database) -> None:
    """Rows in every table that has none."""
    add_rows(database, range(1, ROWS + 1), only_where_there_are_none=True)


def add_rows(database: Database, numbers: range, *, only_where_there_are_none: bool = False) -> None:
    for table in found(database).values():
        with database.write() as connection:
            if not only_where_there_are_none or connection.execute(select(table).limit(1)).first() is None:
                rows = [{c.name: value(c, number) for c in table.columns} for number in numbers]
                connection.execute(insert(table), rows)


def rows(database: Database, like: dict[str, list[str]]) -> dict[str, list[Row]]:
    """What the tables hold in these columns, as the driver tells it: finding out types takes longer than migrating."""
    with database.read() as connection:
        quoted = {name: ", ".join(f'"{column}"' for column in columns) for name, columns in like.items()}
        asked = {name: f"SELECT {told} FROM {name}" for name, told in quoted.items()}  # noqa: S608 - our own tables
        return {name: sorted(map(tuple, connection.exec_driver_sql(query))) for name, query in asked.items()}


def columns(database: Database) -> dict[str, list[str]]:
    with database.read() as connection:
        found_ = inspect(connection)
        names = [name for name in found_.get_table_names() if name != "alembic_version"]
        return {name: [column["name"] for column in found_.get_columns(name)] for name in names}


def versions() -> list[str]:
    script = ScriptDirectory.from_config(schema._config())
    return [revision.revision for revision in reversed(list(script.walk_revisions()))]


@pytest.mark.parametrize("version", RELEASED + BETWEEN)
def test_an_upgrade_at_once_keeps_every_row(empty: Database, version: str) -> None:
    schema.migrate(empty, version)
    fill(empty)
    then = columns(empty)
    before = rows(empty, then)
    assert all(len(found_rows) == ROWS for found_rows in before.values())
    schema.migrate(empty)
    assert schema.current_revision(empty) == schema.newest_revision()
    assert rows(empty, then) == before


def test_each_version_goes_down_and_up_again_with_rows_in_it(empty: Database) -> None:
    """Step by step: all the way up from each version and down again was a thousand steps."""
    schema.migrate(empty)
    fill(empty)
    for newer, older in pairwise(reversed(versions())):
        schema.downgrade(empty, older)
        before, after = stepped_up(empty, newer)
        assert after == before
        schema.downgrade(empty, older)


def test_what_each_version_stored_comes_up_to_the_newest(empty: Database) -> None:
    """A row in every table, in all columns that the version had, and from there through every later one."""
    first, *later = versions()
    schema.migrate(empty, first)
    for number, newer in enumerate(later, start=1):
        add_rows(empty, range(number, number + 1))
        before, after = stepped_up(empty, newer)
        assert all(before.values())
        made = {"newest_rows"} if newer == "0008" else set()  # for verdicts of before there was such a table
        assert {name for name in before if after[name] != before[name]} <= made
        assert all(set(before[name]) <= set(after[name]) for name in made)
    assert len(after["loops"]) == len(later)


def stepped_up(database: Database, newer: str) -> tuple[dict[str, list[Row]], dict[str, list[Row]]]:
    """What the tables held one version up, before and after."""
    kept = columns(database)
    before = rows(database, kept)
    schema.migrate(database, newer)
    return before, rows(database, kept)


def test_a_filled_data_base_goes_down_to_nothing_and_up(empty: Database) -> None:
    schema.migrate(empty)
    fill(empty)
    schema.downgrade(empty, "base")
    with empty.read() as connection:
        assert inspect(connection).get_table_names() == ["alembic_version"]
        assert connection.execute(text("SELECT count(*) FROM alembic_version")).scalar() == 0
    schema.migrate(empty)
    fill(empty)


def test_an_outcome_that_no_release_has_written_is_kept_beside_and_a_new_one_refused(empty: Database) -> None:
    schema.migrate(empty, "0032")
    told = {"at": "2026-01-01 00:00:00+00:00", "who": "command line", "action": "audit.start"}
    columns_ = "INSERT INTO trail (id, at, who, action, outcome, detail_json)"
    add = text(f"{columns_} VALUES (:id, :at, :who, :action, :outcome, :detail)")
    outcomes = ("done", "refused", "failed", "not_known", "by hand")
    with empty.write() as connection:
        for number, outcome in enumerate(outcomes, start=1):
            connection.execute(add, {**told, "id": number, "outcome": outcome, "detail": f'{{"n": {number}}}'})
    schema.migrate(empty)
    with empty.read() as connection:
        found_ = connection.execute(text("SELECT outcome, detail_json FROM trail ORDER BY id")).all()
    assert [row.outcome for row in found_] == ["done", "refused", "failed", "not_known", "not_known"]
    assert [json.loads(row.detail_json) for row in found_[:4]] == [{"n": number} for number in range(1, 5)]
    assert json.loads(found_[4].detail_json) == {"outcome": "by hand", "detail": '{"n": 5}'}
    with pytest.raises(IntegrityError), empty.write() as connection:
        connection.execute(add, {**told, "id": 9, "outcome": "by hand", "detail": "{}"})
    with empty.read() as connection:
        assert [index["name"] for index in inspect(connection).get_indexes("trail")] == ["ix_trail_at"]
    schema.downgrade(empty, "0032")
    with empty.write() as connection:
        connection.execute(add, {**told, "id": 9, "outcome": "by hand", "detail": "{}"})


DAMAGED = {
    "no bytes": b"",
    "no head": HEADER.pack(2, 1, 1) + b"5" + zstandard.compress(bytes(12)),
    "no coding": HEADER.pack(2, 1, 12) + b'{"sp": null}' + zstandard.compress(bytes(12)),
}


def test_what_held_is_taken_from_stretches_that_an_older_version_stored(empty: Database) -> None:
    """Those that are damaged are passed by."""
    samples = Samples(np.array([10, 20, 30]), {"sp": np.array([1.0, 2.0, np.nan]), "pv": np.array([1.0, 2.0, 3.0])})
    schema.migrate(empty, "0009")
    at = {"moment": "2026-01-01 00:00:00+00:00"}
    with empty.write() as connection:
        connection.execute(text("INSERT INTO loops (id, tag, created_at) VALUES (1, 'FIC1', :moment)"), at)
        for number, (name, packed) in enumerate({**DAMAGED, "whole": pack(samples)}.items()):
            connection.execute(
                insert(found(empty)["series"]), [{**STRETCH, "id": number, "fingerprint": name, "packed": packed}]
            )
    schema.migrate(empty)
    with empty.read() as connection:
        told = connection.execute(text("SELECT fingerprint, sp_ns, sp_last, mode_ns, mode_last FROM series")).all()
    assert {tuple(row) for row in told} == {
        ("whole", 20, 2.0, None, None),
        *((name, None, None, None, None) for name in DAMAGED),
    }


TAGS = [
    {"loop": "FIC1", "pv": "FIC1.PV", "op": "FIC1.OP", "sp": None, "mode": None, "others": ["FIC1.X", "FIC1.Y"]},
    {"loop": "LIC2\x00", "pv": "LIC2.PV", "op": None, "sp": None, "mode": None, "others": []},
]
RECEIVED = text(
    "INSERT INTO uploads (id, content_key, fingerprint, filename, size_bytes, received_at, summary_json)"
    " VALUES (:id, :id, 'f', 'plant.csv', 1, '2026-01-01 00:00:00+00:00', :summary)"
)


def test_tags_that_an_older_version_stored_with_the_summary_move_and_are_counted(empty: Database) -> None:
    """More uploads than are read at a time, one of them not read yet; back again, everything is in one place."""
    schema.migrate(empty, "0015")
    told = [{"rows_kept": number, "tags": TAGS} for number in range(12)]
    told[3]["tags_found"] = 9
    summaries = [*map(json.dumps, told), None]
    with empty.write() as connection:
        for number, summary in enumerate(summaries, 1):
            connection.execute(RECEIVED.bindparams(id=number, summary=summary))
    schema.migrate(empty)
    with empty.read() as connection:
        found = connection.execute(text("SELECT summary_json, tags_json FROM uploads ORDER BY id")).all()
    assert [json.loads(row.tags_json) for row in found[:-1]] == [TAGS] * 12
    counted = [5, 5, 5, 9, *[5] * 8]
    assert [json.loads(row.summary_json) for row in found[:-1]] == [
        {"rows_kept": number, "tags_found": count} for number, count in enumerate(counted)
    ]
    assert tuple(found[-1]) == (None, None)
    schema.downgrade(empty, "0015")
    with empty.read() as connection:
        (first, *_, last) = connection.scalars(text("SELECT summary_json FROM uploads ORDER BY id")).all()
    assert json.loads(first) == {"rows_kept": 0, "tags_found": 5, "tags": TAGS}
    assert last is None


def test_uploads_that_wait_are_numbered_before_all_that_come(empty: Database) -> None:
    schema.migrate(empty, "0019")
    with empty.write() as connection:
        for number in (1, 3, 7, 9):
            connection.execute(RECEIVED.bindparams(id=number, summary=None))
        connection.execute(text("UPDATE uploads SET state = 'done' WHERE id IN (1, 9)"))
    schema.migrate(empty)
    with empty.write() as connection:
        numbers = connection.scalars(text("SELECT receipt_number FROM uploads ORDER BY id")).all()
        assert (numbers, receipts.next_number(connection)) == ([0, 3, 7, 0], 10)
        assert [receipts.unread_before(connection, number) for number in (10, 7, 3)] == [7, 3, 0]


def test_newest_rows_of_before_know_of_which_record_their_verdicts_are(empty: Database) -> None:
    schema.migrate(empty, "0033")
    fill(empty)
    tables = found(empty)
    said = {"audit_id": 2, "input_end_ns": 77, "window_end": None}
    with empty.write() as connection:
        row = {c.name: value(c, 1) for c in tables["verdicts"].columns}
        connection.execute(insert(tables["verdicts"]), row | said)
        connection.execute(update(tables["newest_rows"]).values(audit_id=2).where(tables["newest_rows"].c.loop_id == 1))
    schema.migrate(empty, "0034")
    rows = found(empty)["newest_rows"]
    told = (rows.c.loop_id, rows.c.input_end_ns, rows.c.window_end, rows.c.audited_at)
    with empty.read() as connection:
        first, second, *_ = connection.execute(select(*told).order_by(rows.c.loop_id)).all()
    assert first[:3] == (1, 77, None)
    assert second[1] == 2
    assert None not in (first.audited_at, second.audited_at, second.window_end)


def test_runs_of_before_know_how_far_the_records_of_their_plant_reached(empty: Database) -> None:
    """Not what was ahead of their clock, nor what has no date; a run of some loops knows what those before it were
    given."""
    schema.migrate(empty, "0028")
    tables, day = found(empty), 86_400 * 10**9
    begun = [datetime.datetime(2026, 1, number, 2, tzinfo=datetime.UTC) for number in range(1, 5)]
    midnight = int(datetime.datetime(2026, 1, 1, tzinfo=datetime.UTC).timestamp()) * 10**9
    given = {1: [5, midnight, None], 2: [midnight + day, midnight + 90 * day], 3: [midnight - 9 * day], 4: []}
    with empty.write() as connection:
        kept = {name: value(tables["loops"].c[name], 1) for name in ("id", "tag", "importance", "created_at")}
        connection.execute(insert(tables["loops"]), [{**kept, "id": id_, "tag": str(id_)} for id_ in (1, 2, 3)])
        for number, at in enumerate(begun, start=1):
            row = {c.name: value(c, number) for c in tables["audits"].columns} | {"created_at": at}
            connection.execute(insert(tables["audits"]), row)
            for loop, end_ns in enumerate(given[number], start=1):
                row = {c.name: value(c, number) for c in tables["verdicts"].columns}
                told = {"loop_id": loop, "audit_id": number, "input_end_ns": end_ns}
                connection.execute(insert(tables["verdicts"]), row | told)
    schema.migrate(empty, "0029")
    audits = found(empty)["audits"]
    with empty.read() as connection:
        reached = list(connection.execute(select(audits.c.newest_ns).order_by(audits.c.id)).scalars())
    assert reached == [midnight, midnight + day, midnight + day, midnight + day]
