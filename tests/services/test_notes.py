"""What is written of a loop, and what a repair changed."""

from datetime import UTC, datetime, timedelta

import pytest

from app.errors import NotFoundError, RequestError
from app.services.backend import Backend
from app.services.plant import before_after, reliability
from app.services.plant.before_after import compared
from app.services.plant.loop_verdicts import verdict_history
from app.services.stating import notes
from tests.services.audited_plant import rewrite


def test_a_repair_parts_the_verdicts(backend: Backend, two_runs: tuple[dict[str, int], int]) -> None:
    ids, first = two_runs
    early, late = datetime(2026, 1, 1, tzinfo=UTC), datetime(2026, 1, 3, tzinfo=UTC)
    rewrite(backend, first, ids["A"], window_start=early, window_end=early, verdict="stiction")
    rewrite(backend, first + 1, ids["A"], window_start=late, window_end=late, verdict="no_stiction")
    assert before_after.newest_repair(backend, "A") is None
    notes.add_note(backend, "A", "packing renewed", "WO-1", datetime(2026, 1, 2, tzinfo=UTC), "somebody")
    repair = before_after.newest_repair(backend, "A")
    assert repair is not None
    assert repair.before is not None
    assert repair.after is not None
    assert (repair.before["verdict"], repair.after["verdict"]) == ("stiction", "no_stiction")
    told = {label: (before, after) for label, before, after in compared(backend, "A", repair, "bar")}
    assert told["Verdict"] == ("valve sticks", "no stiction")
    assert told["Size of stiction S, units of OP (95 % interval)"][1] == "none to state"
    assert "Control error SP - PV, standard deviation, bar" in told
    assert all(float(value) > 0.0 for value in told["Travel of OP an hour, units of OP"])
    assert not any("band" in label for label in told)
    assert compared(backend, "A", before_after.Repair(repair.repaired_at, None, repair.after), None)[0][1] == "–"
    assert compared(backend, "A", before_after.Repair(repair.repaired_at, repair.before, None), None) == []
    (note,) = notes.list_notes(backend, "A")
    assert (note.text, note.work_order, note.written_by) == ("packing renewed", "WO-1", "somebody")
    assert abs(datetime.fromisoformat(note.written_at) - datetime.now(UTC)) < timedelta(minutes=1)
    assert len(verdict_history(backend, "A").rows) == 2


def test_a_window_that_begins_within_the_second_of_a_repair_is_after_it(
    backend: Backend, two_runs: tuple[dict[str, int], int]
) -> None:
    ids, first = two_runs
    noon = datetime(2026, 1, 2, 12, tzinfo=UTC)
    early, late = noon - timedelta(milliseconds=250), noon + timedelta(milliseconds=250)
    rewrite(backend, first, ids["A"], window_start=early, window_end=early, verdict="stiction")
    rewrite(backend, first + 1, ids["A"], window_start=late, window_end=late, verdict="no_stiction")
    notes.add_note(backend, "A", "packing renewed", repaired_at=noon)
    repair = before_after.newest_repair(backend, "A")
    assert repair is not None
    assert (repair.before or {}).get("verdict") == "stiction"
    assert (repair.after or {}).get("verdict") == "no_stiction"


def test_a_repair_is_not_still_to_come(backend: Backend, two_runs: tuple[dict[str, int], int]) -> None:
    now = datetime.now(UTC)
    with pytest.raises(RequestError) as refused:
        notes.add_note(backend, "B", "packing renewed", repaired_at=now + timedelta(hours=1))
    assert refused.value.code == "bad_repair_time"
    assert notes.list_notes(backend, "B") == []
    notes.add_note(backend, "B", "by a clock that is fast", repaired_at=now + timedelta(minutes=1))


def test_a_wrong_time_of_a_repair_is_mended_by_a_further_note(
    backend: Backend, two_runs: tuple[dict[str, int], int]
) -> None:
    for day in (20, 2):
        notes.add_note(backend, "C", "packing renewed", repaired_at=datetime(2026, 1, day, tzinfo=UTC))
    notes.add_note(backend, "C", "runs well")
    repair = before_after.newest_repair(backend, "C")
    assert repair is not None
    assert repair.repaired_at == "2026-01-02T00:00:00Z"


def test_a_withdrawn_repair_counts_no_longer_and_its_note_stays(
    backend: Backend, two_runs: tuple[dict[str, int], int]
) -> None:
    real = notes.add_note(backend, "D", "packing", repaired_at=datetime(2026, 1, 2, tzinfo=UTC))
    wrong = notes.add_note(backend, "D", "another loop was meant", repaired_at=datetime(2026, 1, 9, tzinfo=UTC))
    done = notes.withdraw_repair(backend, "D", wrong.id, "me")
    assert done.withdrawn_at is not None
    assert notes.withdraw_repair(backend, "D", wrong.id, "somebody else") == done
    repair = before_after.newest_repair(backend, "D")
    assert repair is not None
    assert repair.repaired_at == "2026-01-02T00:00:00Z"
    notes.withdraw_repair(backend, "D", real.id, "me")
    assert before_after.newest_repair(backend, "D") is None
    assert [(n.text, n.withdrawn_by) for n in notes.list_notes(backend, "D")] == [
        ("another loop was meant", "me"),
        ("packing", "me"),
    ]


def test_the_table_has_the_order_and_the_repair_that_stand(
    backend: Backend, two_runs: tuple[dict[str, int], int]
) -> None:
    notes.add_note(backend, "A", "packing", "WO-1", datetime(2026, 1, 2, tzinfo=UTC))
    wrong = notes.add_note(backend, "A", "not this loop", repaired_at=datetime(2026, 1, 9, tzinfo=UTC))
    notes.withdraw_repair(backend, "A", wrong.id)
    notes.add_note(backend, "A", "runs well")
    notes.add_note(backend, "B", "to be looked at", "WO-3")
    told = {row["loop"]: (row["work_order"], row["repaired_at"]) for row in reliability.table(backend, 10).rows}
    assert (told["A"], told["B"]) == (("WO-1", "2026-01-02T00:00:00Z"), ("WO-3", None))


def test_only_a_repair_of_that_loop_can_be_withdrawn(backend: Backend, two_runs: tuple[dict[str, int], int]) -> None:
    repair = notes.add_note(backend, "A", repaired_at=datetime(2026, 1, 2, tzinfo=UTC), text="")
    plain = notes.add_note(backend, "A", "runs well")
    for tag, note_id in (("B", repair.id), ("A", plain.id), ("A", "nonsense"), ("A", "77777"), ("NOWHERE", repair.id)):
        with pytest.raises(NotFoundError):
            notes.withdraw_repair(backend, tag, note_id)
    assert before_after.newest_repair(backend, "A") is not None


def test_notes_come_page_by_page(backend: Backend, two_runs: tuple[dict[str, int], int]) -> None:
    for number in range(5):
        notes.add_note(backend, "A", f"note {number}")
    first = notes.note_page(backend, "A", 3)
    rest = notes.note_page(backend, "A", 3, first.next_cursor)
    assert [note.text for note in (*first.rows, *rest.rows)] == [f"note {number}" for number in (4, 3, 2, 1, 0)]
    assert rest.next_cursor is None
