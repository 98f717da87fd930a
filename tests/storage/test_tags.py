"""What was said of tags for later files: of two who say it at once the later one is heard, and nobody else waits."""

import threading
from datetime import UTC, datetime

import pytest

from app.storage import Database, audits, tags
from app.storage.tags import KeptTag

AT = datetime(2026, 3, 1, tzinfo=UTC)


def said(tag: str, loop: str = "FIC1", signal: str = "PV", who: str = "one") -> KeptTag:
    return KeptTag("", tag.casefold(), tag, loop, signal, AT, who)


def test_of_two_corrections_at_once_the_later_one_holds(database: Database) -> None:
    later = [said("A", signal="OP", who="two"), said("B", who="two")]

    def say() -> None:
        with database.write() as connection:
            tags.keep(connection, later)

    other = threading.Thread(target=say)
    with database.write() as connection:
        tags.keep(connection, [said("A"), said("C", signal="OP")])
        other.start()
        other.join(0.3)
    other.join(20.0)
    with database.read() as connection:
        assert tags.kept(connection) == later


def test_a_run_can_begin_while_tags_are_placed(database: Database) -> None:
    if database.is_sqlite:
        pytest.skip("SQLite has one who writes, whatever it is")
    with database.write() as placing, database.write() as starting:
        tags.lock(placing)
        starting.exec_driver_sql("SET LOCAL lock_timeout = '1s'")
        assert audits.whole_going_on(starting) is None
