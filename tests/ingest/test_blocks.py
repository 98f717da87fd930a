"""A table of many columns is read as one column of numbers: the same loops and refusals as column by column."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from app.ingest import IngestOptions, read_export
from app.ingest.tables import frames
from app.ingest.tables.frames import FrameReader, Rows
from tests.ingest.conftest import Content, Read

ROWS = 60
HEAD = "DateTime,A.PV,A.OP,A.SP,A.MODE,B.PV,B.OP,C.PV"


def row(k: int, *, blank: bool = False) -> str:
    middle = "" if blank else f"{k / 8}"
    return f"2026-01-31 00:{k:02d}:00,{k}.25,{middle},50,{'AUTO' if k % 3 else 'MAN'},{-k}.5,1e{k % 5},{k}"


def plain() -> list[str]:
    return [row(k) for k in range(ROWS)]


def odd_fields() -> list[str]:
    lines = [row(k, blank=k % 7 == 0) for k in range(ROWS)]
    lines[3] = lines[3].replace("3.25", "Bad Input")
    lines[4] = lines[4].replace("4.25", "NaN").replace("-4.5", "inf")
    lines[5] = lines[5].replace("5.25", " 5.75 ")
    lines[6] = lines[6].replace("AUTO", "?").replace("MAN", "?")
    lines[9] = lines[9].replace("9.25", "-9999")
    lines[10] = lines[10].replace("2026-01-31", "yesterday")
    return lines


FILES: dict[str, Callable[[], str]] = {
    "plain": lambda: "\n".join([HEAD, *plain()]) + "\n",
    "no end of the last line": lambda: "\n".join([HEAD, *plain()]),
    "line ends of Windows": lambda: "\r\n".join([HEAD, *plain()]) + "\r\n",
    "odd fields": lambda: "\n".join([HEAD, *odd_fields()]) + "\n",
    "decimal commas": lambda: "\n".join([HEAD, *plain()]).replace(",", ";").replace(".25", ",25") + "\n",
    "a short row": lambda: "\n".join([HEAD, *plain()[:30], row(30).rpartition(",")[0], *plain()[31:]]) + "\n",
    "a long row": lambda: "\n".join([HEAD, *plain()[:30], row(30) + ",7", *plain()[31:]]) + "\n",
    "two rows of half a length": lambda: "\n".join([HEAD, *plain()[:20], "1,2,3,4", "5,6,7,8", *plain()[21:]]) + "\n",
    "quotes": lambda: "\n".join([HEAD, *plain()[:20], row(20).replace("20.25", '"20.25"'), *plain()[21:]]) + "\n",
    "a mark between the units": lambda: "\n".join([HEAD, *plain()[:20], row(20) + "\x1f7", *plain()[21:]]) + "\n",
    "an empty time and one with an accent": lambda: (
        "\n".join([HEAD, *plain()[:20], row(20)[19:], row(21).replace("2026", "f\u00e9vrier"), *plain()[22:]]) + "\n"
    ),
    "a mode behind many columns": lambda: (
        "\n".join(
            ["DateTime,A.PV,A.OP,A.SP,B.PV,B.OP,C.PV,D.PV,D.OP,E.PV,A.MODE"]
            + [
                f"2026-01-31 00:{k:02d}:00,{k},{k},50,{-k},1,2,3,4,{k}.5,{'AUTO' if k % 3 else '?'}"
                for k in range(ROWS)
            ]
        )
        + "\n"
    ),
    "a comment and an empty line": lambda: "\n".join([HEAD, *plain()[:20], "# shift", "", *plain()[20:]]) + "\n",
}

WHOLE = {
    "plain",
    "no end of the last line",
    "line ends of Windows",
    "odd fields",
    "decimal commas",
    "an empty time and one with an accent",
    "a mode behind many columns",
}


def same(one: Content, other: Content) -> None:
    assert one.rejects == other.rejects
    assert one.summary == other.summary
    assert list(one.loops) == list(other.loops)
    for loop, expected in other.loops.items():
        found = one.loops[loop]
        assert np.array_equal(found.time_ns, expected.time_ns)
        for name in ("pv", "op", "sp", "automatic"):
            ours, theirs = getattr(found, name), getattr(expected, name)
            assert (ours is None) == (theirs is None)
            assert ours is None or np.array_equal(ours, theirs, equal_nan=True), (loop, name)


@pytest.mark.parametrize("chunk_bytes", [400, 1 << 20])
@pytest.mark.parametrize("name", FILES)
def test_blocks_give_what_columns_give(
    read: Read, monkeypatch: pytest.MonkeyPatch, name: str, chunk_bytes: int
) -> None:
    options = IngestOptions(chunk_bytes=chunk_bytes)
    by_columns = read(FILES[name](), options=options)
    blocks = []
    one_by_one = FrameReader._read_block

    def noted(self: FrameReader, lines: frames.Lines, decimal_comma: bool) -> Rows | None:
        rows = one_by_one(self, lines, decimal_comma)
        blocks.append(rows is not None)
        return rows

    monkeypatch.setattr(frames, "BLOCK_COLUMNS", 2)
    monkeypatch.setattr(FrameReader, "_read_block", noted)
    same(read(FILES[name](), options=options), by_columns)
    assert any(blocks) == (name in WHOLE or chunk_bytes == 400)
    assert {"A", "B", "C"} <= by_columns.loops.keys()


def test_a_wide_file_is_not_parted_into_columns(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    widths = []
    parse = FrameReader._parse

    def noted(
        self: FrameReader, data: bytes, schema: object, columns: list[int], *more: object, **named: bool
    ) -> object:
        widths.append(len(columns))
        return parse(self, data, schema, columns, *more, **named)

    monkeypatch.setattr(FrameReader, "_parse", noted)
    path = tmp_path / "night.csv"
    tags = [f"L{n}.{signal}" for n in range(200) for signal in ("PV", "OP")]
    lines = [f"2026-01-31 00:{k:02d}:00," + ",".join(str(k + n) for n in range(400)) for k in range(ROWS)]
    path.write_text("\n".join([",".join(["DateTime", *tags]), *lines]) + "\n")
    loops = {loop.loop: loop for loop in read_export(path).loops()}
    assert max(widths) == 1
    assert loops["L7"].op.tolist() == [k + 15.0 for k in range(ROWS)]
