"""Columns of times that no known name tells: stamps wherever they stand go before numbers that rise."""

from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from app.errors import DataError
from app.ingest import IngestOptions, read_named

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
