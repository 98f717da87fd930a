"""Every layout that historians send, in small files of our own in those forms."""

import gzip

import numpy as np
import polars as pl
import pytest

from app.errors import DataError
from app.ingest import IngestOptions, TagMapping, Unpacking
from app.ingest.tags.grouping import place
from app.ingest.times.stamps import NO_TIME, TimeForm, TimeReader

from .conftest import Read

MINUTE = 60 * 10**9
START = np.datetime64("2024-03-01T00:00:00", "ns").astype(np.int64)


def test_wide(read: Read) -> None:
    content = read(
        "DateTime,FIC101.PV,FIC101.OP,FIC101.SP,FIC101.MODE,FIC102.PV\n"
        "2024-03-01 00:00:00,51.27,40.5,51,AUTO,3\n"
        "2024-03-01 00:01:00,51.30,40.6,51,MAN,\n"
        "2024-03-01 00:02:00,51.31,40.7,,CAS,5\n"
    )
    loop = content.loops["FIC101"]
    assert loop.time_ns.tolist() == [START, START + MINUTE, START + 2 * MINUTE]
    assert loop.pv.tolist() == [51.27, 51.30, 51.31]
    assert loop.op.tolist() == [40.5, 40.6, 40.7]
    np.testing.assert_array_equal(loop.sp, [51, 51, np.nan])
    assert loop.automatic.tolist() == [1, 0, 1]
    np.testing.assert_array_equal(content.loops["FIC102"].pv, [3, np.nan, 5])
    assert content.summary.layout == "wide"
    assert content.summary.values_kept == 13
    assert content.rejects.total == 0


@pytest.mark.parametrize("title", ["Plant 7, night shift", "Report,2024-03-01", "Server: a,User: b,Period: c"])
def test_a_title_with_a_comma_is_not_the_names(read: Read, title: str) -> None:
    content = read(f"{title}\n\ntime,A.PV,A.OP,B.PV,B.OP\n2024-03-01 00:00:00,1,2,3,4\n2024-03-01 00:01:00,5,6,7,8\n")
    assert {name: loop.op.tolist() for name, loop in content.loops.items()} == {"A": [2, 6], "B": [4, 8]}


@pytest.mark.parametrize(
    "heading",
    [
        ",A.PV,A.OP,A.SP\nTime,Flow,Valve,Set",
        'Time,A.PV,A.OP,\n"Time (UTC)",Flow,Valve,comment',
        "time,PV,OP,\ns,bar,%,date",
    ],
)
def test_a_row_of_descriptions_or_units_is_not_the_names(read: Read, heading: str) -> None:
    """Though it is wider than the row of names and tells a time too."""
    content = read(f"{heading}\n2024-03-01 00:00:00,1,2,3\n2024-03-01 00:01:00,5,6,7\n", name="A.csv")
    assert {name: (loop.pv.tolist(), loop.op.tolist()) for name, loop in content.loops.items()} == {
        "A": ([1, 5], [2, 6])
    }


@pytest.mark.parametrize("title", ['"Report of unit 5', 'Flow, 3" line', '"a\n\n"b "c', '"a" b"\nmore, "text'])
@pytest.mark.parametrize(
    "names", ["time,A.PV,A.OP", 'time,"A.PV","A.OP"', 'time,"A\nPV","A.OP"', '"time","A.PV","A\nOP"']
)
def test_names_below_a_title_that_leaves_a_quote_open(read: Read, title: str, names: str) -> None:
    content = read(f"{title}\n{names}\n" + "".join(f"2024-03-01 00:{k:02d}:00,{k},5\n" for k in range(20)))
    ((name, loop),) = content.loops.items()
    assert (name, loop.pv.tolist(), loop.op.tolist()) == ("A", list(range(20)), [5] * 20)


@pytest.mark.parametrize("title", ['Flow, 3" line, "Unit 5"', "Unit,5,night"])
def test_a_title_as_wide_as_the_names_is_not_the_names(read: Read, title: str) -> None:
    content = read(f"{title}\ntime,A.PV,A.OP\n2024-03-01 00:00:00,1,2\n2024-03-01 00:01:00,5,6\n")
    assert {name: loop.op.tolist() for name, loop in content.loops.items()} == {"A": [2, 6]}


def test_long_with_quality_below_a_preamble_and_comments(read: Read) -> None:
    content = read(
        "* exported by hand\n[Data]\nTagname,TimeStamp,Value,DataQuality\n"
        "TIGER.FIC101.PV,7/20/01 11:07,1,Good\nTIGER.FIC101.OP,7/20/01 11:07,40,Good\n"
        "* between\nTIGER.FIC101.PV,7/20/01 11:08,2,Bad\nTIGER.FIC101.OP,7/20/01 11:08,41,Good\n"
    )
    assert [loop.loop for loop in content.summary.loops] == ["TIGER.FIC101"]
    loop = content.loops["TIGER.FIC101"]
    np.testing.assert_array_equal(loop.pv, [1, np.nan])
    assert loop.op.tolist() == [40, 41]
    assert loop.time_ns[0] == np.datetime64("2001-07-20T11:07", "ns").astype(np.int64)
    assert dict(content.rejects.counts) == {"bad_quality": 1}
    assert content.rejects.listed[0].line == 7


@pytest.mark.parametrize("lines", [0, 29, 38])
def test_names_stand_below_a_preamble(read: Read, lines: int) -> None:
    preamble = "".join(f"Line {k} of a report\n" for k in range(lines))
    wide = preamble + "Time;A.PV;A.OP\n" + "".join(f"2024-03-01 00:{k:02d}:00;{k},5;40\n" for k in range(40))
    long = preamble + "Time;Tag;Value\n" + "".join(f"2024-03-01 00:{k:02d}:00;A.PV;{k},5\n" for k in range(40))
    assert [read(table).loops["A"].pv[-1] for table in (wide, long)] == [39.5, 39.5]


def test_a_tag_may_begin_as_a_comment_does(read: Read) -> None:
    content = read(
        "[Data]\nTagname,TimeStamp,Value\n[PLC1]FIC1.PV,soon,1\n# by hand\n"
        "[PLC1]FIC1.PV,2024-03-01 00:00:00,2\n[PLC1]FIC1.OP,2024-03-01 00:00:00,3\n"
    )
    assert [loop.loop for loop in content.summary.loops] == ["[PLC1]FIC1"]
    assert content.loops["[PLC1]FIC1"].pv.tolist() == [2]


def test_long_without_names_in_seconds_and_nanoseconds(read: Read) -> None:
    content = read(
        "1601890328:76000000,FIC101.PV,51.27,float,GOOD\n1601890328:76000000,FIC101.OP,40.1,float,GOOD\n"
        "1601890329:76000000,FIC101.PV,51.29,float,GOOD\n1601890329:76000000,FIC101.OP,40.2,float,BAD\n"
    )
    loop = content.loops["FIC101"]
    assert loop.time_ns.tolist() == [1601890328076000000, 1601890329076000000]
    assert loop.pv.tolist() == [51.27, 51.29]
    np.testing.assert_array_equal(loop.op, [40.1, np.nan])


def test_aveva_zero_is_good_and_so_is_192(read: Read) -> None:
    content = read(
        "DateTime,TagName,Value,vValue,Quality,QualityDetail,OPCQuality,wwTagKey\n"
        "2024-03-01 00:00:00.0000000,FIC101.PV,51.27,51.27,0,192,192,1\n"
        "2024-03-01 00:00:00.0000000,FIC101.OP,40,40,0,192,192,2\n"
        "2024-03-01 00:01:00.0000000,FIC101.PV,0,0,1,24,0,1\n"
        "2024-03-01 00:01:00.0000000,FIC101.OP,41,41,0,192,192,2\n"
    )
    assert content.summary.layout == "aveva"
    np.testing.assert_array_equal(content.loops["FIC101"].pv, [51.27, np.nan])
    assert content.loops["FIC101"].op.tolist() == [40, 41]


def test_pi_a_file_a_tag_with_state_words(read: Read) -> None:
    content = read(
        "2019-05-15T00:00:00.0000000Z,12.34\n2019-05-15T00:00:10.0000000Z,Bad Input\n"
        "2019-05-15T00:00:20.0000000Z,12.36\n",
        name="FIC101.PV.csv",
    )
    loop = content.loops["FIC101"]
    assert loop.time_ns[0] == np.datetime64("2019-05-15T00:00:00", "ns").astype(np.int64)
    np.testing.assert_array_equal(loop.pv, [12.34, np.nan, 12.36])
    reject = content.rejects.listed[0]
    assert (reject.line, reject.code, reject.text, reject.tag) == (2, "not_a_number", "Bad Input", "FIC101.PV")


def test_pi_datalink_pairs_at_their_own_times(read: Read) -> None:
    text = "FIC101.PV,,FIC101.OP,,FIC101.SP,\n" + "".join(
        f"01-Mar-24 00:0{i}:00,{50 + i},01-Mar-24 00:0{i}:30,{40 + i},{'01-Mar-24 00:00:00,50' if i == 0 else ','}\n"
        for i in range(6)
    )
    content = read(text.encode("utf-16"))
    loop = content.loops["FIC101"]
    assert content.summary.layout == "pi_datalink"
    assert content.summary.encoding == "utf-16"
    assert loop.pv.tolist() == [50, 51, 52, 53, 54, 55]
    np.testing.assert_allclose(loop.op, [np.nan, 40.5, 41.5, 42.5, 43.5, 44.5])
    assert loop.sp.tolist() == [50] * 6
    assert set(loop.resampled) == {"OP", "SP"}


def test_sql_dump_newest_first_with_date_and_time_apart(read: Read) -> None:
    content = read(
        b"\xef\xbb\xbfid,date,time,FT_211,FV_211\n"
        b"3,2024-03-01,00:02:00,12,42\n2,2024-03-01,00:01:00,11,41\n1,2024-03-01,00:00:00,10,40\n"
    )
    loop = content.loops["F_211"]
    assert loop.pv.tolist() == [10, 11, 12]
    assert loop.op.tolist() == [40, 41, 42]
    assert loop.time_ns[0] == START
    assert any("sorted" in note for note in content.summary.notes)


def test_ignition(read: Read) -> None:
    content = read(
        '"#NAMES"\n"t_stamp","FIC101/PV","FIC101/OP"\n"#TYPES"\n"date","D","D"\n"#ROWS","2"\n'
        '"2024-03-01 00:00:00","1.5","40"\n"2024-03-01 00:01:00","1.6","41"\n'
    )
    assert content.summary.layout == "ignition"
    assert content.loops["FIC101"].pv.tolist() == [1.5, 1.6]
    assert content.loops["FIC101"].op.tolist() == [40, 41]


def test_trendminer(read: Read) -> None:
    content = read(
        "Name,FIC101.PV,FIC101.OP\nDescription,flow to column,valve\nUnit,t/h,%\nType,ANALOG,ANALOG\n"
        "2024-03-01T01:00:00+01:00,1.5,40\n2024-03-01T01:01:00+01:00,1.6,41\n"
    )
    assert content.summary.layout == "trendminer"
    assert content.summary.time_zone == "in the file"
    assert content.loops["FIC101"].time_ns.tolist() == [START, START + MINUTE]


def test_semicolons_and_decimal_commas(read: Read) -> None:
    content = read("Zeit;FIC101.PV;FIC101.OP\n08.06.2000 12:13:04;51,27;48,9\n08.06.2000 12:13:05;51,28;49\n")
    assert (content.summary.delimiter, content.summary.decimal_mark) == (";", ",")
    assert content.loops["FIC101"].pv.tolist() == [51.27, 51.28]
    assert content.loops["FIC101"].time_ns[0] == np.datetime64("2000-06-08T12:13:04", "ns").astype(np.int64)


def test_semicolons_without_names_are_refused_with_a_reason(read: Read) -> None:
    from app.errors import DataError

    with pytest.raises(DataError) as refused:
        read("08.06.2000 12:13:04;51,27;48,9\n08.06.2000 12:13:05;51,28;49,0\n")
    assert refused.value.code == "unknown_layout"


DCS_TAB = (
    "PROCESSDATA\tFIC7 Data\tyyyy-MM-dd HH:mm:ss\r\n8\t10\t2024-03-01 00:00:00\t3\r\n"
    "tagname\tFIC7.MV\tFIC7.PV\tFIC7.SV\tFIC7.MODE\tbOpOFL\tbPvOFL\tbSpOFL\tbAutOFL\r\n"
    "desc\t塔_OP\t塔_PV\t塔_SP\tAut\tbOpOFL\tbPvOFL\tbSpOFL\tbAutOFL\r\nfsMax=1\tfsMin=0\tL=24\r\n"
    "2024-03-01 00:00:00\t72.3\t973.6\t970\t1\t0\t0\t0\t0\r\n"
    "2024-03-01 00:00:10\t72.1\t974.0\t970\t1\t0\t1\t0\t0\r\n"
    "2024-03-01 00:00:20\t72.0\t974.4\t970\t0\t0\t0\t0\t0\r\n"
)


@pytest.mark.parametrize("encoding", ["utf-8", "gb18030", "utf-16"])
def test_dcs_tab_with_off_line_flags(read: Read, encoding: str) -> None:
    content = read(DCS_TAB.encode(encoding), name="dcs.txt")
    loop = content.loops["FIC7"]
    assert content.summary.layout == "dcs_tab"
    assert loop.op.tolist() == [72.3, 72.1, 72.0]
    np.testing.assert_array_equal(loop.pv, [973.6, np.nan, 974.4])
    assert loop.automatic.tolist() == [1, 1, 0]
    assert [(reject.line, reject.code, reject.tag) for reject in content.rejects.listed] == [(7, "off_line", "FIC7.PV")]


def test_gzip_gives_the_same_as_the_text(read: Read) -> None:
    packed = gzip.compress(DCS_TAB[:300].encode()) + gzip.compress(DCS_TAB[300:].encode())
    content = read(packed, name="dcs.txt.gz")
    assert content.summary.compressed
    assert content.loops["FIC7"].op.tolist() == [72.3, 72.1, 72.0]


@pytest.mark.parametrize("first_bytes", [1, 2, 300])
def test_members_of_gzip_are_unpacked_wherever_the_pieces_part(first_bytes: int) -> None:
    first, second = (gzip.compress(half.encode()) for half in (DCS_TAB[:300], DCS_TAB[300:]))
    unpacking = Unpacking(IngestOptions())
    at = len(first) + first_bytes - 1  # 1: between them, 2: within the two bytes by which the second one is told
    pieces = [(first + second)[:at], (first + second)[at:]]
    assert b"".join(out for piece in pieces for out in unpacking.steps(piece)).decode() == DCS_TAB
    assert unpacking.is_whole
    assert not list(unpacking.steps(bytes(7)))
    assert (unpacking.complete, unpacking.is_whole) == (True, False)


def test_recording_in_seconds_is_anchored_so_that_sending_again_gives_the_same(read: Read) -> None:
    text = "time,SP,PV,OP\n0,50,51.5,40\n0.2,50,51.6,41\n0.4,,51.7,42\n"
    content = read(text, name="CHEM99.csv")
    loop = content.loops["CHEM99"]
    assert loop.time_ns.tolist() == [0, 200_000_000, 400_000_000]
    np.testing.assert_array_equal(loop.sp, [50, 50, np.nan])
    moved = read(text, name="CHEM99.csv", options=IngestOptions(start_ns=int(START)))
    assert moved.loops["CHEM99"].time_ns[0] == START


def test_rows_that_were_sent_twice_are_no_cut_stamps(read: Read) -> None:
    rows = [f"2024-01-01 00:{k // 60:02d}:{k % 60:02d},{50 + k % 7},{40 + k % 11}" for k in range(200)]
    content = read("\n".join(["time,FIC1.PV,FIC1.OP", *(row for row in rows for _ in range(2))]))
    assert not any("spread" in note for note in content.summary.notes)
    np.testing.assert_array_equal(np.diff(content.loops["FIC1"].time_ns), np.full(199, 10**9))


def test_minute_stamps_are_spread_by_the_order_of_rows(read: Read) -> None:
    rows = [f"13/07/24 0:{44 + (i + 20) // 60},6.5,{6 + i / 1000},25" for i in range(200)]
    content = read("Time,SP,PV,OP\n" + "\n".join(rows) + "\n", name="flow.csv")
    loop = content.loops["flow"]
    assert len(loop.time_ns) == 200
    np.testing.assert_array_equal(np.diff(loop.time_ns), 10**9)
    assert loop.time_ns[0] == np.datetime64("2024-07-13T00:44:20", "ns").astype(np.int64)
    assert any("spread" in note for note in content.summary.notes)
    assert any(note.startswith("dates were read day first") for note in content.summary.notes)


def test_day_and_month_are_told_apart_by_the_rows(read: Read) -> None:
    days = [f"0{day}/03/2024 00:00,1,2" for day in range(1, 8)]
    content = read("Time,A.PV,A.OP\n" + "\n".join(days) + "\n")
    steps = np.diff(content.loops["A"].time_ns)
    np.testing.assert_array_equal(steps, 86400 * 10**9)
    american = read("Time,A.PV,A.OP\n03/13/2024 00:00,1,2\n03/14/2024 00:00,1,2\n")
    assert american.loops["A"].time_ns[0] == np.datetime64("2024-03-13", "ns").astype(np.int64)


def test_what_the_first_day_leaves_open_the_last_one_tells(read: Read) -> None:
    stamps = [f"03/{1 + i // 1440:02d}/2024 {i // 60 % 24:02d}:{i % 60:02d}:00" for i in range(20 * 1440)]
    loop = read("Time,A.PV,A.OP\n" + "".join(f"{stamp},1.5,2.5\n" for stamp in stamps)).loops["A"]
    assert loop.time_ns[0] == START
    np.testing.assert_array_equal(np.diff(loop.time_ns), MINUTE)


def test_local_time_through_the_doubled_hour(read: Read) -> None:
    rows = "2024-10-27 01:30:00,1,1\n2024-10-27 02:30:00,2,2\n2024-10-27 02:30:00,3,3\n2024-10-27 03:30:00,4,4\n"
    half = "2024-10-27 02:00:00,1,1\n2024-10-27 02:30:00,2,2\n2024-10-27 02:00:00,3,3\n2024-10-27 02:30:00,4,4\n"
    options = IngestOptions(time_zone="Europe/Berlin")
    loop = read("Time,A.PV,A.OP\n" + half, options=options).loops["A"]
    assert np.diff(loop.time_ns).tolist() == [1800 * 10**9] * 3
    assert loop.time_ns[0] == np.datetime64("2024-10-27T00:00", "ns").astype(np.int64)
    assert read("Time,A.PV,A.OP\n" + rows, options=options).loops["A"].pv.tolist()[0] == 1


@pytest.mark.parametrize(
    ("stamp", "seconds"),
    [
        ("1709251200", 1709251200.0),
        ("1709251200000", 1709251200.0),
        ("1709251200000000000", 1709251200.0),
        ("2024-03-01T00:00:00Z", 1709251200.0),
        ("01.03.2024 00:00", 1709251200.0),
        ("1-Mar-24 00:00:00.5", 1709251200.5),
        ("3/1/2024 12:00:00 AM", 1709251200.0),
        ("20240301000000", 1709251200.0),
        ("2024/03/01 00:00:00.250", 1709251200.25),
        ("2024-03-01 02:00:00+02:00", 1709251200.0),
    ],
)
def test_forms_of_time(read: Read, stamp: str, seconds: float) -> None:
    loop = read(f"Time,A.PV,A.OP\n{stamp},1,2\n").loops["A"]
    assert loop.time_ns.tolist() == [round(seconds * 1000) * 10**6]


PAIRS = "".join(f"01-Mar-24 00:0{i}:00,{50 + i},01-Mar-24 00:0{i}:30,{40 + i}\n" for i in range(6))


def test_pi_datalink_pairs_without_names_are_numbered(read: Read) -> None:
    for names in ("", "time,value,time,value\n"):
        assert list(read(names + PAIRS, name="unit1.csv").loops) == ["unit1.1", "unit1.2"]
    named = read("time,value,time,value\n,A.PV,,A.OP\n" + PAIRS, name="unit1.csv")
    assert named.loops["A"].pv.tolist() == [50, 51, 52, 53, 54, 55]


def test_signals_of_different_days_are_not_brought_together(read: Read) -> None:
    apart = "".join(f"01-Mar-24 00:0{i}:00,{50 + i},02-Mar-24 00:0{i}:00,{40 + i}\n" for i in range(6))
    loop = read("A.PV,,A.OP,\n" + apart).loops["A"]
    assert loop.resampled == ()
    np.testing.assert_array_equal(loop.pv, [50, 51, 52, 53, 54, 55, *[np.nan] * 6])
    np.testing.assert_array_equal(loop.op, [*[np.nan] * 6, 40, 41, 42, 43, 44, 45])


def test_signals_at_their_own_times_without_a_value_stay_empty(read: Read) -> None:
    rows = "".join(f"A.PV,2024-03-01 00:0{i}:00,{i},Good\nA.OP,2024-03-01 00:0{i}:30,{i},Bad\n" for i in range(6))
    content = read("Tagname,TimeStamp,Value,DataQuality\n" + rows + "A.SP,2024-03-01 00:00:30,5,Bad\n")
    loop = content.loops["A"]
    assert loop.pv.tolist() == [0, 1, 2, 3, 4, 5]
    assert np.isnan(loop.op).all()
    assert np.isnan(loop.sp).all()
    assert dict(content.rejects.counts) == {"bad_quality": 7}


QUALITIES = (
    "time,A.PV,A.PV_Quality,A.OP,A.OP Status\n2024-03-01 00:00:00,1,Good,10,192\n"
    '2024-03-01 00:01:00,2,Bad,20,0\n2024-03-01 00:02:00,3,Uncertain,30,"  "\n'
)


@pytest.mark.parametrize("drop", [False, True])
def test_wide_with_a_quality_beside_each_signal(read: Read, drop: bool) -> None:
    content = read(QUALITIES, options=IngestOptions(drop_uncertain=drop))
    assert list(content.loops) == ["A"]
    loop = content.loops["A"]
    assert not loop.others
    np.testing.assert_array_equal(loop.pv, [1, np.nan, np.nan if drop else 3])
    np.testing.assert_array_equal(loop.op, [10, np.nan, 30])
    assert dict(content.rejects.counts) == {"bad_quality": 3 if drop else 2}


def test_aveva_without_opc_counts_from_zero_is_good(read: Read) -> None:
    rows = "".join(f"2024-03-01 00:0{i}:00,A.PV,{i},{i},{quality},1\n" for i, quality in enumerate((0, 1, 133, 0)))
    content = read("DateTime,TagName,Value,vValue,Quality,wwTagKey\n" + rows)
    np.testing.assert_array_equal(content.loops["A"].pv, [0, np.nan, np.nan, 3])
    assert dict(content.rejects.counts) == {"bad_quality": 2}


def test_a_second_tag_of_one_signal_is_kept_beside_it_and_told(read: Read) -> None:
    content = read("time,A.PV,A.MEAS\n2024-03-01 00:00:00,1,10\n2024-03-01 00:01:00,2,20\n")
    assert content.loops["A"].others["A.MEAS"].tolist() == [10, 20]
    assert any("A.MEAS" in note and "already" in note for note in content.summary.notes)


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_utf16_without_a_mark(read: Read, encoding: str) -> None:
    content = read("time,A.PV,A.OP\n2024-03-01 00:00:00,1,10\n".encode(encoding))
    assert content.summary.encoding == encoding
    assert content.loops["A"].op.tolist() == [10]


MINUTES = [f"13/07/24 0:{44 + i // 60},6.5,{i},25\n" for i in range(600)]


def test_minute_stamps_are_spread_across_chunks(read: Read) -> None:
    whole, parts = (
        read("Time,SP,PV,OP\n" + "".join(MINUTES), options=IngestOptions(chunk_bytes=size)).loops["export"]
        for size in (1 << 20, 4000)
    )
    np.testing.assert_array_equal(np.diff(parts.time_ns), 10**9)
    np.testing.assert_array_equal(parts.time_ns, whole.time_ns)
    assert parts.pv.tolist() == list(range(600))


def test_minute_stamps_that_go_back_are_sorted(read: Read) -> None:
    content = read("Time,SP,PV,OP\n" + "".join(MINUTES) + "13/07/24 0:44,6.5,99,25\n")
    loop = content.loops["export"]
    assert loop.samples == 600
    assert loop.pv[0] == 99
    assert dict(content.rejects.counts) == {"duplicate_time": 1}
    assert any("sorted" in note for note in content.summary.notes)


def test_days_since_1900(read: Read) -> None:
    rows = "".join(f"{45352 + i / 1440:.8f},{i},1\n" for i in range(4))
    loop = read("Date,A.PV,A.OP\n" + rows).loops["A"]
    np.testing.assert_allclose(loop.time_ns - START, MINUTE * np.arange(4), atol=10**6)


def test_days_since_1900_under_the_name_of_a_time(read: Read) -> None:
    rows = "".join(f"{45352 + i / 8640:.10f},{i},1\n" for i in range(4))
    content = read("time,A.PV,A.OP\n" + rows)
    np.testing.assert_allclose(content.loops["A"].time_ns - START, MINUTE // 6 * np.arange(4), atol=10**6)
    assert content.summary.notes == ("times are days since 1899-12-30, as spreadsheets count them",)


@pytest.mark.parametrize("name", ["Time [s]", "time_s", "Time (sec)", "seconds", "Timestamp [s]"])
def test_seconds_by_their_name_are_no_days(read: Read, name: str) -> None:
    content = read(f"{name},A.PV,A.OP\n" + "".join(f"{30000 + i / 100:.2f},{i},1\n" for i in range(9)))
    np.testing.assert_allclose(np.diff(content.loops["A"].time_ns), 10**7, atol=1000)


@pytest.mark.parametrize("name", ["time_s", "time"])
def test_stamps_that_come_once_a_tag_are_no_days(read: Read, name: str) -> None:
    rows = "".join(f"{30000.5 + i},A.{signal},{i}\n" for i in range(9) for signal in ("PV", "OP", "SP"))
    loop = read(f"{name},tag,value\n" + rows).loops["A"]
    assert np.diff(loop.time_ns).tolist() == [10**9] * 8


@pytest.mark.parametrize(("unit", "nanoseconds"), [("ms", 10**6), ("min", MINUTE), ("h", 60 * MINUTE), ("us", 1000)])
def test_relative_times_in_the_unit_of_their_name(read: Read, unit: str, nanoseconds: int) -> None:
    content = read(f"Time [{unit}],A.PV,A.OP\n0,1,2\n1,2,3\n2,3,4\n")
    assert np.diff(content.loops["A"].time_ns).tolist() == [nanoseconds] * 2
    assert any(f"times are in {unit}" in note for note in content.summary.notes)


@pytest.mark.parametrize(("day_first", "days_apart"), [(True, 1), (False, 31)])
def test_the_order_of_day_and_month_can_be_said(read: Read, day_first: bool, days_apart: int) -> None:
    text = "Time,A.PV,A.OP\n03/04/2024 00:00,1,10\n04/04/2024 00:00,2,20\n"
    content = read(text, options=IngestOptions(day_first=day_first))
    assert np.diff(content.loops["A"].time_ns).tolist() == [days_apart * 1440 * MINUTE]
    assert content.summary.notes == ()


def test_times_that_are_numbers_already() -> None:
    seconds = pl.Series([1709251200.5, None, np.inf], dtype=pl.Float64)
    times_ns = TimeReader(TimeForm("epoch"), IngestOptions()).read(seconds)
    assert times_ns.tolist() == [START + 5 * 10**8, NO_TIME, NO_TIME]


def test_an_offset_among_local_times(read: Read) -> None:
    stamps = ("2024-03-01 00:00:00", "2024-03-01 00:01:00", "2024-03-01 00:02:00+01:00", "2024-02-29 23:03:00Z")
    rows = "".join(f"{stamp},{i},{10 * i}\n" for i, stamp in enumerate(stamps, start=1))
    content = read("Time,A.PV,A.OP\n" + rows, options=IngestOptions(time_zone="Europe/Berlin"))
    assert content.loops["A"].pv.tolist() == [1, 2, 3, 4]
    assert np.diff(content.loops["A"].time_ns).tolist() == [MINUTE] * 3


@pytest.mark.parametrize(
    ("names", "loop"),
    [
        ("塔顶温度,回流阀", "塔顶温度"),
        ("Температура верха,Клапан", "Температура верха"),
        ("塔頂温度,バルブ", "塔頂温度"),
    ],
)
def test_names_of_other_scripts_are_columns(read: Read, names: str, loop: str) -> None:
    text = f"Time,{names}\n" + "".join(f"2024-03-01 00:0{i}:00,{i},1{i}\n" for i in range(9))
    assert list(read(text).loops[loop].others) == [loop]
    pv, op = names.split(",")
    mapping = TagMapping.from_bytes(f"tag,loop,signal\n{pv},F,PV\n{op},F,OP\n".encode())
    content = read(text, mapping=mapping)
    assert content.loops["F"].pv.tolist() == list(range(9))
    assert content.loops["F"].op.tolist() == list(range(10, 19))


def test_names_without_a_letter_are_no_columns(read: Read) -> None:
    text = "Time,A.PV,A.OP,,#,---\n" + "".join(f"2024-03-01 00:0{i}:00,{i},1{i},5,{i},7\n" for i in range(9))
    assert read(text).summary.tags == 2


@pytest.mark.parametrize(
    ("names", "row"),
    [
        ("Path,Timestamp,Value,Good", r"\\AF\Site\CDU\F1|{signal},{time},{value},True"),
        ("Element,Attribute,Timestamp,Value,UOM", r"\\AF\Site\CDU\F1,{signal},{time},{value},m3/h"),
        ("DeviceId,Metric,Timestamp,Value", "F1,{signal},{time},{value}"),
        ("Asset,Attribute,Timestamp,Value,UOM", "Site|CDU|F1,{signal},{time},{value},m3/h"),
    ],
)
def test_elements_and_attributes_of_an_asset_tree(read: Read, names: str, row: str) -> None:
    rows = [
        row.format(signal=signal, time=f"2024-03-01T00:{i:02d}:00.0000000Z", value=i + 0.5)
        for signal in ("PV", "OP")
        for i in range(30)
    ]
    (loop,) = read("\n".join((names, *rows)) + "\n").loops.values()
    assert loop.pv.tolist() == loop.op.tolist() == [i + 0.5 for i in range(30)]


def test_json_is_refused_as_such(read: Read) -> None:
    for text in ('{"ts": "2024-03-01T00:00:00Z", "FIC1.PV": 1.5}\n' * 9, '[\n {"ts": 1, "FIC1.PV": 1.5}]'):
        with pytest.raises(DataError, match="this is JSON"):
            read(text)
    with pytest.raises(DataError, match="this is JSON"):
        read("[[1709251200000, 1.5],\n [1709251201000, 1.6]]")
    for text in ("<html><table><tr><td>Time</td></tr></table></html>", '<?xml version="1.0"?>\n<rows/>'):
        with pytest.raises(DataError, match="this is XML or HTML"):
            read(text)


@pytest.mark.parametrize("name", ["N.F1.PV.F_CV", "N.F1_PV.F_CV", "F1.PV.f_cv"])
def test_the_field_of_ifix_that_has_the_value_is_no_controlled_variable(name: str) -> None:
    assert place(name, "").signal == "PV"


@pytest.mark.parametrize("delimiter", [",", ";"])
def test_the_sign_for_minus_of_the_north(read: Read, delimiter: str) -> None:
    rows = [f"2024-03-01 00:0{i}:00;{i - 4}.5;1{i}".replace("-4", "−4").replace(";-", ";−") for i in range(9)]
    content = read("\n".join(("Time;F1.PV;F1.OP", *rows)).replace(";", delimiter) + "\n")
    assert content.loops["F1"].pv.tolist() == [float(f"{i - 4}.5") for i in range(9)]
    assert content.rejects.total == 0
