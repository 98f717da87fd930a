"""A renamed tag is one loop: the one before is retired, and what was known and written of it goes along."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import delete, func, select, update

from app.errors import FieldError
from app.services import loops
from app.services.auditing.audits import start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.backend import Backend
from app.services.digests.making import digest_of
from app.services.plant import changes, loop_verdicts, reliability
from app.services.plant.listing import listing
from app.services.plant.nights import nights
from app.services.plant.work_list import work_list
from app.services.stating import notes, properties
from app.services.stating.continuing import likeness, maybe_before
from app.services.stating.loop_list import read, take, written
from app.services.stating.shelving import shelf
from app.storage.continuing import LONGEST_CHAIN, before_first_verdict, counts_in
from app.storage.tables import audits, newest_rows, verdicts
from app.storage.tables import loops as stored
from tests.services.conftest import START_NS
from tests.services.kept_rows import made_once
from tests.services.spoiled import loop_id_of

AddLoops = Callable[..., dict[str, int]]
KNOWN = {"unit": "U1", "type": "flow", "importance": 3.0, "op_low": 0.0, "op_high": 100.0}
LATER = datetime.now(UTC) + timedelta(days=9)


@pytest.fixture
def renamed(backend: Backend, add_loops: AddLoops) -> Backend:
    """FIC101 was audited, has settings, a work order and is shelved; FIC-101A is new."""

    def make() -> None:
        add_loops("FIC101", "FIC102", n=150)
        properties.patch_loop(backend, "FIC101", KNOWN)
        notes.add_note(backend, "FIC101", "", work_order="WO-9")
        notes.add_note(backend, "FIC101", "in the shutdown", shelved_until=LATER)
        run = start_audit(backend)
        audit_chunk(backend, int(run.id), "test")
        with backend.database.write() as connection:
            past = datetime(2026, 3, 1, 2, tzinfo=UTC)
            connection.execute(update(verdicts).values(audited_at=past))
            connection.execute(update(audits).values(created_at=past))
            connection.execute(update(stored).values(newest_ns=START_NS - 1, created_at=past))
        add_loops("FIC-101A", n=150)
        properties.patch_loop(backend, "FIC-101A", {"op_low": 10.0, "op_high": 90.0})
        run = start_audit(backend)
        audit_chunk(backend, int(run.id), "test")

    made_once(backend, "renamed", make)
    return backend


def test_it_takes_what_nobody_said_of_it_and_the_other_is_retired(renamed: Backend) -> None:
    assert maybe_before(renamed, "FIC-101A") == "FIC101"
    it = properties.patch_loop(renamed, "FIC-101A", {"continues": "FIC101"})
    assert (it.unit, it.type, it.importance, it.continues) == ("U1", "flow", 3.0, "FIC101")
    assert (it.op_low, it.op_high) == (10.0, 90.0), "what was said of it stays"
    assert loops.get_loop(renamed, "FIC101").retired
    assert maybe_before(renamed, "FIC-101A") is None
    assert "FIC101" not in [row["loop"] for row in reliability.table(renamed, 10).rows]


def test_notes_orders_and_shelving_go_along_and_come_back(renamed: Backend) -> None:
    properties.patch_loop(renamed, "FIC-101A", {"continues": "FIC101"})
    told = notes.list_notes(renamed, "FIC-101A")
    assert [(note.work_order, note.written_of) for note in told] == [("", "FIC101"), ("WO-9", "FIC101")]
    (row,) = [row for row in reliability.table(renamed, 10).rows if row["loop"] == "FIC-101A"]
    assert (row["work_order"], row["shelved_until"] is None) == ("WO-9", False)
    assert shelf(renamed).of("FIC-101A") is not None
    notes.add_note(renamed, "FIC-101A", "seen")
    properties.patch_loop(renamed, "FIC-101A", {"continues": None})
    assert [note.text for note in notes.list_notes(renamed, "FIC-101A")] == ["seen"]
    assert [note.written_of for note in notes.list_notes(renamed, "FIC101")] == [None, None]
    assert not loops.get_loop(renamed, "FIC101").retired


def test_its_history_is_that_of_both(renamed: Backend) -> None:
    assert len(nights(renamed, ["FIC-101A"])["FIC-101A"]) == 1
    properties.patch_loop(renamed, "FIC-101A", {"continues": "FIC101"})
    assert nights(renamed, ["FIC-101A"])["FIC-101A"][0].date == "2026-03-01"
    told = [row["loop"] for row in loop_verdicts.chained_history(renamed, "FIC-101A", 10)]
    assert told == ["FIC-101A", "FIC101", "FIC101"]
    assert loop_verdicts.chained_history(renamed, "FIC-101A", 2)[-1]["loop"] == "FIC101"


@pytest.mark.parametrize(("said", "listed"), [("stiction", []), ("no_stiction", ["FIC-101A"])])
def test_what_was_said_under_the_tag_before_is_no_news(renamed: Backend, said: str, listed: list[str]) -> None:
    """It was listed as not audited before, newly said to stick, and as new among what to do."""
    ids = {tag: loop_id_of(renamed, tag) for tag in ("FIC101", "FIC-101A")}
    with renamed.database.write() as connection:
        run = connection.scalar(select(func.max(audits.c.id)))
        for tag, verdict in (("FIC101", said), ("FIC-101A", "stiction")):
            connection.execute(update(verdicts).where(verdicts.c.loop_id == ids[tag]).values(verdict=verdict))
            connection.execute(update(newest_rows).where(newest_rows.c.loop_id == ids[tag]).values(verdict=verdict))
    properties.patch_loop(renamed, "FIC-101A", {"continues": "FIC101"})
    assert [one.loop for one in changes.changes(renamed).rows] == listed
    assert [one.loop for one in digest_of(renamed, str(run)).changes] == listed


def test_it_is_said_in_the_loop_list(renamed: Backend) -> None:
    done = take(renamed, read(b"tag,continues\nFIC-101A,FIC101\nFIC102,NOWHERE\n"))
    assert (done.changed, [(one.loop, one.code) for one in done.refused]) == (1, [("FIC102", "bad_continues")])
    assert loops.get_loop(renamed, "FIC101").retired
    whole, _ = written(renamed)
    assert "FIC101" in next(line for line in whole.splitlines() if line.startswith("FIC-101A"))
    assert loops.get_loop(renamed, "FIC-101A").unit == "U1"


def test_the_letters_of_tags_may_be_great_or_small(renamed: Backend) -> None:
    assert properties.patch_loop(renamed, "fic-101a", {"continues": " fic101 "}).continues == "FIC101"
    assert loops.get_loop(renamed, "FIC101").retired
    properties.patch_loop(renamed, "FIC-101A", {"continues": None})
    done = take(renamed, read(b"tag,continues,unit\nfic-101a,fic101,\nFic102,,U7\nFIC102,,U8\n"))
    assert (done.changed, [(one.loop, one.code) for one in done.refused]) == (2, [("FIC102", "named_twice")])
    assert loops.get_loop(renamed, "FIC-101A").continues == "FIC101"
    assert loops.get_loop(renamed, "FIC102").unit == "U7"
    with pytest.raises(FieldError):
        properties.patch_loop(renamed, "FIC-101A", {"continues": "fic-101A"})


@pytest.mark.parametrize("earlier", ["FIC-101A", "NOWHERE", "half \ud83d"])
def test_a_loop_that_there_is_not_is_not_continued(renamed: Backend, earlier: str) -> None:
    with pytest.raises(FieldError) as refused:
        properties.patch_loop(renamed, "FIC-101A", {"continues": earlier})
    assert (refused.value.code, refused.value.field) == ("bad_continues", "continues")


def test_neither_a_circle_nor_two_that_continue_one(renamed: Backend) -> None:
    properties.patch_loop(renamed, "FIC-101A", {"continues": "FIC101"})
    for tag, earlier in (("FIC101", "FIC-101A"), ("FIC102", "FIC101")):
        with pytest.raises(FieldError):
            properties.patch_loop(renamed, tag, {"continues": earlier})
    properties.patch_loop(renamed, "FIC102", {"continues": "FIC-101A"})
    assert [note.written_of for note in notes.list_notes(renamed, "FIC102")] == ["FIC101", "FIC101"]
    assert len(nights(renamed, ["FIC102"])["FIC102"]) == 2


def test_what_goes_on_under_another_tag_is_not_taken_back_by_an_older_list(renamed: Backend) -> None:
    before = written(renamed)[0].encode()
    properties.patch_loop(renamed, "FIC-101A", {"continues": "FIC101"})
    done = take(renamed, read(before))
    assert [(one.loop, one.code) for one in done.refused] == [("FIC101", "bad_continues")]
    assert loops.get_loop(renamed, "FIC101").retired


def test_like_tags_are_those_of_one_number() -> None:
    assert likeness("FIC101", "FIC-101A") > 0.75
    assert likeness("FIC101", "FIC102") == 0.0
    assert likeness("U1_FIC101", "UNIT1.FIC101") > 0.75
    assert likeness("TIC101", "LIC101") < 0.9


AGAIN = "FIC-101-A2"


@pytest.fixture
def renamed_twice(renamed: Backend, add_loops: AddLoops) -> Backend:
    """FIC101 became FIC-101A, and some nights later FIC-101-A2, under which it was audited once."""
    properties.patch_loop(renamed, "FIC-101A", {"continues": "FIC101"})
    with renamed.database.write() as connection:
        past = datetime(2026, 3, 5, 2, tzinfo=UTC)
        run = connection.scalar(select(func.max(audits.c.id)))
        connection.execute(update(verdicts).where(verdicts.c.audit_id == run).values(audited_at=past))
        connection.execute(update(audits).where(audits.c.id == run).values(created_at=past))
    add_loops(AGAIN, n=150)
    audit_chunk(renamed, int(start_audit(renamed).id), "test")
    properties.patch_loop(renamed, AGAIN, {"continues": "FIC-101A"})
    return renamed


def test_a_loop_renamed_twice_has_the_history_of_all_three(renamed_twice: Backend) -> None:
    dates = [night.date for night in nights(renamed_twice, [AGAIN])[AGAIN]]
    assert dates[:2] == ["2026-03-01", "2026-03-05"]
    assert len(dates) == 3
    told = [row["loop"] for row in loop_verdicts.chained_history(renamed_twice, AGAIN, 10)]
    assert list(dict.fromkeys(told)) == [AGAIN, "FIC-101A", "FIC101"]
    assert (loops.get_loop(renamed_twice, AGAIN).unit, loops.get_loop(renamed_twice, AGAIN).op_low) == ("U1", 10.0)
    assert [note.work_order for note in notes.list_notes(renamed_twice, AGAIN) if note.work_order] == ["WO-9"]


def said(backend: Backend, by_tag: dict[str, str]) -> None:
    with backend.database.write() as connection:
        for tag, verdict in by_tag.items():
            mine = loop_id_of(backend, tag)
            connection.execute(update(verdicts).where(verdicts.c.loop_id == mine).values(verdict=verdict))
            connection.execute(update(newest_rows).where(newest_rows.c.loop_id == mine).values(verdict=verdict))


@pytest.mark.parametrize(
    ("first", "second", "listed"),
    [
        ("stiction", "stiction", []),
        ("no_stiction", "stiction", []),
        ("stiction", "no_stiction", [AGAIN]),
        ("stiction", None, []),
        ("no_stiction", None, [AGAIN]),
    ],
)
def test_news_of_a_loop_renamed_twice_is_against_what_was_said_last(
    renamed_twice: Backend, first: str, second: str | None, listed: list[str]
) -> None:
    """None: under the tag between it was never audited."""
    said(renamed_twice, {"FIC101": first, "FIC-101A": second or "stiction", AGAIN: "stiction"})
    if second is None:
        between = loop_id_of(renamed_twice, "FIC-101A")
        with renamed_twice.database.write() as connection:
            connection.execute(delete(newest_rows).where(newest_rows.c.loop_id == between))
            connection.execute(delete(verdicts).where(verdicts.c.loop_id == between))
            connection.execute(update(stored).where(stored.c.id == between).values(newest_audit_id=None))
    with renamed_twice.database.read() as connection:
        run = connection.scalar(select(func.max(audits.c.id)))
    assert [one.loop for one in changes.changes(renamed_twice).rows] == listed
    assert [one.loop for one in digest_of(renamed_twice, str(run)).changes] == listed


def test_nights_of_the_plant_count_a_loop_renamed_twice_once_each(renamed_twice: Backend) -> None:
    """The night of the first tag had one loop fewer after the second renaming."""
    with renamed_twice.database.read() as connection:
        runs = connection.scalars(select(audits.c.id).order_by(audits.c.id)).all()
        counted = []
        for run in runs:
            said_of = select(stored.c.tag).join(verdicts).where(verdicts.c.audit_id == run, counts_in(run))
            counted.append(set(connection.scalars(said_of)))
    assert counted == [{"FIC101", "FIC102"}, {"FIC-101A", "FIC102"}, {AGAIN, "FIC102"}]


def chained(backend: Backend, tags: list[str], first: str | None) -> None:
    """Loops of which each continues the one before, and the first one `first`; only the last is in service."""
    now = datetime.now(UTC)
    of_each = zip(tags, [first, *tags], strict=False)
    rows = [{"tag": tag, "continues": one, "created_at": now, "retired": tag != tags[-1]} for tag, one in of_each]
    with backend.database.write() as connection:
        connection.execute(stored.insert(), rows)


def pairs_of(backend: Backend) -> int:
    with backend.database.read() as connection:
        return connection.scalar(select(func.count()).select_from(before_first_verdict())) or 0


def test_a_ring_of_loops_that_continue_each_other_ends(backend: Backend) -> None:
    """The API makes none; a hand in the database may."""
    chained(backend, ["A", "B"], "B")
    assert pairs_of(backend) <= 2 * LONGEST_CHAIN
    with backend.database.read() as connection:
        assert set(connection.scalars(select(stored.c.tag).where(counts_in(1)))) == {"A", "B"}


def test_of_a_long_chain_no_more_is_followed_than_is_told_of_one(backend: Backend) -> None:
    chained(backend, [f"L{number}" for number in range(200)], None)
    assert pairs_of(backend) <= 200 * LONGEST_CHAIN
    with backend.database.read() as connection:
        counted = connection.scalar(select(func.count()).select_from(stored).where(counts_in(1)))
    assert counted == 1 + LONGEST_CHAIN


@pytest.mark.parametrize(
    ("first", "since"),
    [("stiction", "said since its first night, 2026-03-01"), ("no_stiction", "first said on 2026-03-05")],
)
def test_since_when_a_loop_renamed_twice_sticks_is_told_of_all_three(
    renamed_twice: Backend, first: str, since: str
) -> None:
    said(renamed_twice, {"FIC101": first, "FIC-101A": "stiction", AGAIN: "stiction"})
    notes.end_shelving(
        renamed_twice, AGAIN, next(one.id for one in notes.list_notes(renamed_twice, AGAIN) if one.shelved_until)
    )
    work = work_list(renamed_twice, listing(renamed_twice))
    assert [one.since for one in work if one.loop == AGAIN] == [since]
