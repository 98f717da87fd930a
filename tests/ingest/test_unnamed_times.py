"""Columns of times that no known name tells: stamps wherever they stand go before numbers that rise."""

from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from app.errors import DataError
from app.ingest import IngestOptions, read_named
from app.ingest.columns import time_columns
from app.ingest.files.head import Head

from .conftest import Read
from .test_tables import parquet

TIMES = [datetime(2024, 3, 14, 8) + timedelta(seconds=10 * k) for k in range(200)]
AT = np.array(TIMES, dtype="datetime64[ns]").astype(np.int64)
Cells = Callable[[int], str]


def stamp(k: int) -> str:
    return f"{TIMES[k]}"


def apart(k: int) -> str:
    return f"{TIMES[k]:%d.%m.%Y;%H:%M:%S}"


def table(heading: str, cells: Cells, last: bool = False) -> str:
    rows = (f"{k % 7};{k % 5}.5;{cells(k)}" if last else f"{cells(k)};{k % 7};{k % 5}.5" for k in range(200))
    return "\n".join((heading, *rows)) + "\n"


@pytest.mark.parametrize(
    ("front", "cells"),
    [
        ("No;Fecha y hora", stamp),
        ("Nr;Datum/Uhrzeit", stamp),
        ("Index;Horodatage", stamp),
        ("#;EventTime", stamp),
        ("Id;source_time", lambda k: f"{TIMES[k]:%Y-%m-%dT%H:%M:%S}Z"),
        ("Id;event_time", lambda k: f"{int(AT[k]) // 10**9}"),
        ("N°;Fecha;Hora", apart),
        ("№;Дата;Время", apart),
        (";Tidpunkt", stamp),
    ],
)
def test_the_number_of_a_row_is_no_time_beside_stamps(read: Read, tmp_path: Path, front: str, cells: Cells) -> None:
    text = table(f"{front};A.PV;A.OP", lambda k: f"{k + 1};{cells(k)}")
    content = read(text)
    np.testing.assert_array_equal(content.loops["A"].time_ns, AT)
    assert content.loops["A"].pv.tolist() == [k % 7 for k in range(200)]
    assert content.summary.tags == 2
    (tmp_path / "a.csv").write_text(text)
    times_s = read_named(tmp_path / "a.csv", IngestOptions()).times_s()
    assert times_s is not None
    np.testing.assert_array_equal(times_s, AT / 1e9)


@pytest.mark.parametrize(("name", "cells"), [("Tidpunkt", stamp), ("", stamp), ("Fecha;Hora", apart)])
def test_times_may_stand_last(read: Read, name: str, cells: Cells) -> None:
    loop = read(table(f"A.PV;A.OP;{name}", cells, last=True)).loops["A"]
    np.testing.assert_array_equal(loop.time_ns, AT)
    assert loop.op.tolist() == [k % 5 + 0.5 for k in range(200)]


def test_the_index_of_a_data_frame(read: Read) -> None:
    values = {"A.PV": [float(k % 7) for k in range(200)], "A.OP": [1.0] * 200}
    loop = read(parquet(pl.DataFrame({**values, "__index_level_0__": TIMES}))).loops["A"]
    np.testing.assert_array_equal(loop.time_ns, AT)


@pytest.mark.parametrize("name", ["No", "Nr.", "#", "N°", "№", "Id", "Row"])
def test_the_number_of_a_row_alone_is_no_time(read: Read, name: str) -> None:
    with pytest.raises(DataError) as refused:
        read(table(f"{name};A.PV;A.OP", str))
    assert refused.value.code == "unknown_layout"


def test_totals_that_rise_are_no_stamps(read: Read) -> None:
    content = read(table("Laufzeit;FQ7;A.PV;A.OP", lambda k: f"{5 * k};{45_000 + k}"))
    assert np.unique(np.diff(content.loops["A"].time_ns)).tolist() == [5 * 10**9]
    assert content.summary.time_format == "relative, s"


@pytest.mark.parametrize("name", ["sec", "s", "Elapsed", "elapsed_s", "index", ""])
@pytest.mark.parametrize(
    ("beside", "cells"),
    [
        ("batch_start", lambda k: "2024-01-01 08:00:00"),
        ("start", lambda k: "1704096000"),
        ("lab date", lambda k: f"2024-01-{1 + k // 50:02d}"),
        ("Start;Clock", lambda k: "01.01.2024;08:00:00"),
    ],
)
def test_seconds_that_rise_go_before_stamps_of_something_else(
    read: Read, tmp_path: Path, name: str, beside: str, cells: Cells
) -> None:
    text = (
        "\n".join((f"{name};SP;PV;OP;{beside}", *(f"{k + 1};5;{k % 7};{k % 5}.5;{cells(k)}" for k in range(200))))
        + "\n"
    )
    content = read(text)
    assert content.summary.time_format == "relative, s"
    assert np.unique(np.diff(content.loops["export"].time_ns)).tolist() == [10**9]
    (tmp_path / "a.csv").write_text(text)
    times_s = read_named(tmp_path / "a.csv", IngestOptions()).times_s()
    assert times_s is not None
    np.testing.assert_array_equal(times_s, np.arange(1.0, 201.0))


def test_seconds_that_rise_go_before_stamps_that_step(read: Read) -> None:
    rows = (f"{k};{k % 7};{k % 5}.5;2024-01-01 0{k // 50}:00:00" for k in range(200))
    content = read("\n".join(("sec;PV;OP;sampled", *rows)) + "\n")
    assert np.unique(np.diff(content.loops["export"].time_ns)).tolist() == [10**9]


def test_hours_of_many_days_go_before_seconds_that_rise(read: Read) -> None:
    rows = (f"{3600 * k};{1 + k // 24:02d}.03.2024;{k % 24:02d}:00:00;{k % 7};1" for k in range(200))
    content = read("\n".join(("sec;Fecha;Hora;A.PV;A.OP", *rows)) + "\n")
    assert content.summary.first_time_ns == np.datetime64("2024-03-01", "ns").astype(np.int64)
    assert np.unique(np.diff(content.loops["A"].time_ns)).tolist() == [3600 * 10**9]


def test_stamps_of_minutes_go_before_the_number_of_a_row(read: Read) -> None:
    content = read(table(";Tidpunkt;A.PV;A.OP", lambda k: f"{k};{TIMES[k]:%Y-%m-%d %H:%M}"))
    assert content.summary.time_format == "%Y-%m-%d %H:%M"


@pytest.mark.parametrize(
    "text",
    [
        "Tag,Value,Quality\n" + "FIC101.PV,1.10,Good,2024-01-01 00:10:00\n" * 9,
        "Tag,Value,Time\n" + "FIC101.PV,1.10,10:00:00,2024-01-01\n" * 9,
        "PV,OP,x\n" + "".join(f"1,2,3,{1_700_000_000 + k}\n" for k in range(9)),
        "time,PV,OP\n" + "10:00:00,1,2,20240101\n" * 9,
        "Loop,clock,PV,OP\n" + "A1,10:00:00,1,2,20240101\n" * 9,
        "Loop,Signal,clock,Value\n" + "A1,PV,10:00:00,2,2024-01-01\nA1,OP,10:00:00,2,2024-01-01\n" * 9,
        "a,clock,b\n" + "A1.PV,10:00:00,2,2024-01-01\nA1.OP,10:00:00,2,2024-01-01\n" * 9,
    ],
)
def test_stamps_behind_the_last_name_are_refused(read: Read, text: str) -> None:
    with pytest.raises(DataError) as refused:
        read(text)
    assert refused.value.code in ("unknown_layout", "more_fields_than_names")


def test_clocks_are_looked_for_once_however_many_columns_hold_dates(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[int, ...]] = []
    found = time_columns.date_and_clock
    monkeypatch.setattr(
        time_columns, "date_and_clock", lambda head, time, *rest: asked.append(time) or found(head, time, *rest)
    )
    rows = tuple((f"{row}", *(f"2024-01-{1 + row // 9:02d}" for _ in range(40))) for row in range(60))
    head = Head("", (), rows, ";", ".")
    called = ("sec", *(f"D{k}" for k in range(40)))
    assert time_columns.stamps_in(head, called, 0, IngestOptions()) == (1,)
    assert time_columns.stamps_in(head, called, 0, IngestOptions(), of_rows=True) == ()
    assert asked == [(1,), (1,)]


@pytest.mark.parametrize("name", ["NO", "NR"])
def test_nitric_oxide_is_no_number_of_a_row(read: Read, name: str) -> None:
    loop = read(
        "\n".join((f"time;A.PV;A.OP;{name}", *(f"{stamp(k)};{k % 7};1;{k % 9}" for k in range(200)))) + "\n"
    ).loops
    assert loop[name].others[name].tolist() == [k % 9 for k in range(200)]
