"""Rows whose time their tags had already are counted and told, whether they say the same or not."""

import numpy as np

from app.ingest.rejecting import RejectLog
from app.ingest.times.order import last_of_repeats
from tests.ingest.conftest import Read

TOLD = "rows have the time of a row before; of each tag the last value of a time was taken"


def test_rows_that_are_all_the_same_are_told(read: Read) -> None:
    content = read("time,PV,OP\n" + "2026-01-31 00:00:00,1,2\n" * 1000)
    assert (content.summary.rows_kept, content.loops["export"].samples, content.rejects.total) == (1000, 1, 0)
    assert f"999 {TOLD}" in content.summary.notes


def test_rows_that_repeat_with_other_values_are_refused_and_told(read: Read) -> None:
    minutes = [f"2026-01-31 00:{k:02d}:00" for k in range(30)]
    rows = [f"{minute},{k},5\n" for k, minute in enumerate(minutes)]
    rows[20:20] = [f"{minutes[3]},70,5\n", f"{minutes[7]},70,5\n", f"{minutes[7]},80,5\n"]
    wide = read("time,PV,OP\n" + "".join(rows))
    long = read("tag,time,value\n" + "".join(f"F1.PV,{row.rsplit(',', 1)[0]}\n" for row in rows))
    for content in (wide, long):
        assert dict(content.rejects.counts) == {"duplicate_time": 3}
        assert f"3 {TOLD}" in content.summary.notes


def test_a_file_without_repeats_tells_of_none(read: Read) -> None:
    content = read("time,PV,OP\n" + "".join(f"2026-01-31 00:{k:02d}:00,1,2\n" for k in range(30)))
    assert content.summary.notes == ()


def test_of_each_tag_the_last_value_of_a_time_is_kept() -> None:
    nan = np.nan
    matrix = np.array([[1, nan, 1], [nan, nan, 2], [nan, 5, nan], [2, 6, 3], [nan, 7, nan], [nan, nan, nan]])
    time_ns = np.array([0, 0, 0, 10, 10, 20])
    log = RejectLog(9)
    once, merged = last_of_repeats(time_ns, matrix, np.arange(6), ["A", "B", "C"], log)
    assert once.tolist() == [0, 10, 20]
    np.testing.assert_array_equal(merged, [[1, 5, 2], [2, 7, 3], [nan, nan, nan]])
    assert [(reject.tag, reject.line) for reject in log.result().listed] == [("C", 0), ("B", 3)]
