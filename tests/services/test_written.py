"""What is written of loops stands in the rows that others read, too, and changes what their answers are known by."""

import json
import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pytest
from sqlalchemy import Engine, delete, event, select, update

from app.services.audit_json.models import TableRow, WrittenFields
from app.services.auditing import audits, chunks
from app.services.backend import Backend
from app.services.plant import loop_verdicts, reliability
from app.services.plant.reliability import RowFilter
from app.services.stating import notes
from app.services.stating.properties import patch_loop
from app.services.telling.next_steps import Ask
from app.services.telling.wording import rely
from app.storage import loops as stored_loops
from app.storage import series, tables
from app.storage.samples import Samples
from app.storage.series import Stretch
from tests.table_rows import table_page

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
    return json.loads(reliability.in_parts(backend, **asked).as_json())["rows"]


def write(backend: Backend) -> None:
    notes.add_note(backend, "FIC1", "", work_order="WO-17")
    notes.add_note(backend, "FIC2", "seat ground", "WO-18", datetime.now(UTC) - timedelta(hours=1))
    notes.add_note(backend, "FIC3", "in the shutdown", shelved_until=TOMORROW)


def test_rows_tell_what_their_page_tells(plant: Backend) -> None:
    write(plant)
    names = list(WrittenFields.model_fields)
    on_page = {row["loop"]: {name: row[name] for name in names} for row in reliability.table(plant, 10).rows}
    whole = {"rows": sent(plant), "csv": _in_parts(plant), "run": _of_run(plant)}
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
    (part,) = reliability.in_parts(backend, filters=RowFilter(audit_id=1), of_loop=True).parts()
    return [{name: row[name] for name in TableRow.model_fields} for row in part.rows]


def test_the_version_of_an_answer_changes_with_what_is_written(plant: Backend) -> None:
    seen = {reliability.in_parts(plant).version}
    notes.add_note(plant, "FIC1", "", work_order="WO-17")
    seen.add(reliability.in_parts(plant).version)
    repair = notes.add_note(plant, "FIC2", "seat ground", repaired_at=datetime.now(UTC))
    seen.add(reliability.in_parts(plant).version)
    shelved = notes.add_note(plant, "FIC3", "in the shutdown", shelved_until=TOMORROW)
    seen.add(reliability.in_parts(plant).version)
    assert len(seen) == 4
    notes.end_shelving(plant, "FIC3", shelved.id)
    notes.withdraw_repair(plant, "FIC2", repair.id)
    assert reliability.in_parts(plant).version in seen, "what is withdrawn is as if it had not been written"
    notes.add_note(plant, "FIC0", "seen in the field, nothing to do")
    assert reliability.in_parts(plant).version in seen


@pytest.mark.parametrize(
    "changes", [{"type": "flow"}, {"description": "feed"}, {"owner": "team A"}, {"importance": 7.0}, {"unit": "U9"}]
)
def test_the_version_of_a_page_changes_with_what_its_loops_are_where_it_tells_that(
    plant: Backend, changes: dict[str, Any]
) -> None:
    def asked(of_loop: bool) -> tuple[str, list[dict[str, Any]]]:
        return reliability.in_parts(plant, of_loop=of_loop).version, _in_parts(plant, of_loop=of_loop)

    before = {of_loop: asked(of_loop) for of_loop in (False, True)}
    patch_loop(plant, "FIC1", changes)
    for of_loop, (version, rows) in before.items():
        version_now, rows_now = asked(of_loop)
        assert (version_now != version) == (rows_now != rows) == (of_loop or "unit" in changes)


def recorded(backend: Backend, **days_ago: float) -> None:
    """A record of some hours for each of the loops, which ended so many days ago."""
    random = np.random.default_rng(1)
    with backend.database.write() as connection:
        ids = stored_loops.ensure(connection, days_ago)
        for tag, days in days_ago.items():
            times = time.time_ns() - round(days * 86_400) * 10**9 + np.arange(-149, 1) * 60 * 10**9
            op = 50 + 5 * np.sin(np.arange(150) / 6) + random.normal(size=150)
            samples = Samples(times, {"pv": np.roll(op, 3) + random.normal(size=150), "op": op})
            series.add(connection, [Stretch(ids[tag], samples)], None)


def judge(backend: Backend) -> int:
    run = int(audits.start_audit(backend).id)
    while chunks.audit_chunk(backend, run, "test"):
        pass
    return run


def old_of(rows: list[dict[str, Any]]) -> set[str]:
    return {row["loop"] for row in rows if row["of_old_record"]}


def test_a_row_of_an_old_record_says_so_wherever_it_is_told(backend: Backend, warm_kernels: None) -> None:
    recorded(backend, FIC0=3, FIC1=0.1, FIC2=1.5, FIC3=20_700)
    judge(backend)
    for rows in (sent(backend), table_page(backend).rows, reliability.table(backend, 10).rows):
        assert old_of(rows) == {"FIC0"}, "how old is not known without a date"
        rows = sorted(rows, key=lambda row: row["loop"])
        assert rows[0]["next_step"] == Ask.NOTHING_NEWER != rows[1]["next_step"]
    health = json.loads(loop_verdicts.loop_health_json(backend, "FIC0"))
    assert (health["of_old_record"], rely(health)) == (True, "from an old record")
    assert not json.loads(loop_verdicts.loop_health_json(backend, "FIC1"))["of_old_record"]
    assert old_of(loop_verdicts.verdict_history(backend, "FIC0").rows) == {"FIC0"}
    notes.add_note(backend, "FIC0", "", work_order="WO-17")
    assert old_of(sent(backend)) == {"FIC0"}


def test_what_a_run_said_of_old_records_stays_whatever_comes_later(backend: Backend, warm_kernels: None) -> None:
    """Its rows changed as soon as a loop had newer samples, before anything was said of these."""
    recorded(backend, FIC0=3, FIC1=0.1)
    first = judge(backend)
    version, with_newest = (reliability.in_parts(backend, of_loop=told).version for told in (False, True))
    recorded(backend, FIC0=0.05)
    assert reliability.in_parts(backend, of_loop=True).version != with_newest
    assert old_of(sent(backend)) == {"FIC0"}, "no verdict is of the new samples"
    assert reliability.in_parts(backend).version == version
    second = judge(backend)
    assert old_of(sent(backend)) == set()
    of_runs = [table_page(backend, filters=RowFilter(audit_id=run)).rows for run in (first, second)]
    assert [old_of(rows) for rows in of_runs] == [{"FIC0"}, set()]


def test_of_a_collection_of_records_of_the_past_none_is_told_to_be_old(backend: Backend, warm_kernels: None) -> None:
    recorded(backend, FIC0=69, FIC1=60)
    judge(backend)
    assert not old_of(sent(backend))


def test_samples_ahead_of_the_clock_make_no_record_old(backend: Backend, warm_kernels: None) -> None:
    recorded(backend, FIC0=0.1, FIC1=-4000)
    judge(backend)
    assert not old_of(sent(backend))


def test_a_run_that_a_newer_one_has_followed_tells_what_was_known_by_its_end(plant: Backend) -> None:
    """Its rows told the repairs, shelvings and newest samples of now."""
    of_then = _of_run(plant)
    before = {row["loop"]: row["recorded_to"] for row in reliability.table(plant, 10).rows}
    long_ago = datetime.now(UTC) - timedelta(days=3)
    with plant.database.write() as connection:
        connection.execute(update(tables.audits).values(created_at=long_ago, ended_at=long_ago))
        connection.execute(update(tables.loops).values(newest_ns=tables.loops.c.newest_ns + 60 * 10**9))
    write(plant)
    asked = RowFilter(audit_id=1)
    assert _of_run(plant) != of_then, "nothing newer has been said of the loops: what is written now is of it"
    judge(plant)
    version = reliability.in_parts(plant, filters=asked, of_loop=True).version
    assert _of_run(plant) == of_then
    rows = reliability.table(plant, 10, filters=asked).rows
    assert {row["loop"]: row["recorded_to"] for row in rows} == before
    assert [row["shelved"] for row in rows] == [None] * len(TAGS)
    assert {row["next_step"] for row in rows} == {row["next_step"] for row in of_then}
    page = _in_parts(plant, filters=asked, of_loop=True)
    assert [(row["loop"], row["recorded_to"], row["repaired_at"]) for row in page] == [
        (tag, before[tag], None) for tag in TAGS
    ]
    newest = {row["loop"]: row for row in reliability.table(plant, 10, filters=RowFilter(audit_id=2)).rows}
    assert (newest["FIC1"]["work_order"], newest["FIC2"]["of_before_repair"]) == ("WO-17", True)
    assert newest["FIC3"]["shelved"].startswith("shelved until")
    assert reliability.in_parts(plant, filters=asked, of_loop=True).version == version


def test_a_run_is_sorted_by_the_newest_samples_that_it_shows(plant: Backend) -> None:
    with plant.database.write() as connection:
        for at, tag in enumerate(TAGS):
            mine = tables.loops.c.tag == tag
            connection.execute(update(tables.loops).where(mine).values(newest_ns=tables.loops.c.newest_ns + at))
            theirs = tables.verdicts.c.loop_id.in_(select(tables.loops.c.id).where(mine))
            earlier = {"input_end_ns": tables.verdicts.c.input_end_ns - at * 60 * 10**9}
            connection.execute(update(tables.verdicts).where(theirs).values(**earlier))
    page = reliability.table(plant, 2, sort="recorded_to", filters=RowFilter(audit_id=1))
    rest = reliability.table(plant, 2, page.next_cursor, sort="recorded_to", filters=RowFilter(audit_id=1))
    assert [row["loop"] for row in (*page.rows, *rest.rows)] == list(TAGS[::-1])
    told = reliability.in_parts(plant, sort="-recorded_to", filters=RowFilter(audit_id=1), of_loop=True)
    assert [row["loop"] for part in told.parts() for row in part.rows] == list(TAGS)


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
    table_page(backend, limit, sort="-loop")
    of_page = len(asked)
    reliability.in_parts(backend, limit, sort="-loop").as_json()
    return of_page, len(asked) - of_page


def _in_parts(backend: Backend, **asked: Any) -> list[dict[str, Any]]:
    return [row for part in reliability.in_parts(backend, **asked).parts() for row in part.rows]


def test_rows_of_a_csv_are_read_as_they_were_written_and_say_the_same(
    plant: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    from_columns: list[tuple[int, int]] = []
    of_keys = reliability.verdicts.of_keys

    def counted(connection, keys):
        from_columns.extend(keys)
        return of_keys(connection, keys)

    monkeypatch.setattr(reliability.verdicts, "of_keys", counted)
    for _ in range(2):  # as the verdicts left them, and with what is written of three of the loops
        read = _in_parts(plant)
        assert from_columns == []
        made = table_page(plant).rows
        assert read == made
        assert [[repr(row[name]) for name in TableRow.model_fields] for row in made] == [
            [repr(row[name]) for name in TableRow.model_fields] for row in read
        ]
        from_columns.clear()
        write(plant)


def test_a_page_keeps_its_verdicts_while_newer_ones_come(plant: Backend) -> None:
    write(plant)
    page, as_json = reliability.in_parts(plant), reliability.in_parts(plant).as_json
    before = _in_parts(plant)
    judge(plant)
    assert {row["audit_id"] for row in _in_parts(plant)} == {"2"}
    (kept,) = page.parts()
    for rows in (kept.rows, json.loads(as_json())["rows"]):
        assert [(row["loop"], row["audit_id"], row["verdict"]) for row in rows] == [
            (row["loop"], "1", row["verdict"]) for row in before
        ]
    assert {row["audit_id"] for row in sent(plant)} == {"2"}, (
        "what a page of before was told is not kept for newer ones"
    )


@pytest.mark.parametrize("dropped", [TAGS[:1], TAGS[1:2], TAGS[-1:], TAGS])
def test_rows_dropped_since_the_page_was_looked_up_are_left_out_of_its_json(
    plant: Backend, monkeypatch: pytest.MonkeyPatch, dropped: tuple[str, ...]
) -> None:
    """Whole parts, too: at the beginning, in the middle and at the end."""
    monkeypatch.setattr(reliability, "PART_ROWS", 1)
    page = reliability.in_parts(plant)
    with plant.database.write() as connection:
        ids = select(tables.loops.c.id).where(tables.loops.c.tag.in_(dropped)).scalar_subquery()
        for table in (tables.newest_rows, tables.verdicts):
            connection.execute(delete(table).where(table.c.loop_id.in_(ids)))
    left = [tag for tag in TAGS if tag not in dropped]
    for told in (page.as_json(), b"".join(page.json_parts()), b"".join(page.json_parts(("loop", "verdict")))):
        answer = json.loads(told)
        assert ([row["loop"] for row in answer["rows"]], answer["next_cursor"]) == (left, None)


def test_rows_of_another_form_are_made_of_their_columns(plant: Backend) -> None:
    write(plant)
    read = _in_parts(plant)
    with plant.database.write() as connection:
        connection.execute(update(tables.newest_rows).values(form="older"))
    plant.row_texts._kept.clear()
    assert _in_parts(plant) == read
