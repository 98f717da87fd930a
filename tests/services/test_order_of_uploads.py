"""Of uploads that say different things of the same samples the one that was received later holds."""

import numpy as np
import pytest
from sqlalchemy import delete, func, select

from app.services.backend import Backend
from app.services.plant.trend import trend
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
    assert second.notes[-1].startswith("10 stored samples were replaced by other values; where that is no correction")
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


def test_many_samples_that_are_replaced_are_counted_as_pages_count_them(backend: Backend) -> None:
    stamps = [f"2026-03-01 {n // 3600:02d}:{n // 60 % 60:02d}:{n % 60:02d}" for n in range(1500)]

    def told(by: float) -> bytes:
        rows = [f"{stamp},{n % 7 + by:.1f},{n % 5:.1f}" for n, stamp in enumerate(stamps)]
        return "\n".join(["time,FIC1.PV,FIC1.OP", *rows, ""]).encode()

    read(backend, send(backend, told(0.0)))
    assert read(backend, send(backend, told(1.0))).notes[-1].startswith("1,500 stored samples were replaced")
