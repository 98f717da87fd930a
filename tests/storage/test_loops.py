"""What a mapping tells of a loop gives way to what somebody has set."""

import threading
import time

import numpy as np
import pytest
from sqlalchemy import insert, select

from app.storage import Database, loops, series
from app.storage.samples import Samples
from app.storage.series import Stretch
from app.storage.tables import loops as loops_table
from app.storage.types import now


def test_what_is_set_while_a_file_is_stored_stands(database: Database) -> None:
    """The file's transaction begins while a change is not committed yet, and ends after it."""
    with database.write() as connection:
        (loop_id,) = loops.ensure(connection, ["FIC1"]).values()
    begun = threading.Event()

    def store() -> None:
        begun.set()
        with database.write() as connection:
            loops.fill_in(connection, {loop_id: {"unit": "U9", "op_low": 0.0, "op_high": 100.0}})

    storing = threading.Thread(target=store)
    with database.write() as connection:
        loops.change(connection, loop_id, {"unit": "U1", "op_low": 20.0})
        storing.start()
        begun.wait()
        time.sleep(0.3)
    storing.join()
    with database.read() as connection:
        row = loops.by_ids(connection, [loop_id])[loop_id]
    assert (row.unit, row.op_low, row.op_high) == ("U1", 20.0, None)


@pytest.mark.parametrize(
    ("held", "told", "stored"),
    [
        ((None, None), {"op_low": 0.0, "op_high": 40.0}, (0.0, 40.0)),
        ((50.0, None), {"op_low": 0.0, "op_high": 40.0}, (50.0, None)),
        ((None, 30.0), {"op_low": 40.0, "op_high": 80.0}, (None, 30.0)),
        ((0.0, 100.0), {"op_low": 4.0, "op_high": 20.0}, (0.0, 100.0)),
        ((None, None), {"op_low": 4.0}, (4.0, None)),
        ((None, 100.0), {"op_low": 0.0, "op_high": 100.0}, (0.0, 100.0)),
        ((0.0, None), {"op_low": 0.0, "op_high": 100.0}, (0.0, 100.0)),
        ((0.0, None), {"op_high": 100.0}, (0.0, None)),
    ],
)
def test_a_span_is_filled_in_whole_or_not_at_all(database: Database, held: tuple, told: dict, stored: tuple) -> None:
    with database.write() as connection:
        (loop_id,) = loops.ensure(connection, ["FIC1"]).values()
        loops.change(connection, loop_id, {"op_low": held[0], "op_high": held[1]})
        loops.fill_in(connection, {loop_id: {"type": "flow", **told}})
        row = loops.by_ids(connection, [loop_id])[loop_id]
    assert ((row.op_low, row.op_high), row.type) == (stored, "flow")


def test_one_loop_is_made_where_two_files_spell_it_in_two_ways_at_once(database: Database) -> None:
    """The second file's transaction begins before the first one's is committed."""
    begun = threading.Event()
    second: dict[str, int] = {}

    def store() -> None:
        begun.set()
        with database.write() as connection:
            second.update(loops.ensure(connection, ["tt8"]))

    storing = threading.Thread(target=store)
    with database.write() as connection:
        first = loops.ensure(connection, ["TT8"])
        storing.start()
        begun.wait()
        time.sleep(0.3)
    storing.join()
    assert second == {"tt8": first["TT8"]}


def test_two_new_spellings_of_a_tag_in_one_call_make_one_loop(database: Database) -> None:
    with database.write() as connection:
        made = loops.ensure(connection, ["fic-1.pv", "TIC2", "FIC-1.PV", "Fic-1.pv"])
        assert len({made[tag] for tag in ("fic-1.pv", "FIC-1.PV", "Fic-1.pv")}) == 1
        assert made["TIC2"] != made["FIC-1.PV"]
        assert connection.scalars(select(loops_table.c.tag).order_by(loops_table.c.tag)).all() == ["FIC-1.PV", "TIC2"]
        assert loops.ensure(connection, ["FIC-1.PV", "fic-1.pv"]) == {
            tag: made[tag] for tag in ("FIC-1.PV", "fic-1.pv")
        }


@pytest.mark.parametrize(
    ("stored", "sent"),
    [("fic-1", "FIC-1"), ("STRASSE-1", "straße-1"), ("Straße-1", "STRASSE-1"), ("kic1", "\u212aIC1"), ("ΣΑΣ", "σας")],
)
def test_a_stored_tag_is_known_in_other_letters(database: Database, stored: str, sent: str) -> None:
    with database.write() as connection:
        made = loops.ensure(connection, [stored, "TIC2"])
        assert loops.ensure(connection, [sent]) == {sent: made[stored]}


def test_for_new_tags_those_of_the_plant_are_not_all_read(database: Database) -> None:
    """A plant comes in many batches: to read all for each costs the square of their number."""
    with database.write() as connection:
        loops.ensure(connection, [f"FIC{number}" for number in range(300)] + ["Öl1"])
        query, asked = loops.in_other_letters(connection, ["fic300", "fic7"])
        assert sorted(row.tag for row in connection.execute(query, asked)) == ["FIC7", "Öl1"]


def test_what_two_new_spellings_bring_is_of_one_loop(database: Database) -> None:
    tags = ["FIC-1.PV", "fic-1.pv"]
    with database.write() as connection:
        ids = loops.ensure(connection, tags)
        parts = [Samples(np.arange(10) + 10 * k, {"pv": np.arange(10.0) + k}) for k in range(2)]
        added = series.add(connection, [Stretch(ids[tag], part) for tag, part in zip(tags, parts, strict=True)], None)
        row = loops.by_tag(connection, "FIC-1.PV")
    assert row is not None
    assert (added.samples, row.newest_ns) == (20, 19)
    with database.read() as connection:
        found = series.between(connection, row.id, 0, 19)
    assert found is not None
    assert len(found) == 20


def test_of_two_spellings_that_are_there_it_is_the_first(database: Database) -> None:
    with database.write() as connection:
        for tag in ("FIC1", "fic1"):
            connection.execute(insert(loops_table).values(tag=tag, created_at=now()))
        there = loops.ids_of(connection, ["FIC1", "fic1"])
        assert loops.ensure(connection, ["Fic1"]) == {"Fic1": there["FIC1"]}
        assert loops.ensure(connection, ["fic1"]) == {"fic1": there["fic1"]}
