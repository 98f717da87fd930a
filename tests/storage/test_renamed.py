"""Tags of one loop: before and after a change of its name, and in other letters."""

import pytest
from sqlalchemy import insert

from app.storage import Database, continuing, loops
from app.storage.tables import loops as table
from app.storage.types import now


@pytest.mark.timeout(20)
def test_a_ring_of_tags_is_followed_so_far_and_no_farther(database: Database) -> None:
    """Two who say at once that one loop continues the other make one."""
    with database.write() as connection:
        ids = loops.ensure(connection, ["A", "B"])
        loops.change(connection, ids["A"], {"continues": "B"})
        loops.change(connection, ids["B"], {"continues": "A"})
        assert continuing.earlier_of(connection, ["A"]) == {"A": ["B", "A"] * (continuing.LONGEST_CHAIN // 2)}


def test_of_loops_that_stopped_those_are_told_that_go_on_nowhere(database: Database) -> None:
    with database.write() as connection:
        ids = loops.ensure(connection, ["GOES ON", "ITS NEXT", "STOPPED", "RETIRED", "LATER"])
        for tag, loop_id in ids.items():
            loops.change(connection, loop_id, {"newest_ns": 99 if tag in ("ITS NEXT", "LATER") else 10})
        loops.change(connection, ids["ITS NEXT"], {"continues": "GOES ON"})
        loops.change(connection, ids["RETIRED"], {"retired": True})
        assert continuing.stopped_between(connection, 10, 10, None) == ["STOPPED"]
        assert continuing.stopped_between(connection, 10, 98, "U1") == []


def test_a_tag_in_other_letters_is_that_of_the_only_loop_that_has_it(database: Database) -> None:
    with database.write() as connection:
        for tag in ("FIC1", "fic1", "TIC2"):  # an older version left both spellings
            connection.execute(insert(table).values(tag=tag, created_at=now()))
        found = loops.as_spelled(connection, ["fic1", "Fic1", "tic2", "PIC3"])
    assert found == {"fic1": "fic1", "tic2": "TIC2"}
