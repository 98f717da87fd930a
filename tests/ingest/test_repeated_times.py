"""Stamps of a long table that repeat are read once each; the times are those of the rows, whatever their order."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from app.ingest import IngestOptions
from app.ingest.files.ahead import SIDE_BY_SIDE
from app.ingest.files.opening import TextFile, count_lines
from app.ingest.model import NO_TIME
from app.ingest.rejecting import RejectLog
from app.ingest.tables.frames import NUMBERED, Dialect, FrameReader
from app.ingest.times import stamps
from app.ingest.times.stamps import TimeForm
from app.ingest.times.time_reader import TimeReader
from tests.ingest.conftest import Read

MINUTE = 60 * 10**9


def numbered(texts: list[str | None]) -> pl.Series:
    return pl.Series(texts, dtype=pl.Categorical(pl.Categories.random()))


def test_each_stamp_of_a_file_tag_by_tag_is_read_once(read: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    minutes = [f"2026-01-31T00:{k:02d}:00Z" for k in range(40)]
    rows = [f"L{n}.{s},{stamp},{n + k}.5" for n in range(50) for s in ("PV", "OP") for k, stamp in enumerate(minutes)]
    parsed = []
    one_by_one = TimeReader._texts
    monkeypatch.setattr(TimeReader, "_texts", lambda self, texts: parsed.append(len(texts)) or one_by_one(self, texts))
    loops = read("Tagname,TimeStamp,Value\n" + "\n".join(rows) + "\n").loops
    assert sum(parsed) == 40
    assert len(loops) == 50
    for n in range(50):
        assert np.diff(loops[f"L{n}"].time_ns).tolist() == [MINUTE] * 39
        assert loops[f"L{n}"].pv.tolist() == [n + k + 0.5 for k in range(40)]


def test_an_hour_that_comes_twice_goes_by_the_order_of_the_rows() -> None:
    hours = ["2024-10-27 01:30:00", "2024-10-27 02:30:00", "2024-10-27 02:00:00", "2024-10-27 03:30:00"]
    texts = [hours[0], hours[0], hours[1], hours[1], hours[2], hours[1], hours[3], None, "2024-10-27 x"]
    reader = TimeReader(TimeForm("text", "%Y-%m-%d %H:%M:%S"), IngestOptions(time_zone="Europe/Berlin"))
    found = reader.read(numbered(texts))
    assert np.array_equal(found, reader.read(pl.Series(texts, dtype=pl.String)))
    assert found[5] - found[2] == 60 * MINUTE
    assert (found == NO_TIME).tolist() == [False] * 7 + [True, True]


@pytest.mark.parametrize("form", [TimeForm("relative"), TimeForm("epoch_pair")])
def test_numbers_that_repeat_are_times_too(form: TimeForm) -> None:
    pairs = form.kind == "epoch_pair"
    texts = ["1700000005:7", "1700000005:7", None, "1700000006:1"] if pairs else ["0.5", "0.5", None, "1.5"]
    reader = TimeReader(form, IngestOptions())
    expected = [1_700_000_005 * 10**9 + 7, 1_700_000_006 * 10**9 + 1] if pairs else [5 * 10**8, 15 * 10**8]
    assert reader.read(numbered(texts)).tolist() == [expected[0], expected[0], NO_TIME, expected[1]]


def test_stamps_that_hardly_repeat_are_not_numbered_any_more(tmp_path: Path) -> None:
    path = tmp_path / "events.csv"
    path.write_text("".join(f"L1.PV,2026-01-31T00:00:{k / 1000:06.3f}Z,{k}\n" for k in range(1000)))
    file = TextFile(path, IngestOptions(chunk_bytes=10_000))
    reader = FrameReader(file, Dialect(",", ".", 3), {0: NUMBERED, 1: NUMBERED, 2: pl.Float64()}, RejectLog(10))
    frames = [rows.frame for rows in reader.rows(0)]
    assert len(frames) > 2
    assert isinstance(frames[0]["c1"].dtype, pl.Categorical)
    assert {frame["c1"].dtype for frame in frames[SIDE_BY_SIDE:]} == {pl.String()}
    assert all(isinstance(frame["c0"].dtype, pl.Categorical) for frame in frames)
    assert pl.concat([frame["c2"] for frame in frames]).to_list() == list(range(1000))


def test_two_chunks_number_their_texts_apart(tmp_path: Path) -> None:
    """Else the texts of a whole file would be held at once."""
    path = tmp_path / "night.csv"
    path.write_text("".join(f"L{k % 50}.PV,2026-01-31T00:{k // 50:02d}:00Z,{k}\n" for k in range(2000)))
    file = TextFile(path, IngestOptions(chunk_bytes=20_000))
    reader = FrameReader(file, Dialect(",", ".", 3), {1: NUMBERED, 2: pl.Float64()}, RejectLog(10))
    frames = [rows.frame for rows in reader.rows(0)]
    assert len({frame["c1"].dtype for frame in frames}) == len(frames) > 2
    assert all(frame["c1"].to_physical().min() == 0 for frame in frames)


@pytest.mark.parametrize("chunk_bytes", [1, 7, 64, 1000, 10**6])
@pytest.mark.parametrize("end", ["", "\n"])
def test_chunks_are_the_file_and_end_where_lines_do(tmp_path: Path, chunk_bytes: int, end: str) -> None:
    path = tmp_path / "lines.csv"
    text = "Time,A.PV,A.OP\n" + "\n".join(f"{k},{'1' * (k % 40)},2" for k in range(200)) + end
    path.write_text(text)
    chunks = list(TextFile(path, IngestOptions(chunk_bytes=chunk_bytes)).chunks())
    assert b"".join(lines.data for lines in chunks).decode() == text.removesuffix("\n") + "\n"
    assert all(lines.data.endswith(b"\n") and lines.count == lines.data.count(b"\n") for lines in chunks)
    assert [lines.first for lines in chunks] == [1 + sum(at.count for at in chunks[:n]) for n in range(len(chunks))]


def test_lines_are_counted_across_the_pieces_in_which_they_are_counted() -> None:
    data = np.random.default_rng(0).integers(8, 14, 1_000_003, dtype=np.uint8).tobytes()
    assert count_lines(data) == data.count(b"\n")
    assert count_lines(b"") == 0


def test_the_number_of_a_text_does_not_depend_on_the_form_of_others() -> None:
    texts = ["2026-01-31 00:00:00", " 2026-01-31 00:01:00 ", "2026-01-31 00:00:00", "2026-01-31 00:02"]
    reader = TimeReader(TimeForm("text", "%Y-%m-%d %H:%M:%S"), IngestOptions())
    start = stamps.parse_text(pl.Series(texts[:1]), "%Y-%m-%d %H:%M:%S", zoned=False)[0]
    assert reader.read(numbered(texts)).tolist() == [start, start + MINUTE, start, start + 2 * MINUTE]
