"""A shelved loop leads no list of what to look at first, until its time, a repair, or something worse; nothing else of
it changes."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from sqlalchemy import update

from app.errors import NotFoundError, RequestError
from app.services.auditing.audits import LoopFilter, start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.backend import Backend
from app.services.moments import UTC_CLOCK
from app.services.plant import changes, reliability, worst
from app.services.plant import overview as plant
from app.services.plant.listing import Listing, listing
from app.services.plant.loop_verdicts import loop_health
from app.services.plant.work_list import work_list
from app.services.plant.written import Written
from app.services.reports.documents import loop_report, plant_report
from app.services.stating import notes
from app.services.stating.properties import patch_loop
from app.services.stating.shelving import LONGEST, Shelf, shelf
from app.services.telling.next_steps import BY_CAUSE, Ask, next_step
from app.services.telling.wording import UNANSWERED
from app.storage.tables import loops, newest_rows, verdicts
from app.storage.tables import notes as notes_table
from tests.services.kept_rows import made_once

AddLoops = Callable[..., dict[str, int]]
DAY = timedelta(days=1)
UNSURE = {
    "verdict": "stiction",
    "reliability": "not_reliable",
    "likely_cause": "stiction",
    "health": 20.0,
    "reasons": "",
}
SURE = UNSURE | {"reliability": "reliable"}
DEAD = UNSURE | {"verdict": "inconclusive", "likely_cause": UNANSWERED}


def say(backend: Backend, tag: str, **values: object) -> None:
    """The loop's newest verdict as if it had been another one."""
    with backend.database.write() as connection:
        for table in (verdicts, newest_rows):
            of_loop = table.c.loop_id.in_(loops.select().with_only_columns(loops.c.id).where(loops.c.tag == tag))
            told = {name: value for name, value in values.items() if name in table.c}
            connection.execute(update(table).where(of_loop).values(**told))


def until(days: float = 30.0) -> datetime:
    return datetime.now(UTC) + days * DAY


def shelve(backend: Backend, tag: str, days: float = 30.0, by: str = "anna") -> str:
    return notes.add_note(backend, tag, "packing is ordered", "WO-17", None, by, until(days)).id


def wait(backend: Backend, note_id: str, past: timedelta) -> None:
    """As if the note had been written so much earlier, and its time had been so much earlier too."""
    with backend.database.write() as connection:
        mine = notes_table.c.id == int(note_id)
        found = connection.execute(notes_table.select().where(mine)).one()
        moved = {"written_at": found.written_at - past, "shelved_until": found.shelved_until - past}
        connection.execute(update(notes_table).where(mine).values(**moved))


def worst_loops(backend: Backend) -> list[str]:
    return [row["loop"] for row in worst.worst(backend, listing(backend))]


@pytest.fixture
def judged(backend: Backend, add_loops: AddLoops) -> Backend:
    """Three loops whose valves may stick; A is the worst of them."""

    def make() -> None:
        add_loops("A", "B", "C", n=600, unit="U1")
        audit_chunk(backend, int(start_audit(backend).id), "test")
        for number, tag in enumerate("ABC"):
            say(backend, tag, **UNSURE | {"health": 20.0 + number})

    made_once(backend, "three unsure", make)
    return backend


def test_a_shelved_loop_is_left_out_of_the_worst_and_of_nothing_else(judged: Backend) -> None:
    before = plant.overview(judged)
    shelve(judged, "A")
    assert worst_loops(judged) == ["B", "C"]
    assert plant.overview(judged) == before
    rows = {row["loop"]: row for row in reliability.table(judged, 10).rows}
    assert set(rows) == {"A", "B", "C"}
    (one,) = shelf(judged).listed
    assert (one.loop, one.by, one.work_order, one.text) == ("A", "anna", "WO-17", "packing is ordered")
    assert one.said == "valve sticks (look first)"
    assert rows["A"]["shelved_until"] == one.until
    assert rows["B"]["shelved_until"] is None
    told = judged.clock.short(one.until)
    assert rows["A"]["next_step"] == f"Wait: shelved until {told} (work order WO-17)."
    assert rows["B"]["next_step"] == next_step(rows["B"], UTC_CLOCK)
    assert rows["A"]["next_step"] in loop_report(judged, "A")
    assert start_audit(judged).total == 3


def test_the_report_of_the_plant_leaves_it_out_and_names_it(judged: Backend) -> None:
    shelve(judged, "A")
    head, _, rest = plant_report(judged).partition("1 shelved</summary>")
    assert '<td class="tag">A</td>' not in head.partition("Worst of each unit")[2]
    assert '<td class="tag">A</td>' in rest
    for tag in ("B", "C"):
        shelve(judged, tag)
    assert "No other valve sticks, as far as the records tell." in plant_report(judged)


def test_it_is_not_in_the_work_list_until_it_is_worse(judged: Backend) -> None:
    shelve(judged, "A")
    assert [one.loop for one in work_list(judged, listing(judged))] == ["B", "C"]
    assert '<td class="tag">A</td>' not in plant_report(judged).partition("1 shelved</summary>")[0]
    say(judged, "A", **SURE)
    first = work_list(judged, listing(judged))[0]
    assert (first.loop, first.step.text.startswith(Ask.STICKS)) == ("A", True)
    assert "(work order WO-17), but by now the valve sticks, and that can be relied on" in first.facts
    assert first.facts.count("WO-17") == 1
    assert first.shelved in plant_report(judged)
    notes.add_note(judged, "A", "ordered again", "WO-18")
    assert work_list(judged, listing(judged))[0].facts.endswith("; work order WO-18")
    patch_loop(judged, "A", {"owner": "crew A"})
    assert work_list(judged, listing(judged))[0].facts.endswith("; work order WO-18; looked after by crew A")


def test_the_work_of_a_run_goes_by_what_was_shelved_when_it_began(judged: Backend) -> None:
    shelve(judged, "A")
    (run,) = {int(row["audit_id"]) for row in reliability.table(judged, 10).rows}
    as_it_began = work_list(judged, Listing(Shelf([], ()), audit_id=run))
    assert [one.loop for one in as_it_began] == ["A", "B", "C"]
    assert not as_it_began[0].step.text.startswith("Wait")


def test_of_a_loop_that_a_run_left_out_its_shelf_tells_the_verdict_before(judged: Backend) -> None:
    say(judged, "A", **SURE)
    shelve(judged, "B")
    kept = shelve(judged, "A")
    with judged.database.write() as connection:
        connection.execute(update(notes_table).where(notes_table.c.id == int(kept)).values(shelved_as=""))
    first = int(reliability.table(judged, 10).rows[0]["audit_id"])
    run = start_audit(judged, LoopFilter(tags=("C",)))
    audit_chunk(judged, int(run.id), "test")
    assert shelf(judged, int(run.id)) == shelf(judged, first) == shelf(judged)
    assert [(one.loop, one.said, bool(one.worse)) for one in shelf(judged, int(run.id)).listed] == [
        ("A", "valve sticks (rely on it)", True),
        ("B", "valve sticks (look first)", False),
    ]
    assert [one.said for one in shelf(judged, first - 1).listed] == ["not audited", "not audited"]


def test_it_is_neither_looked_at_today_nor_among_old_records(judged: Backend) -> None:
    def listed() -> list[list[str]]:
        found = (
            worst.look_today(judged, listing(judged), changes.changes(judged)),
            worst.worst_of_old(judged, listing(judged, 1 << 62)),
        )
        return [sorted(row["loop"] for row in rows) for rows in found]

    for tag in "AB":
        say(judged, tag, **DEAD)
    assert listed() == [["A", "B"], ["A", "B", "C"]]
    shelve(judged, "A")
    assert listed() == [["B"], ["B", "C"]]
    assert shelf(judged).of("A").said == "cannot tell (look today)"


@pytest.mark.parametrize("seed", range(3))
def test_the_tags_of_the_worst_are_those_that_the_plant_s_page_lists(
    backend: Backend, add_loops: AddLoops, seed: int
) -> None:
    """In its order, without those that are to be looked at today, are shelved, or are of an old record."""
    ids = add_loops(*(f"FIC{number}" for number in range(3 * worst.WORST)), n=150)
    audit_chunk(backend, int(start_audit(backend).id), "test")
    dice = np.random.default_rng(seed)
    for tag in ids:
        said = DEAD if dice.random() < 0.2 else UNSURE
        say(backend, tag, **said | {"health": dice.choice([None, 0.0, 40.0, 80.0])})
        patch_loop(backend, tag, {"importance": float(dice.integers(1, 3))})
    for tag in dice.choice(list(ids), 4, replace=False):
        shelve(backend, str(tag))
    old = dice.choice(list(ids.values()), 4, replace=False).tolist()
    with backend.database.write() as connection:
        connection.execute(update(loops).where(loops.c.id.in_(old)).values(newest_ns=1000))
    for since_ns in (None, 1001):
        _, listed = worst.listed_first(backend, listing(backend, since_ns))
        assert len(listed) == worst.WORST
        assert worst.worst_tags(backend, listing(backend, since_ns)) == [row["loop"] for row in listed]


def test_to_wait_comes_before_what_to_do_until_two_answers_agree(judged: Backend) -> None:
    row = loop_health(judged, "A")

    def step() -> str:
        return Written({}, shelf(judged).by_tag(), frozenset("A"), {}, judged.clock).beside(row)["next_step"]

    assert step() == Ask.UNTIL_THEY_AGREE
    shelve(judged, "A")
    assert step().startswith("Wait: ")


def test_it_ends_by_itself(judged: Backend) -> None:
    note_id = shelve(judged, "A", 2)
    wait(judged, note_id, DAY)
    assert worst_loops(judged) == ["B", "C"]
    wait(judged, note_id, DAY)
    assert worst_loops(judged) == ["A", "B", "C"]
    assert reliability.table(judged, 10).rows[0]["shelved_until"] is None
    assert notes.list_notes(judged, "A")[0].shelved_until is not None


def test_the_newest_counts_though_it_ends_earlier(judged: Backend) -> None:
    shelve(judged, "A", 30)
    shorter = shelve(judged, "A", 2)
    wait(judged, shorter, 2 * DAY)
    assert shelf(judged).listed == []


def test_it_is_ended_by_hand_whatever_was_written_before(judged: Backend) -> None:
    first, newest = shelve(judged, "A", 30), shelve(judged, "A", 60)
    done = notes.end_shelving(judged, "A", newest, "bert")
    assert done.withdrawn_by == "bert"
    assert notes.end_shelving(judged, "A", newest, "carl") == done
    assert [(note.id, note.withdrawn_by) for note in notes.list_notes(judged, "A")] == [
        (newest, "bert"),
        (first, "bert"),
    ]
    assert worst_loops(judged) == ["A", "B", "C"]


def test_to_end_one_leaves_those_before_it_that_ended_by_themselves(judged: Backend) -> None:
    expired, newest = shelve(judged, "A", 2), shelve(judged, "A", 60)
    wait(judged, expired, 3 * DAY)
    notes.end_shelving(judged, "A", newest, "bert")
    assert [(note.id, note.withdrawn_by) for note in notes.list_notes(judged, "A")] == [
        (newest, "bert"),
        (expired, None),
    ]
    assert notes.end_shelving(judged, "A", expired, "bert").withdrawn_at is None


def test_to_end_one_that_was_replaced_leaves_the_newest(judged: Backend) -> None:
    first, newest = shelve(judged, "A", 30), shelve(judged, "A", 60)
    notes.end_shelving(judged, "A", first)
    assert [one.note_id for one in shelf(judged).listed] == [newest]


def test_only_a_shelving_of_that_loop_can_be_ended(judged: Backend) -> None:
    shelving, plain = shelve(judged, "A"), notes.add_note(judged, "A", "runs well").id
    repair = notes.add_note(judged, "C", "packing", repaired_at=datetime.now(UTC) - DAY).id
    for tag, note_id in (("B", shelving), ("A", plain), ("C", repair), ("A", "nonsense"), ("NOWHERE", shelving)):
        with pytest.raises(NotFoundError):
            notes.end_shelving(judged, tag, note_id)
    with pytest.raises(NotFoundError):
        notes.withdraw_repair(judged, "A", shelving)
    assert [one.loop for one in shelf(judged).listed] == ["A"]


def test_a_repair_that_is_stated_after_it_ends_it_as_long_as_it_stands(judged: Backend) -> None:
    earlier = datetime.now(UTC) - 40 * DAY
    notes.add_note(judged, "A", "packing", repaired_at=earlier)
    shelve(judged, "A")
    assert shelf(judged).left_out != ()
    repair = notes.add_note(judged, "A", "done at last", repaired_at=earlier)
    assert shelf(judged).listed == []
    notes.withdraw_repair(judged, "A", repair.id)
    assert [one.loop for one in shelf(judged).listed] == ["A"]


@pytest.mark.parametrize(
    ("then", "now", "words", "step"),
    [
        (UNSURE, SURE, "by now the valve sticks, and that can be relied on", Ask.STICKS),
        (UNSURE, DEAD, "by now PV never answers OP: look today", BY_CAUSE[UNANSWERED]),
        (SURE, DEAD, "by now PV never answers OP: look today", BY_CAUSE[UNANSWERED]),
    ],
)
def test_what_got_worse_in_kind_is_listed_all_the_same(
    judged: Backend, then: dict[str, object], now: dict[str, object], words: str, step: str
) -> None:
    say(judged, "B", **then)
    shelve(judged, "B")
    shelve(judged, "C")
    say(judged, "B", **now)
    seen = shelf(judged)
    assert [(one.loop, one.worse) for one in seen.listed] == [("B", words), ("C", "")]
    assert seen.count_words == "2 shelved, 1 of them listed all the same"
    row = next(row for row in worst.worst(judged, listing(judged)) if row["loop"] == "B")
    assert row["next_step"].startswith(step)
    told = f"shelved until {judged.clock.short(row['shelved_until'])} (work order WO-17), but {words}"
    assert row["shelved"] == told
    assert "C" not in worst_loops(judged)
    shelve(judged, "B")  # somebody has seen it, and shelves it as it is now
    assert worst_loops(judged) == ["A"]


@pytest.mark.parametrize(("then", "now"), [(SURE, UNSURE), (SURE, SURE), (DEAD, DEAD), (DEAD, UNSURE)])
def test_what_is_as_bad_as_it_was_stays_left_out(
    judged: Backend, then: dict[str, object], now: dict[str, object]
) -> None:
    say(judged, "A", **then)
    shelve(judged, "A")
    say(judged, "A", **now)
    assert worst_loops(judged) == ["B", "C"]


def test_a_loop_that_was_never_audited_can_be_shelved_until_it_is_known_to_stick(
    judged: Backend, add_loops: AddLoops
) -> None:
    add_loops("D", n=600)
    shelve(judged, "D")
    assert [(one.loop, one.said) for one in shelf(judged).listed] == [("D", "not audited")]
    audit_chunk(judged, int(start_audit(judged).id), "test")
    say(judged, "D", **SURE)
    assert "D" in worst_loops(judged)


def test_a_retired_loop_is_not_shelved(judged: Backend) -> None:
    shelve(judged, "A")
    patch_loop(judged, "A", {"retired": True})
    assert shelf(judged).listed == []


@pytest.mark.parametrize(
    ("note", "code"),
    [
        ({"text": ""}, "no_reason_to_shelve"),
        ({"shelved_until": datetime(2026, 1, 1, tzinfo=UTC)}, "bad_shelving_time"),
        ({"shelved_until": datetime.now(UTC) + LONGEST + DAY}, "bad_shelving_time"),
        ({"shelved_until": datetime.max}, "bad_shelving_time"),
        ({"repaired_at": datetime(2026, 1, 1, tzinfo=UTC)}, "repaired_and_shelved"),
    ],
)
def test_a_shelving_needs_a_reason_and_a_time_within_a_year(
    judged: Backend, note: dict[str, object], code: str
) -> None:
    given = {"text": "spare part", "shelved_until": until()} | note
    with pytest.raises(RequestError) as refused:
        notes.add_note(judged, "A", **given)  # type: ignore[arg-type]
    assert refused.value.code == code
    assert notes.list_notes(judged, "A") == []


def test_the_end_of_a_line_counts_once_however_a_browser_sends_it(judged: Backend) -> None:
    lines = ["x" * (notes.LONGEST_TEXT - 20), *"123456789", "y"]
    assert notes.add_note(judged, "A", "\r\n".join(lines)).text == "\n".join(lines)
    with pytest.raises(RequestError):
        notes.add_note(judged, "A", "\r\n".join([*lines, "z"]))


def test_a_work_order_is_reason_enough(judged: Backend) -> None:
    notes.add_note(judged, "A", "", "WO-3", shelved_until=datetime.now(UTC) + LONGEST - DAY)
    assert worst_loops(judged) == ["B", "C"]
    assert loop_health(judged, "A")["verdict"] == "stiction"
