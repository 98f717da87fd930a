"""Scans of a whole plant are grids; whatever is missing or in another order is rows, with the same loops in the end."""

from pathlib import Path

import numpy as np
import pytest

from app.errors import DataError
from app.ingest import IngestOptions, read_export
from app.ingest.tables import parting
from app.ingest.tables.pieces import Gathered, Grid, as_piece, in_whole_instants, joined_grid

from .conftest import Read


def rows(codes: list[int], times: list[int], first_line: int = 2) -> Gathered:
    n = len(codes)
    lines = np.arange(first_line, first_line + n, dtype=np.uint32)
    return Gathered(np.array(codes, np.uint32), np.array(times), np.arange(n, dtype=float), lines)


def test_whole_scans_are_a_grid_and_come_back_as_rows() -> None:
    scans = rows([3, 1, 2] * 2, [10] * 3 + [20] * 3)
    grid = as_piece(scans)
    assert isinstance(grid, Grid)
    assert grid.values.tolist() == [[0.0, 3.0], [1.0, 4.0], [2.0, 5.0]]
    assert grid.time_ns.tolist() == [10, 20]
    again = grid.rows()
    for name in ("codes", "time_ns", "values", "lines"):
        assert np.array_equal(getattr(again, name), getattr(scans, name)), name


@pytest.mark.parametrize(
    ("codes", "times"),
    [
        ([1, 2, 2, 1], [10, 10, 20, 20]),  # another order
        ([1, 2, 1, 2], [10, 10, 20, 30]),  # another time in a scan
        ([1, 1, 1, 1], [10, 10, 20, 20]),  # a tag twice
        ([1, 2, 1], [10, 10, 20]),  # a part of a scan
        ([1, 2, 3], [10, 20, 30]),  # tag after tag
    ],
)
def test_anything_else_stays_rows(codes: list[int], times: list[int]) -> None:
    assert isinstance(as_piece(rows(codes, times)), Gathered)


def test_a_gap_in_the_lines_stays_rows() -> None:
    scans = rows([1, 2] * 2, [10, 10, 20, 20])
    gap = Gathered(scans.codes, scans.time_ns, scans.values, scans.lines + np.array([0, 0, 1, 1], np.uint32))
    assert isinstance(as_piece(gap), Gathered)


def test_rows_are_parted_where_their_last_instant_begins() -> None:
    whole, rest = in_whole_instants(rows([1, 2, 1], [10, 10, 20]))
    assert (len(whole), len(rest)) == (2, 1)
    whole, rest = in_whole_instants(rows([1, 2], [10, 10]))
    assert (len(whole), len(rest)) == (2, 0)


def test_grids_are_joined_while_time_runs_forward() -> None:
    first, second = as_piece(rows([1, 2] * 2, [10, 10, 20, 20])), as_piece(rows([1, 2] * 2, [30, 30, 40, 40]))
    together = joined_grid([first, second])
    assert together is not None
    assert together.time_ns.tolist() == [10, 20, 30, 40]
    assert joined_grid([second, first]) is None
    assert joined_grid([first, rows([1], [50])]) is None


def test_a_night_with_a_gap_a_sentinel_and_a_repeat_is_read_as_if_it_came_whole(
    tmp_path: Path,
) -> None:
    lines = ["Tagname,TimeStamp,Value"]
    for k in range(60):
        stamp = f"2026-01-31T00:{k:02d}:00Z"
        lines += [f"L{n}.{s},{stamp},{n + k / 8}" for n in range(20) for s in ("PV", "OP") if (n, k) != (3, 20)]
    lines[100] = lines[100].rpartition(",")[0] + ",-9999"
    lines.append("L5.PV,2026-01-31T00:10:00Z,99")
    path = tmp_path / "night.csv"
    path.write_text("\n".join(lines) + "\n")
    whole = read_export(path)
    expected = {loop.loop: loop for loop in whole.loops()}
    parted = read_export(path, options=IngestOptions(chunk_bytes=3000, buffered_values=900, spill_folder=tmp_path))
    found = {loop.loop: loop for loop in parted.loops()}
    assert found.keys() == expected.keys()
    for tag, loop in found.items():
        assert np.array_equal(loop.time_ns, expected[tag].time_ns)
        assert np.array_equal(loop.pv, expected[tag].pv, equal_nan=True)
    assert parted.rejects().counts == whole.rejects().counts == {"sentinel": 1, "duplicate_time": 1}
    assert {(r.line, r.code) for r in parted.rejects().listed} == {(r.line, r.code) for r in whole.rejects().listed}


HEADER = "Tagname,TimeStamp,Value\n"


def test_scans_and_single_rows_with_modes_and_odd_numbers(read: Read) -> None:
    rows = "".join(
        f"A.PV,2024-03-01 00:0{i}:00,{pv}\nA.MODE,2024-03-01 00:0{i}:00,{mode}\n"
        for i, (pv, mode) in enumerate([("1", "1"), ("nan", "0"), ("1e400", "AUTO"), ("-9999", "odd"), ("5", "7")])
    )
    for single in ("", "B.PV,2024-03-01 00:09:00,1\n"):
        content = read(HEADER + rows + single)
        loop = content.loops["A"]
        np.testing.assert_array_equal(loop.pv, [1, np.nan, np.nan, np.nan, 5])
        assert loop.automatic.tolist() == [1, 0, 1, -1, -1]
        assert {(reject.line, reject.code, reject.tag) for reject in content.rejects.listed} == {
            (4, "not_finite", "A.PV"), (6, "not_finite", "A.PV"), (8, "sentinel", "A.PV"),
            (9, "unknown_mode", "A.MODE"), (11, "unknown_mode", "A.MODE"),
        }  # fmt: skip


def test_tags_too_long_or_missing_leave_the_others(read: Read) -> None:
    rows = [f"{tag},2024-03-01 00:0{i}:00,{i}\n" for i in range(3) for tag in ("A.PV", "x" * 300 + ".PV", "")]
    rows += [f"A.PV,2024-03-01 00:{i}:00,{i}\n" for i in range(10, 60)]
    for options in (IngestOptions(), IngestOptions(chunk_bytes=250)):
        content = read(HEADER + "".join(rows), options=options)
        assert list(content.loops) == ["A"]
        assert content.loops["A"].samples == 53
        assert dict(content.rejects.counts) == {"name_too_long": 3, "no_tag": 3}


@pytest.mark.parametrize("line", ["", "* from the historian", ",2024-03-01 00:00:00,7", 'B.PV,2024-03-01 00:00:00,"7'])
def test_a_line_without_a_tag_before_the_first_one(read: Read, line: str) -> None:
    """It once took the code of the first tag, whose rows were then refused as of a name too long."""
    content = read(HEADER + line + "\nA.PV,2024-03-01 00:00:00,1\nA.PV,2024-03-01 00:01:00,2\n")
    assert content.loops["A"].pv.tolist() == [1, 2]
    assert "name_too_long" not in content.rejects.counts


@pytest.mark.parametrize("odd", ['x",x"', 'x", x" '])
def test_quotes_inside_of_fields(read: Read, odd: str) -> None:
    rows = "".join(f"A.PV,2024-03-01 00:0{i}:00,{i},Good\n" for i in range(4))
    last = "A.PV,2024-03-01 00:09:00,9,Good\n"
    content = read(HEADER[:-1] + ",DataQuality\n" + rows + f"A.PV,2024-03-01 00:04:00,{odd}\n" + last)
    np.testing.assert_array_equal(content.loops["A"].pv, [0, 1, 2, 3, np.nan, 9])
    assert [(reject.line, reject.code) for reject in content.rejects.listed] == [(6, "not_a_number")]


def test_more_tags_than_any_plant_has_are_refused(read: Read) -> None:
    rows = "".join(f"L{n}.PV,2024-03-01 00:00:00,1\n" for n in range(3))
    with pytest.raises(DataError, match="more than 2 tags") as refused:
        read(HEADER + rows, options=IngestOptions(max_signals=2))
    assert refused.value.code == "too_many_tags"


def test_tag_after_tag_in_one_night(read: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parting, "MOST_CODES", 1)
    stamps = [f"2024-03-01 {i // 3600:02d}:{i // 60 % 60:02d}:{i % 60:02d}" for i in range(4000)]
    rows = "".join(f"{tag},{stamp},{i}\n" for tag in ("A.PV", "A.OP") for i, stamp in enumerate(stamps))
    for size in (1 << 20, 60_000):  # in small chunks no stamp repeats
        loop = read(HEADER + rows, options=IngestOptions(chunk_bytes=size)).loops["A"]
        assert loop.pv.tolist() == loop.op.tolist() == list(range(4000))
        np.testing.assert_array_equal(np.diff(loop.time_ns), 10**9)


def test_scans_with_date_and_time_apart(read: Read) -> None:
    stamps = [f"2024-03-01,{i // 3600:02d}:{i // 60 % 60:02d}:{i % 60:02d}" for i in range(600)]
    rows = "".join(f"{tag},{stamp},{i}\n" for i, stamp in enumerate(stamps) for tag in ("A.PV", "A.OP", "A.SP"))
    loop = read("Tagname,Date,Time,Value\n" + rows).loops["A"]
    assert loop.pv.tolist() == loop.op.tolist() == loop.sp.tolist() == list(range(600))
    np.testing.assert_array_equal(np.diff(loop.time_ns), 10**9)
