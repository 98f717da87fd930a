"""Plants that have the same tags in one file: one contradicts the other, wherever in the file the two stand."""

from collections.abc import Callable, Iterator
from datetime import datetime, timedelta

import numpy as np
import polars as pl
import pytest

from app.errors import DataError
from app.ingest import IngestOptions
from app.ingest.exports import tables_in

from .conftest import Read, in_pairs
from .test_tables import parquet

N = 720
FIRST = datetime(2026, 3, 10)
AT = [(FIRST + timedelta(seconds=5 * k)).isoformat() for k in range(N)]
NOISE = np.random.default_rng(1).normal(50, 1, (2, 2, N)).round(3)  # by place and signal
PLACES = {"words": ("North", "South"), "numbers": ("1", "2"), "like modes": ("A", "M"), "half": ("Crude", "Hand")}

Rows = Iterator[str]


def long(places: tuple[str, str], later: Callable[[int, int], float] | None = None, second: range = range(N)) -> Rows:
    """One place behind the other. later: the value of a signal at the second one."""
    for place, word in enumerate(places):
        for k in second if place else range(N):
            for s, signal in enumerate(("PV", "OP")):
                value = later(s, k) if place and later else NOISE[place, s, k]
                yield f"{word},FIC101.{signal},{AT[k]},{value}"


def by_tag(places: tuple[str, str]) -> Rows:
    return iter(sorted(long(places), key=lambda row: row.split(",")[1]))


def in_turn(places: tuple[str, str]) -> Rows:
    return iter(sorted(long(places), key=lambda row: row.split(",")[2]))


def wide(places: tuple[str, str]) -> Rows:
    return (
        f"{word},{AT[k]},{NOISE[place, 0, k]},{NOISE[place, 1, k]}"
        for place, word in enumerate(places)
        for k in range(N)
    )


def of_loops(places: tuple[str, str]) -> Rows:
    return (row.replace(",", ",FIC101,", 1) for row in wide(places))


def of_loops_in_turn(places: tuple[str, str]) -> Rows:
    return iter(sorted(of_loops(places), key=lambda row: row.split(",")[2]))


SHAPES = {
    long: "Tag,Time,Value",
    by_tag: "Tag,Time,Value",
    in_turn: "Tag,Time,Value",
    wide: "Time,FIC101.PV,FIC101.OP",
    of_loops: "Loop,Time,PV,OP",
    of_loops_in_turn: "Loop,Time,PV,OP",
}


def text(names: str, rows: Rows) -> str:
    return "\n".join((names, *rows)) + "\n"


def refused(read: Read, data: str | bytes, options: IngestOptions | None = None) -> None:
    with pytest.raises(DataError, match="'Plant' tells the rows of one time apart") as error:
        read(data, options=options)
    assert error.value.code == "unknown_layout"


@in_pairs(
    shape=list(SHAPES),
    place=list(PLACES),
    options=[IngestOptions(), IngestOptions(chunk_bytes=5000, buffered_values=600)],
)
def test_two_plants_are_refused_whatever_the_order_of_rows(
    read: Read, shape: Callable[[tuple[str, str]], Rows], place: str, options: IngestOptions
) -> None:
    refused(read, text(f"Plant,{SHAPES[shape]}", shape(PLACES[place])), options)


@pytest.mark.parametrize("kind", [pl.String(), pl.Int64(), pl.Float64()])
def test_in_parquet(read: Read, kind: pl.DataType) -> None:
    rows = [row.split(",") for row in long(PLACES["words" if kind == pl.String() else "numbers"])]
    frame = pl.DataFrame(rows, schema=["Plant", "Tag", "Time", "Value"], orient="row")
    refused(read, parquet(frame.with_columns(pl.col("Value").cast(pl.Float64), pl.col("Plant").cast(kind))))


def test_a_plant_of_which_there_is_a_part(read: Read) -> None:
    refused(read, text("Plant,Tag,Time,Value", long(PLACES["words"], second=range(500, 720))))


def test_a_plant_that_has_few_of_the_tags(read: Read) -> None:
    others = (f"North,TI{n},{at},{n}" for n in range(20) for at in AT)
    refused(read, text("Plant,Tag,Time,Value", iter([*others, *long(PLACES["words"])])))


GOOD = {
    "the same again": ("Plant", PLACES["words"], lambda s, k: NOISE[0, s, k], range(N)),
    "some corrected": ("Plant", PLACES["words"], lambda s, k: NOISE[0, s, k] + (k % 12 == 0), range(N)),
    "few corrected": ("Source", ("raw", "lab"), None, range(60)),
    "a remark": ("Info", ("", "corrected"), None, range(N)),
    "qualities": ("State of value", ("Good", "Questionable"), None, range(N)),
    "qualities in numbers": ("OPC Quality", ("192", "216"), None, range(N)),
    "descriptions": ("Description", ("Feed", "Feed flow"), None, range(N)),
    "a corrected day of five": ("Node", ("SRV1", "SRV2"), None, range(N // 2, N // 2 + N // 5)),
    "another batch": ("Batch", ("4711", "4712"), None, range(N)),
    "what was corrected": ("Source", ("original", "corrected"), None, range(N)),
    "another historian's digits": ("Node", PLACES["words"], lambda s, k: round(NOISE[0, s, k], 2), range(N)),
    "versions": ("Version", ("1", "2"), None, range(N)),
    "another plant's name in all": ("Plant", ("North", "North"), None, range(N)),
}


def test_plants_that_run_close_to_each_other(read: Read) -> None:
    """Apart by a hundredth of what their signals reach over: more than any rounding."""
    near = NOISE[0] + 0.01 * np.ptp(NOISE[0], axis=1, keepdims=True)
    refused(read, text("Plant,Tag,Time,Value", long(PLACES["words"], lambda s, k: near[s, k])))


@pytest.mark.parametrize("case", GOOD)
def test_what_comes_again_is_no_other_plant(read: Read, case: str) -> None:
    name, words, later, second = GOOD[case]
    content = read(text(f"{name},Tag,Time,Value", long(words, later, second)))
    assert content.loops["FIC101"].samples == N


def test_numbers_of_rows_tell_no_plants_apart(read: Read) -> None:
    rows = (f"{number},{row.partition(',')[2]}" for number, row in enumerate(long(PLACES["words"])))
    assert read(text("Row number,Tag,Time,Value", rows)).loops["FIC101"].samples == N


def test_a_step_number_goes_with_values_that_were_corrected(read: Read) -> None:
    rows = (f"{k % N // 100},{row.partition(',')[2]}" for k, row in enumerate(wide(PLACES["words"])))
    assert read(text("Step,Time,FIC101.PV,FIC101.OP", rows)).loops["FIC101"].samples == N


@pytest.mark.parametrize("words", [("S", "W"), ("CEST", "CET"), ("0", "1")])
def test_the_hour_that_clocks_have_twice_is_no_other_plant(read: Read, words: tuple[str, str]) -> None:
    rows = []
    for k in range(720):
        at = datetime(2026, 10, 25) + timedelta(seconds=30 * k)
        later = at.hour >= 3
        rows.append(f"{words[later]},{at - timedelta(hours=later)},{NOISE[0, 0, k]},{NOISE[0, 1, k]}")
    assert read(text("P,Time,FIC101.PV,FIC101.OP", iter(rows))).loops["FIC101"].samples == 600


@pytest.mark.parametrize("at", [0, 59])
def test_a_plant_in_one_of_many_passes(read: Read, monkeypatch: pytest.MonkeyPatch, at: int) -> None:
    """Rows are of the file, however many passes over its columns there are."""
    monkeypatch.setattr(tables_in, "MOST_COLUMNS", 2)
    monkeypatch.setattr(tables_in, "FEWEST_COLUMNS", 2)
    rows = [row.split(",") for row in wide(PLACES["words"])]
    rows = [*rows[:N], *rows[N : N + N // 2]]
    columns = {f"TIC{n}.{signal}": [float(n)] * len(rows) for n in range(60) for signal in ("PV", "OP")}
    columns[f"TIC{at}.PV"] = [float(row[2]) for row in rows]
    columns[f"TIC{at}.OP"] = [float(row[3]) for row in rows]
    frame = pl.DataFrame({"Plant": [row[0] for row in rows], "Time": [row[1] for row in rows], **columns})
    refused(read, parquet(frame))
