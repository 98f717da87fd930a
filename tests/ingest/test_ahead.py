"""Pieces of work that are made ahead of their use: in order, and errors where they belong."""

import threading
import time
from collections.abc import Iterator
from itertools import count
from pathlib import Path

import pytest

from app.ingest import IngestOptions, read_export
from app.ingest.files.ahead import SIDE_BY_SIDE, side_by_side
from app.ingest.files.opening import Lines
from app.ingest.tables.frames import FrameReader, Rows


def test_results_come_in_the_order_of_their_items_whichever_is_made_first() -> None:
    second_is_made = threading.Event()

    def made(item: int) -> int:
        if item == 0:
            assert second_is_made.wait(10)
        if item == 1:
            second_is_made.set()
        return item * 10

    assert list(side_by_side(made, iter(range(7)))) == [0, 10, 20, 30, 40, 50, 60]


def test_few_items_are_taken_before_they_are_used() -> None:
    taken: list[int] = []

    def items() -> Iterator[int]:
        for item in range(50):
            taken.append(item)
            yield item

    results = side_by_side(lambda item: item, items())
    assert next(results) == 0
    assert len(taken) == SIDE_BY_SIDE + 1
    results.close()
    assert len(taken) == SIDE_BY_SIDE + 1


def test_what_came_before_an_error_of_the_items_is_given_first() -> None:
    def items() -> Iterator[int]:
        yield 1
        yield 2
        raise ValueError("the third line is too long")

    results = side_by_side(lambda item: item, items())
    assert [next(results), next(results)] == [1, 2]
    with pytest.raises(ValueError, match="third line"):
        next(results)


def test_what_came_before_an_item_that_cannot_be_made_is_given_first() -> None:
    results = side_by_side(lambda item: 6 // item, iter([3, 2, 0, 1]))
    assert [next(results), next(results)] == [2, 3]
    with pytest.raises(ZeroDivisionError):
        next(results)


def test_loops_and_refused_rows_come_in_the_same_order_whichever_chunk_is_parsed_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "night.csv"
    rows = (
        f"A{tag:02d}.PV,2026-01-31T00:{k:02d}:00Z,{-9999 if k % 4 == 0 else k}" for tag in range(40) for k in range(40)
    )
    path.write_text("\n".join(("Tagname,TimeStamp,Value", *rows)) + "\n")
    parse, numbers = FrameReader._read, count()

    def uneven(reader: FrameReader, lines: Lines) -> Rows:
        if next(numbers) % 2 == 0:
            time.sleep(0.01)
        return parse(reader, lines)

    monkeypatch.setattr(FrameReader, "_read", uneven)
    export = read_export(path, options=IngestOptions(chunk_bytes=1500, max_rejects=20))
    assert [loop.loop for loop in export.loops()] == [f"A{tag:02d}" for tag in range(40)]
    assert [(reject.line, reject.tag) for reject in export.rejects().listed] == [
        (2 + 40 * tag + k, f"A{tag:02d}.PV") for tag in range(2) for k in range(0, 40, 4)
    ]
