"""Which verdict is a loop's newest, and which loops come first: the same in every question that asks it."""

import json
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import pytest
from sqlalchemy import insert, select, update

from app.storage import Database, changes, judged, loops, plant, shelvings, verdict_writing, verdicts
from app.storage.asked_rows import Order, RowFilter
from app.storage.details import pack_detail
from app.storage.tables import audits as audits_table
from app.storage.tables import loops as loops_table
from app.storage.tables import newest_rows
from app.storage.tables import verdicts as verdicts_table
from app.storage.types import now
from app.storage.verdict_writing import NewVerdict

RUN = {
    "trigger": "request",
    "plant": "p",
    "state": "done",
    "config_json": "{}",
    "config_fingerprint": "",
    "window_h": 24.0,
    "window_samples": 1000,
    "total": 7,
}
OLD_NS, NEW_NS = 100, 200
LOOPS = {  # unit, importance, newest sample; verdict and health in the first run
    "A1": ("U1", 1.0, NEW_NS, "stiction", 40.0),
    "A2": ("U1", 2.0, NEW_NS, "inconclusive", 80.0),
    "A3": ("U1", 1.0, OLD_NS, "stiction", None),
    "A4": ("U1", 1.0, NEW_NS, "no_stiction", 10.0),
    "B1": ("U2", 1.0, OLD_NS, "stiction", 30.0),
    "B2": ("U2", 3.0, NEW_NS, "stiction", 90.0),
    "R1": ("U1", 9.0, NEW_NS, "stiction", 0.0),
}


def said(loop_id: int, audit_id: int, verdict: str, health: float | None, end_ns: int) -> NewVerdict:
    columns: dict[str, Any] = {
        **{"audited_at": now(), "samples": 1, "verdict": verdict, "reliability": "reliable", "health": health},
        **{"engine_version": "", "elapsed_s": 0.0, "input_fingerprint": "", "config_fingerprint": ""},
        **{"reasons": "", "reasons_text": "why", "likely_cause": None, "table2_reading": None},
        **{"stiction_probability": None, "window_end": None, "input_end_ns": end_ns},
    }
    swing = json.dumps({"audit": audit_id})
    return NewVerdict(loop_id, audit_id, columns, pack_detail({}), "{}", "{}", "f", swing)


@pytest.fixture
def runs(database: Database) -> tuple[int, int]:
    """Two runs: the first over all loops, the second over A1 alone, which is healthy by then; R1 is retired since."""
    with database.write() as connection:
        ids = loops.ensure(connection, LOOPS)
        first, second = (
            connection.scalar(insert(audits_table).values(**RUN, created_at=now()).returning(audits_table.c.id))
            for _ in range(2)
        )
        for tag, (unit, importance, newest_ns, *_) in LOOPS.items():
            told = {"unit": unit, "importance": importance, "newest_ns": newest_ns, "retired": tag == "R1"}
            connection.execute(update(loops_table).where(loops_table.c.id == ids[tag]).values(**told))
        verdict_writing.add(connection, [said(ids[t], first, v, h, end) for t, (_, _, end, v, h) in LOOPS.items()])
        verdict_writing.add(connection, [said(ids["A1"], second, "no_stiction", 95.0, NEW_NS)])
    assert first is not None
    assert second is not None
    return first, second


THE_WORST_FIRST = Order("priority", descending=True)


def tags(rows: Sequence[Any]) -> list[str]:
    return [row.tag for row in rows]


def test_the_worst_come_first_and_those_of_unknown_health_last(database: Database, runs: tuple[int, int]) -> None:
    wanted, of_run = RowFilter(), RowFilter(audit_id=runs[0])
    with database.read() as connection:
        newest = verdicts.table(connection, 10, THE_WORST_FIRST, wanted, None)
        first = verdicts.table(connection, 10, THE_WORST_FIRST, of_run, None)
        sent = verdicts.sent_rows(connection, 10, THE_WORST_FIRST, wanted, None)
    assert [row["tag"] for row in newest] == tags(sent) == ["A4", "B1", "A2", "B2", "A1", "A3"]
    assert [row["tag"] for row in first] == ["A4", "B1", "A1", "A2", "B2", "A3"]
    assert [row["priority"] for row in newest] == [90.0, 70.0, 40.0, 30.0, 5.0, None]


def test_the_heads_of_the_units_are_of_the_newest_verdicts_or_of_one_run(
    database: Database, runs: tuple[int, int]
) -> None:
    of_first = partial(plant.worst_of_units, complaints=True, audit_id=runs[0])
    with database.read() as connection:
        whole = plant.worst_of_units(connection, 2)
        assert [tuple(row) for row in whole] == [
            ("A4", "U1", 1.0, "no_stiction", 10.0),
            ("A2", "U1", 2.0, "inconclusive", 80.0),
            ("B1", "U2", 1.0, "stiction", 30.0),
            ("B2", "U2", 3.0, "stiction", 90.0),
        ]
        assert tags(plant.worst_of_units(connection, 9, complaints=True)) == ["A2", "A3", "B1", "B2"]
        assert tags(plant.worst_of_units(connection, 9, complaints=True, since_ns=NEW_NS)) == ["A2", "B2"]
        assert tags(plant.worst_of_unit(connection, "U1", 3)) == ["A4", "A2", "A1"]
        assert tags(of_first(connection, 2)) == ["A1", "A2", "B1", "B2"]
        assert tags(of_first(connection, 9, since_ns=NEW_NS)) == ["A1", "A2", "B2"]
        assert tags(plant.worst_of_units(connection, 9, complaints=True, audit_id=runs[1])) == []


def test_the_worst_of_old_records_are_of_all_units(database: Database, runs: tuple[int, int]) -> None:
    with database.read() as connection:
        assert tags(plant.worst_of_old(connection, 9, NEW_NS)) == ["B1", "A3"]
        assert tags(plant.worst_of_old(connection, 1, NEW_NS)) == ["B1"]
        assert tags(plant.worst_of_old(connection, 9, NEW_NS, audit_id=runs[0])) == ["B1", "A3"]


def test_loops_left_out_make_room_for_the_next(database: Database, runs: tuple[int, int]) -> None:
    of_first = partial(plant.worst_of_units, complaints=True, audit_id=runs[0])
    with database.read() as connection:
        ids = [row.id for row in loops.page(connection, 10) if row.tag in ("A2", "B1")]
        assert tags(plant.worst_of_units(connection, 1, complaints=True, left_out=ids)) == ["A3", "B2"]
        assert tags(of_first(connection, 1, left_out=ids)) == ["A1", "B2"]
        assert tags(plant.worst_of_old(connection, 9, NEW_NS, ids)) == ["A3"]


def test_whatever_asks_for_the_newest_verdict_gets_that_of_the_second_run(
    database: Database, runs: tuple[int, int]
) -> None:
    with database.read() as connection:
        loop_id, row = verdicts.newest(connection, "A1") or (0, None)
        assert row is not None
        assert (row["audit_id"], row["verdict"], row["health"]) == (runs[1], "no_stiction", 95.0)
        assert verdicts.newest_of(connection, [loop_id])["A1"]["audit_id"] == runs[1]
        assert verdicts.newest_said(connection, loop_id).verdict == "no_stiction"
        assert shelvings.newest_said(connection, loop_id).verdict == "no_stiction"
        assert {row.tag: row.audit_id for row in verdicts.said(connection)} == {
            **dict.fromkeys(("A2", "A3", "A4", "B1", "B2"), runs[0]),
            "A1": runs[1],
        }
        swings = {row.tag: json.loads(row.swing_json)["audit"] for row in verdicts.swings(connection)}
        assert (swings["A1"], swings["A2"]) == runs[::-1]
        assert len(swings) == 6
        assert sorted(tags(judged.spans(connection, ["A1", "B1"]))) == ["A1", "B1"]


def test_a_run_that_is_late_does_not_take_the_place_of_a_newer_one(database: Database, runs: tuple[int, int]) -> None:
    """As the one over A1 would be, had it been the first that ended."""
    with database.write() as connection:
        loop_id = loops.by_tag(connection, "B1").id
        verdict_writing.add(connection, [said(loop_id, runs[1], "no_stiction", 95.0, NEW_NS)])
        verdict_writing.add(connection, [said(loop_id, runs[0], "stiction", 1.0, NEW_NS)])
        told = select(
            newest_rows.c.audit_id, newest_rows.c.verdict, newest_rows.c.health, loops_table.c.newest_audit_id
        )
        row = connection.execute(told.join(loops_table).where(loops_table.c.id == loop_id)).one()
    assert row == (runs[1], "no_stiction", 95.0, runs[1])


def test_a_loop_that_stands_twice_in_a_chunk_is_written_once(database: Database, runs: tuple[int, int]) -> None:
    """And takes none of the others with it."""
    with database.write() as connection:
        ids = [loops.by_tag(connection, tag).id for tag in ("B2", "A2", "B2")]
        verdict_writing.add(connection, [said(loop_id, runs[1], "inconclusive", 5.0, NEW_NS) for loop_id in ids])
        rows = {row.tag: (row.audit_id, row.verdict) for row in verdicts.said(connection)}
    assert rows["A2"] == rows["B2"] == (runs[1], "inconclusive")


def test_what_is_unknown_beside_long_texts_and_odd_signs_is_written_as_it_is(
    database: Database, runs: tuple[int, int]
) -> None:
    """A chunk goes to PostgreSQL as arrays, in which such signs and NULL have meanings of their own."""
    texts = {"R1": "NULL", "A2": '{"a\\\\",}', "A3": "", "A4": "ü" * 1_000_000, "B1": "'%(x)s\n", "B2": "null"}
    healths = dict(zip(texts, (None, 0.1 + 0.2, 5e-324, -0.0, 1e300, None), strict=True))
    with database.write() as connection:
        tag_of = {loops.by_tag(connection, tag).id: tag for tag in reversed(texts)}
        plain = [said(loop_id, runs[1], "stiction", healths[tag], NEW_NS) for loop_id, tag in tag_of.items()]
        verdict_writing.add(connection, [_with_text(one, texts[tag_of[one.loop_id]]) for one in plain])
        of_run = select(verdicts_table).where(verdicts_table.c.audit_id == runs[1])
        stored = {tag_of[row.loop_id]: row for row in connection.execute(of_run) if row.loop_id in tag_of}
        kept = {tag_of[row.loop_id]: row for row in connection.execute(select(newest_rows)) if row.loop_id in tag_of}
    for tag, text in texts.items():
        row = kept[tag]
        assert (row.row_json, row.swing_json, row.excerpts_json) == (text, text or None, None)
        assert (row.likely_cause, row.health, row.audit_id) == (None, healths[tag], runs[1])
        assert (stored[tag].reasons_text, stored[tag].health, stored[tag].input_end_ns) == (text, healths[tag], NEW_NS)


def _with_text(one: NewVerdict, text: str) -> NewVerdict:
    return replace(one, columns=one.columns | {"reasons_text": text}, row_json=text, swing_json=text or None)


def test_the_fields_of_a_changed_row_are_named_in_the_order_in_which_they_are_asked_for() -> None:
    told = changes.told_of_both(verdicts_table, verdicts_table.alias())
    assert tuple(column.key for column in told) == changes.ChangedRow._fields[5:]


def test_changes_lead_with_the_worst(database: Database, runs: tuple[int, int]) -> None:
    with database.read() as connection:
        assert tags(changes.since_run(connection, runs[0], 10)) == ["B1", "B2", "A3"]
        assert tags(changes.since_run(connection, runs[1], 10)) == ["A1"]
        assert tags(changes.of_run(connection, runs[0])) == ["B1", "A1", "B2", "A3"]
        assert tags(changes.of_run(connection, runs[1])) == ["A1"]
        (whole,) = changes.of_run_in_full(connection, runs[0], ["A1", "no loop"])
        (short,) = (row for row in changes.of_run(connection, runs[0]) if row.tag == "A1")
        unit, _, _, verdict, health = LOOPS["A1"]
        assert whole[:5] == ("A1", unit, None, verdict, health)
        assert whole.reasons_text == "why"
        texts = {name: changes.ChangedRow._field_defaults[name] for name in changes.TEXTS}
        assert whole._replace(**texts) == short


@pytest.mark.parametrize("at_once", [1, 2, 5, 6, 500])
def test_excerpts_are_those_of_the_newest_verdicts_however_many_come_at_once(
    database: Database, runs: tuple[int, int], monkeypatch: pytest.MonkeyPatch, at_once: int
) -> None:
    monkeypatch.setattr(verdicts, "EXCERPTS_AT_ONCE", at_once)
    with database.write() as connection:
        told = newest_rows.c.loop_id.in_(select(loops_table.c.id).where(loops_table.c.tag != "A4"))
        connection.execute(update(newest_rows).where(told).values(excerpts_json="kept"))
    found: list[verdicts.ExcerptsRow] = []
    with database.read() as connection:
        while rows := verdicts.excerpts(connection, found[-1].loop_id if found else 0):
            assert len(rows) <= at_once
            found += rows
    assert sorted((row.tag, row.excerpts_json) for row in found) == [
        (t, "kept") for t in ("A1", "A2", "A3", "B1", "B2")
    ]
