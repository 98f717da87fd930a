"""Comments of a long file where tags stand: never loops, also where the file is read in chunks and parted on disk."""

from pathlib import Path

import pytest

from app.ingest import IngestOptions
from tests.ingest.conftest import Read

HEAD = "Tagname,TimeStamp,Value\n"


def minutes(tag: str, first: int, count: int) -> str:
    return "".join(f"{tag},2026-01-31T{k // 60:02d}:{k % 60:02d}:00Z,{k}\n" for k in range(first, first + count))


@pytest.fixture
def in_chunks(tmp_path: Path) -> IngestOptions:
    """Chunks of some 60 rows, parted on disk every 100."""
    return IngestOptions(chunk_bytes=2000, buffered_values=300, spill_folder=tmp_path)


def test_a_comment_in_an_early_chunk_leaves_the_later_ones_alone(read: Read, in_chunks: IngestOptions) -> None:
    found = read(
        HEAD + minutes("FIC1.PV", 0, 5) + "* checked by shift B,,\n" + minutes("FIC1.PV", 5, 400), options=in_chunks
    )
    assert list(found.loops) == ["FIC1"]
    assert found.loops["FIC1"].pv.tolist() == list(range(405))


def test_a_tag_that_looked_like_a_comment_keeps_its_rows_when_the_first_parts_are_written(
    read: Read, in_chunks: IngestOptions
) -> None:
    comment = "[PLC1]FIC1.PV,no time,1\n"
    rows = HEAD + minutes("FIC2.PV", 0, 5) + comment + minutes("FIC2.PV", 5, 300) + minutes("[PLC1]FIC1.PV", 0, 300)
    found = read(rows, options=in_chunks)
    assert sorted(found.loops) == ["FIC2", "[PLC1]FIC1"]
    assert [samples.samples for _, samples in sorted(found.loops.items())] == [305, 300]
    assert found.loops["[PLC1]FIC1"].pv.tolist() == list(range(300))


@pytest.mark.parametrize("names", ["Time,FIC1.PV,FIC1.OP", "Time,Tag,Value"])
def test_times_that_a_spreadsheet_could_not_show_are_refused_and_no_comments(read: Read, names: str) -> None:
    stamps = [f"2026-03-01 00:{k // 60:02d}:{k % 60:02d}" if k % 9 else "#########" for k in range(1, 600)]
    rows = (
        f"{at},FIC1.PV,5{k % 7}.1" if "Tag" in names else f"{at},5{k % 7}.1,4{k % 5}.1" for k, at in enumerate(stamps)
    )
    content = read("\n".join((names, *rows, "")))
    assert content.loops["FIC1"].samples == 599 - 66
    assert content.rejects.counts["bad_time"] == 66


@pytest.mark.parametrize("names", ["Time,FIC1.PV,FIC1.OP", "Time,Tag,Value"])
@pytest.mark.parametrize("empty", ["", ",,"])
def test_lines_drawn_of_signs_are_comments(read: Read, names: str, empty: str) -> None:
    rows = [f"2026-03-01 00:{k // 60:02d}:{k % 60:02d},{'FIC1.PV' if 'Tag' in names else 50},{k}" for k in range(600)]
    drawn = [f"##########{empty}", f"# checked{empty}", f"##########{empty}"]
    content = read("\n".join((names, *rows[:500], *drawn, *rows[500:], "")))
    assert content.rejects.total == 0
    assert content.loops["FIC1"].samples == 600
    assert "3 lines that begin with *, # or [ were passed over as comments" in content.summary.notes
