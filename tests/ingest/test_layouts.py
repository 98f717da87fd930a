"""Every layout that historians send, in small files of our own in those forms."""

import gzip

import numpy as np
import pytest

from app.errors import DataError
from app.ingest import IngestOptions, TagMapping, Unpacking
from app.ingest.tags.grouping import place

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


@pytest.mark.parametrize("beside", ["2024/03/15", "06:00:00"])
def test_names_may_have_the_date_of_the_report_beside_them(read: Read, beside: str) -> None:
    content = read(f"Moment,A.PV,A.OP,{beside}\n2024-03-01 00:00:00,1,2,\n2024-03-01 00:01:00,5,6,\n")
    assert content.loops["A"].op.tolist() == [2, 6]


@pytest.mark.parametrize("title", ["Start,2024-03-01 00:00:00\nInterval,10 s\n", "Server,PISRV,,,\nUser,joe,,,"])
@pytest.mark.parametrize("first", ["Tag", "", "Point"])
def test_tags_below_a_title_that_has_fewer_cells(read: Read, title: str, first: str) -> None:
    names = f"{first},F1.PV,F1.OP,F2.PV,F2.OP\nDescriptor,Flow,Valve,Level,Valve\nEngUnits,m3/h,%,m,%"
    content = read(f"{title}\n{names}\n2024-03-01 00:00:00,1,2,3,4\n2024-03-01 00:01:00,5,6,7,8\n")
    assert {name: loop.op.tolist() for name, loop in content.loops.items()} == {"F1": [2, 6], "F2": [4, 8]}


@pytest.mark.parametrize("title", ["Tags,4", "Rate,100,ms", "400,4"])
@pytest.mark.parametrize("names", ["No,Date,Time,A.PV,A.OP", "Tag,,,A,\nNo,Date,Time,PV,OP"])
def test_a_number_above_the_names_is_no_time(read: Read, title: str, names: str) -> None:
    rows = "".join(f"{k},03/15/2024,06:00:{k},{k}.5,50\n" for k in range(10, 30))
    content = read(f'{title}\nStart,"2024-03-15"\n{names}\n{rows}', name="A.csv")
    assert content.loops["A"].pv.tolist() == [k + 0.5 for k in range(10, 30)]
    assert content.summary.rows_kept == 20


@pytest.mark.parametrize("above", ["", "Time,1,2\n"])
@pytest.mark.parametrize("tags", ["", "FIC101,FIC101,FIC101\n"])
def test_rows_of_data_above_the_names_are_no_title(read: Read, above: str, tags: str) -> None:
    """They would be left out, and nothing tell it."""
    rows = [f"2024-03-01 00:00:{k},{k}.5,50\n" for k in range(10, 40)]
    with pytest.raises(DataError, match="below the names"):
        read(f"{above}{''.join(rows[:10])}{tags}Time,PV,OP\n{''.join(rows[10:])}")


def test_descriptions_that_commas_part_are_no_names(read: Read) -> None:
    heading = "Tag,7-FLOW,7-VALVE,7-SET\nDescription,Flow PV, main,Valve OP, west,Set point SP, main"
    content = read(f"{heading}\n2024-03-01 00:00:00,1,2,3\n2024-03-01 00:01:00,5,6,7\n")
    assert list(content.loops) == ["7-FLOW", "7-VALVE", "7-SET"]


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


def test_wide_with_a_quality_beside_each_signal(read: Read) -> None:
    content = read(QUALITIES)
    assert list(content.loops) == ["A"]
    loop = content.loops["A"]
    assert not loop.others
    np.testing.assert_array_equal(loop.pv, [1, np.nan, 3])
    np.testing.assert_array_equal(loop.op, [10, np.nan, 30])
    assert dict(content.rejects.counts) == {"bad_quality": 2}


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


LVM = """LabVIEW Measurement\t
Writer_Version\t2
Reader_Version\t2
Separator\tTab
Decimal_Separator\t.
Time_Pref\tRelative
Operator\tsomebody
Date\t2026/03/01
Time\t06:00:00.0000000
***End_of_Header***\t
\t\t\t\t
Channels\t{count}{empty}
Samples{samples}
Date{date}
Time{clock}
X_Dimension{dimension}
X0{first}
Delta_X{step}
***End_of_Header***{empty}
X_Value{names}\tComment
"""


@pytest.mark.parametrize("names", [("PV", "OP"), ("PV", "OP", "SP")])
def test_labview(read: Read, names: tuple[str, ...]) -> None:
    each = {
        "samples": "40",
        "date": "2026/03/01",
        "clock": "06:00:00",
        "dimension": "Time",
        "first": "0.0",
        "step": "2.0",
    }
    above = {word: f"\t{text}" * len(names) + "\t" for word, text in each.items()}
    heading = LVM.format(count=len(names), empty="\t" * len(names), names="\t" + "\t".join(names), **above)
    rows = "".join(f"{2 * k}.000000" + f"\t{k % 7}.250000" * len(names) + "\n" for k in range(40))
    content = read(heading + rows, name="F1.lvm")
    assert content.loops["F1"].op.tolist() == [k % 7 + 0.25 for k in range(40)]
    assert np.unique(np.diff(content.loops["F1"].time_ns)).tolist() == [2_000_000_000]
    assert content.rejects.total == 0
