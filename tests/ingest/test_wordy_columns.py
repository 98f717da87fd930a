"""A column of words that is no signal is left out with one note; as soon as it has a number, its words are refused."""

import pytest

from app.ingest import IngestOptions
from app.ingest.rejecting import RejectLog
from app.ingest.tables import wordy_columns
from tests.ingest.conftest import Read

SMALL = IngestOptions(chunk_bytes=1000)


def table(remarks: list[str], names: str = "time,PV,OP,remark") -> str:
    return f"{names}\n" + "".join(f"{k},{k % 7},{k % 5},{remark}\n" for k, remark in enumerate(remarks))


@pytest.mark.parametrize("options", [None, SMALL])
def test_a_column_of_remarks_is_left_out_with_one_note(read: Read, options: IngestOptions | None) -> None:
    content = read(table(["ok"] * 150 + [""] * 50), options=options)
    assert (content.rejects.total, content.rejects.listed) == (0, ())
    assert "columns that hold no number were left out: remark" in content.summary.notes
    assert content.summary.rows_kept == 200
    assert dict(content.loops["export"].others) == {}


@pytest.mark.parametrize("options", [None, SMALL])
@pytest.mark.parametrize("at", [0, 100, 199])
def test_words_in_a_column_with_a_number_are_refused(read: Read, options: IngestOptions | None, at: int) -> None:
    remarks = ["ok"] * 200
    remarks[at] = "7.5"
    content = read(table(remarks), options=options)
    assert dict(content.rejects.counts) == {"not_a_number": 199}
    assert [reject.line for reject in content.rejects.listed] == [line for line in range(2, 202) if line != at + 2]
    assert not any("left out" in note for note in content.summary.notes)


def test_a_number_in_a_row_without_a_time_is_none_of_the_column(read: Read) -> None:
    rows = table(["ok"] * 60) + "no time,1,2,3\n" + "".join(f"{k},1,2,ok\n" for k in range(60, 90))
    content = read(rows)
    assert dict(content.rejects.counts) == {"bad_time": 1}
    assert "columns that hold no number were left out: remark" in content.summary.notes


def test_words_in_place_of_a_signal_are_refused(read: Read) -> None:
    content = read("time,FIC1.PV,FIC1.OP\n" + "".join(f"{k},{k % 7},Bad\n" for k in range(60)))
    assert dict(content.rejects.counts) == {"not_a_number": 60}


def test_of_many_columns_of_words_the_first_are_left_out(read: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wordy_columns, "MOST_HELD", 6)
    names = ",".join(f"note {n}" for n in range(8))
    content = read(f"time,PV,OP,{names}\n" + "".join(f"{k},{k % 7},{k % 5}{',ok' * 8}\n" for k in range(60)))
    assert dict(content.rejects.counts) == {"not_a_number": 120}
    shown = ", ".join(f"note {n}" for n in range(5))
    assert f"columns that hold no number were left out: {shown}, ..." in content.summary.notes


def test_what_may_be_a_number_is_refused_and_not_left_out() -> None:
    log = RejectLog(10)
    columns = wordy_columns.WordyColumns(["A", "B"], log)
    columns.log_of("A").add("unclear_mark", "1,005 may have decimals or parted thousands", 2, "A")
    columns.log_of("B").add("not_a_number", "ok", 2, "B")
    assert columns.settle() == ["B"]
    assert dict(log.result().counts) == {"unclear_mark": 1}
