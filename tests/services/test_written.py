"""What is written of loops stands in the rows that others read, too, and changes what their answers are known by."""

import json
import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from sqlalchemy import Engine, event, update

from app.services.audit_json.models import TableRow, WrittenFields
from app.services.auditing import audits, chunks
from app.services.backend import Backend
from app.services.plant import loop_verdicts, reliability
from app.services.plant.reliability import RowFilter
from app.services.stating import notes
from app.services.telling.next_steps import Ask
from app.services.telling.wording import rely
from app.storage.tables import loops

AddLoops = Callable[..., dict[str, int]]
TAGS = ("FIC0", "FIC1", "FIC2", "FIC3")
TOMORROW = datetime.now(UTC) + timedelta(days=1)


@pytest.fixture
def plant(backend: Backend, add_loops: AddLoops) -> Backend:
    add_loops(*TAGS, n=150)
    run = audits.start_audit(backend)
    while chunks.audit_chunk(backend, int(run.id), "test"):
        pass
    return backend


def sent(backend: Backend, **asked: Any) -> list[dict[str, Any]]:
    return json.loads(reliability.reliability_json(backend, **asked).write())["rows"]


def write(backend: Backend) -> None:
    notes.add_note(backend, "FIC1", "", work_order="WO-17")
    notes.add_note(backend, "FIC2", "seat ground", "WO-18", datetime.now(UTC) - timedelta(hours=1))
    notes.add_note(backend, "FIC3", "in the shutdown", shelved_until=TOMORROW)


def test_rows_tell_what_their_page_tells(plant: Backend) -> None:
    write(plant)
    names = list(WrittenFields.model_fields)
    on_page = {row["loop"]: {name: row[name] for name in names} for row in reliability.table(plant, 10).rows}
    whole = {"rows": sent(plant), "csv": reliability.reliability_page(plant).rows, "run": _of_run(plant)}
    for rows in whole.values():
        assert {row["loop"]: {name: row[name] for name in names} for row in rows} == on_page
        assert all(set(row) == set(TableRow.model_fields) for row in rows)
    for tag in TAGS:
        health = json.loads(loop_verdicts.loop_health_json(plant, tag))
        assert {name: health[name] for name in names} == on_page[tag]
    assert on_page["FIC0"]["next_step"]
    assert (on_page["FIC1"]["work_order"], on_page["FIC1"]["of_before_repair"]) == ("WO-17", False)
    assert (on_page["FIC2"]["next_step"], on_page["FIC2"]["of_before_repair"]) == (Ask.WAIT, True)
    assert on_page["FIC3"]["next_step"].startswith("Wait: shelved until")


def _of_run(backend: Backend) -> list[dict[str, Any]]:
    return sent(backend, filters=RowFilter(audit_id=1))


def test_the_version_of_an_answer_changes_with_what_is_written(plant: Backend) -> None:
    seen = {reliability.reliability_json(plant).version}
    notes.add_note(plant, "FIC1", "", work_order="WO-17")
    seen.add(reliability.reliability_json(plant).version)
    repair = notes.add_note(plant, "FIC2", "seat ground", repaired_at=datetime.now(UTC))
    seen.add(reliability.reliability_json(plant).version)
    shelved = notes.add_note(plant, "FIC3", "in the shutdown", shelved_until=TOMORROW)
    seen.add(reliability.reliability_json(plant).version)
    assert len(seen) == 4
    notes.end_shelving(plant, "FIC3", shelved.id)
    notes.withdraw_repair(plant, "FIC2", repair.id)
    assert reliability.reliability_json(plant).version in seen, "what is withdrawn is as if it had not been written"
    notes.add_note(plant, "FIC0", "seen in the field, nothing to do")
    assert reliability.reliability_json(plant).version in seen


def test_a_row_of_an_old_record_says_so_wherever_it_is_told(plant: Backend) -> None:
    with plant.database.write() as connection:
        connection.execute(update(loops).values(newest_ns=time.time_ns()))
    seen = reliability.reliability_json(plant).version
    with plant.database.write() as connection:
        older = update(loops).values(newest_ns=loops.c.newest_ns - 3 * 86_400 * 1_000_000_000)
        connection.execute(older.where(loops.c.tag == "FIC0"))
        connection.execute(update(loops).values(newest_ns=1).where(loops.c.tag == "FIC3"))
    assert reliability.reliability_json(plant).version != seen
    for rows in (sent(plant), reliability.reliability_page(plant).rows, reliability.table(plant, 10).rows):
        assert {row["loop"] for row in rows if row["of_old_record"]} == {"FIC0"}, "how old is not known without a date"
        rows = sorted(rows, key=lambda row: row["loop"])
        assert rows[0]["next_step"] == Ask.NOTHING_NEWER != rows[1]["next_step"]
    health = json.loads(loop_verdicts.loop_health_json(plant, "FIC0"))
    assert (health["of_old_record"], rely(health)) == (True, "of an old record")
    assert not json.loads(loop_verdicts.loop_health_json(plant, "FIC1"))["of_old_record"]
    (row,) = [row for row in sent(plant, columns=["loop", "of_old_record"]) if row["of_old_record"]]
    assert row["loop"] == "FIC0"


def test_of_a_collection_of_records_of_the_past_none_is_told_to_be_old(plant: Backend) -> None:
    past_ns = time.time_ns() - 60 * 86_400 * 1_000_000_000
    with plant.database.write() as connection:
        connection.execute(update(loops).values(newest_ns=past_ns))
        older = update(loops).values(newest_ns=past_ns - 9 * 86_400 * 1_000_000_000)
        connection.execute(older.where(loops.c.tag == "FIC0"))
    assert not any(row["of_old_record"] for row in sent(plant))


def test_more_rows_take_no_more_questions(plant: Backend) -> None:
    write(plant)
    asked: list[str] = []

    def note(*told: Any) -> None:
        asked.append(told[2])

    event.listen(Engine, "before_cursor_execute", note)
    try:
        counts = [_questions(plant, limit, asked) for limit in (3, 4)]
    finally:
        event.remove(Engine, "before_cursor_execute", note)
    assert counts[0] == counts[1]


def _questions(backend: Backend, limit: int, asked: list[str]) -> tuple[int, int]:
    asked.clear()
    reliability.reliability_page(backend, limit, sort="-loop")
    of_page = len(asked)
    reliability.reliability_json(backend, limit, sort="-loop").write()
    return of_page, len(asked) - of_page
