"""Rows whose time their tags had already are counted and told, whether they say the same or not."""

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
