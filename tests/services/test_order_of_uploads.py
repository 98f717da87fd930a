"""Of uploads that say different things of the same samples the one that was received later holds."""

import numpy as np
import pytest
from sqlalchemy import delete, func, select

from app.services.backend import Backend
from app.services.intake import reading
from app.services.plant.trend import trend
from app.storage import overtaken
from app.storage.tables import series as series_table
from app.storage.tables import uploads as uploads_table
from tests.services.sent_uploads import expire, export, read, send


def changed(first: int, last: int, by: float) -> bytes:
    """The export with other values of FIC1.PV in some rows."""
    lines = export().decode().splitlines(keepends=True)
    for row in range(first + 1, last + 1):
        time_, pv, rest = lines[row].split(",", 2)
        lines[row] = f"{time_},{float(pv) + by:.3f},{rest}"
    return "".join(lines).encode()


def stored_pv(backend: Backend) -> tuple[list[float | None], int]:
    """What holds of FIC1.PV, and how many stretches are stored."""
    with backend.database.read() as connection:
        rows = connection.scalar(select(func.count()).select_from(series_table))
    return trend(backend, "FIC1", points=1000).pv, rows


def test_a_correction_that_is_taken_back_holds_no_more(backend: Backend) -> None:
    sent, corrected = export(), changed(20, 30, by=5.0)
    first = read(backend, send(backend, sent))
    before = stored_pv(backend)[0]
    second = read(backend, send(backend, corrected))
    assert stored_pv(backend)[0] == pytest.approx([*before[:20], *(v + 5.0 for v in before[20:30]), *before[30:]])
    third = read(backend, send(backend, sent + b"\n"))
    assert [(one.samples_added, one.samples_replaced) for one in (second, third)] == [(0, 10), (0, 10)]
    assert stored_pv(backend) == (before, 4)
    fourth = read(backend, send(backend, corrected + b"\n"))
    assert (fourth.samples_added, fourth.samples_replaced) == (0, 10)
    held = stored_pv(backend)
    for upload in (first, second, third, fourth):  # each task may run twice, and late
        expire(backend, upload, state="received")
        again = read(backend, upload)
        assert (again.samples_added, again.samples_replaced) == (0, 0)
        assert stored_pv(backend) == held
    repeated = read(backend, send(backend, corrected + b"\n\n"))
    assert (repeated.samples_added, stored_pv(backend)) == (0, held)


def test_of_two_uploads_the_one_received_later_holds_though_it_is_read_first(backend: Backend) -> None:
    """Two workers read at once, and one that found no room waits."""
    first, second = send(backend, export()), send(backend, changed(20, 30, by=5.0))
    assert read(backend, second).samples_added == 400
    held = stored_pv(backend)
    assert held[0] is not None
    assert read(backend, first).samples_added == 0
    assert stored_pv(backend) == held
    assert held[0][20:30] == pytest.approx([50 + np.sin(i / 9) + 5.0 for i in range(20, 30)], abs=1e-3)


def test_what_was_said_again_holds_over_a_correction_that_is_read_late(backend: Backend) -> None:
    read(backend, send(backend, export()))
    before = stored_pv(backend)[0]
    corrected, again = send(backend, changed(20, 30, by=5.0)), send(backend, export() + b"\n")
    assert read(backend, again).samples_added == 0
    assert read(backend, corrected).samples_added == 0
    assert stored_pv(backend)[0] == before


def test_an_upload_that_failed_by_a_fault_of_ours_counts_as_received_when_it_is_sent_again(backend: Backend) -> None:
    """Others were read meanwhile, and did not know that it would still come."""
    sent, corrected = export(), changed(20, 30, by=5.0)
    read(backend, send(backend, sent))
    before = stored_pv(backend)[0]
    failed = send(backend, corrected)
    expire(backend, failed, state="failed", error_code="fault")
    read(backend, send(backend, sent + b"\n"))
    assert read(backend, send(backend, corrected)).samples_replaced == 10
    assert stored_pv(backend)[0][20:30] == pytest.approx([value + 5.0 for value in before[20:30]])


def test_numbers_go_on_where_uploads_are_gone(backend: Backend) -> None:
    """SQLite gives the id of the last row once more when that row is gone."""
    read(backend, send(backend, export()))
    read(backend, send(backend, export() + b"\n"))
    with backend.database.write() as connection:
        connection.execute(delete(uploads_table))
    assert read(backend, send(backend, changed(20, 30, by=5.0))).samples_replaced == 10


@pytest.mark.parametrize("few_loops", [0, overtaken.FEW_LOOPS])
def test_a_file_that_is_sent_again_holds_over_what_came_in_between(
    backend: Backend, monkeypatch: pytest.MonkeyPatch, few_loops: int
) -> None:
    monkeypatch.setattr(overtaken, "FEW_LOOPS", few_loops)
    right, wrong = export(), changed(20, 30, by=5.0)
    first = read(backend, send(backend, right))
    before = stored_pv(backend)[0]
    told = read(backend, send(backend, wrong))
    assert (told.samples_added, told.samples_replaced) == (0, 10)
    assert any(note.startswith("10 stored samples were replaced by other values") for note in told.notes)
    again = send(backend, right)
    assert (again.id, again.state) == (first.id, "received")
    done = read(backend, again)
    assert (done.state, done.samples_added, done.samples_replaced) == ("done", 0, 10)
    assert stored_pv(backend)[0] == before
    held = stored_pv(backend)
    assert send(backend, right).state == "done"  # now it is the last one, and costs nothing
    assert read(backend, send(backend, wrong)).samples_replaced == 10
    assert read(backend, send(backend, right)).samples_replaced == 10
    assert stored_pv(backend)[0] == held[0]


@pytest.mark.parametrize("few_loops", [0, overtaken.FEW_LOOPS])
def test_what_is_sent_again_is_not_read_where_others_brought_nothing_of_it(
    backend: Backend, monkeypatch: pytest.MonkeyPatch, few_loops: int
) -> None:
    """A folder that is sent anew every night is not read anew: other times, other loops, the same values."""
    monkeypatch.setattr(overtaken, "FEW_LOOPS", few_loops)
    others = (
        export(start=1_750_100_000),
        export().replace(b"FIC1", b"FIC3").replace(b"LIC2", b"LIC4"),
        export() + b"\n",
    )
    for data in (export(), *others):
        read(backend, send(backend, data))
    assert [send(backend, data).state for data in (export(), *others)] == ["done"] * 4


def test_what_is_sent_again_while_another_waits_to_be_read_holds_over_it(backend: Backend) -> None:
    right, wrong = export(), changed(20, 30, by=5.0)
    read(backend, send(backend, right))
    before = stored_pv(backend)[0]
    between = send(backend, wrong)
    again = send(backend, right)
    assert again.state == "received"
    for upload in (again, between):
        read(backend, upload)
    assert stored_pv(backend)[0] == before
    assert send(backend, right).state == "done"


def test_what_waits_to_be_read_and_is_sent_again_holds_over_what_came_in_between(backend: Backend) -> None:
    right, wrong = send(backend, export()), send(backend, changed(20, 30, by=5.0))
    assert send(backend, export()).id == right.id
    for upload in (right, wrong):
        read(backend, upload)
    assert stored_pv(backend)[0][20:30] == pytest.approx([50 + np.sin(i / 9) for i in range(20, 30)], abs=1e-3)


@pytest.mark.parametrize("by", [5.0, None])
def test_what_is_sent_again_while_it_is_read_is_read_once_more_where_another_came_in_between(
    backend: Backend, monkeypatch: pytest.MonkeyPatch, by: float | None
) -> None:
    """None: the other one has other loops, and changes nothing of it."""
    other = export().replace(b"FIC1", b"FIC3").replace(b"LIC2", b"LIC4") if by is None else changed(20, 30, by=by)
    right, store = send(backend, export()), reading._store
    calls: list[int] = []

    def meanwhile(*arguments: object) -> object:
        calls.append(1)
        if len(calls) == 1:
            read(backend, send(backend, other), owner="other")
            assert send(backend, export()).state == "reading"
        return store(*arguments)

    monkeypatch.setattr(reading, "_store", meanwhile)
    state = read(backend, right).state
    assert state == ("done" if by is None else "received")
    assert read(backend, right).state == "done"
    assert stored_pv(backend)[0][20:30] == pytest.approx([50 + np.sin(i / 9) for i in range(20, 30)], abs=1e-3)
    assert send(backend, export()).state == "done"
