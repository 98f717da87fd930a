"""What plants and attackers send: the good part is kept, the rest is counted with line and reason, and nothing but
DataError is raised."""

import gzip
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from app.errors import DataError
from app.ingest import IngestOptions, TagMapping, read_export
from app.ingest.files import unpacking
from app.ingest.files.unpacking import RATIO_FREE_BYTES, Unpacking

from .conftest import Read

HEADER = "time,A.PV,A.OP\n"
GOOD = "2024-03-01 00:00:00,1,10\n2024-03-01 00:01:00,2,20\n2024-03-01 00:02:00,3,30\n2024-03-01 00:03:00,4,40\n"


def code_of(read: Read, data: bytes | str, **more: object) -> str:
    with pytest.raises(DataError) as refused:
        read(data, **more)
    return refused.value.code


@pytest.mark.parametrize("data", [b"", b"\n\n", b" \n", b"\xef\xbb\xbf"])
def test_nothing_in_it(read: Read, data: bytes) -> None:
    assert code_of(read, data) in ("empty_file", "unknown_layout")


@pytest.mark.parametrize(
    "data", [bytes(range(256)) * 50, b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" * 40, b"\x7fELF" + bytes(4000)]
)
def test_binary(read: Read, data: bytes) -> None:
    assert code_of(read, data) == "not_an_export"


@pytest.mark.parametrize(
    "text",
    [
        "Dear all,\nplease find the file attached.\n",
        "Tagname,TimeStamp,Value\nA.PV,soon,1\nA.OP,later,2\n",
        "date,time,A.PV\n2024-03-01,soon,1\n2024-03-02,later,2\n",
        "time,id\n2024-03-01 00:00:00,1\n2024-03-01 00:01:00,2\n",
        "#NAMES\nt_stamp,A.OP\n#TYPES\nD,D\n#ROWS,2\nsoon,2\n",
        "PROCESSDATA\tFIC7 Data\n8\t10\ntagname\tFIC7.MV\tFIC7.PV\ndesc\ta\tb\nfsMax=1\nsoon\t1\t2\n",
    ],
    ids=[
        "a letter",
        "long without times",
        "a date without its time",
        "no signals",
        "Ignition without times",
        "a loop monitor without times",
    ],
)
def test_text_without_times_or_signals(read: Read, text: str) -> None:
    assert code_of(read, text) == "unknown_layout"


def test_names_without_a_signal_are_not_said_to_lack_a_time(read: Read) -> None:
    with pytest.raises(DataError) as refused:
        read("time,id\n2024-03-01 00:00:00,1\n2024-03-01 00:01:00,2\n")
    assert refused.value.message == (
        "no column of times with signals beside it was found; needed is a row of names with time, PV and OP "
        "(or tags such as FIC101.PV), or rows of tag, time and value"
    )


def test_rows_of_which_none_can_be_used(read: Read) -> None:
    assert code_of(read, "Tagname,TimeStamp,Value\n,2024-03-01 00:00:00,1\n,2024-03-01 00:01:00,2\n") == (
        "nothing_readable"
    )


def test_a_time_zone_that_is_none(read: Read) -> None:
    assert code_of(read, HEADER + GOOD, options=IngestOptions(time_zone="Mars/Base")) == "unknown_time_zone"


def test_an_export_is_read_once(tmp_path: Path) -> None:
    path = tmp_path / "night.csv"
    path.write_text(HEADER + GOOD)
    export = read_export(path)
    assert len(list(export)) == 2
    with pytest.raises(RuntimeError, match="read once"):
        list(export.loops())


def test_odd_values_are_counted_with_their_lines(read: Read) -> None:
    content = read(
        HEADER + "2024-03-01 00:00:00,1,10\n2024-03-01 00:01:00,I/O Timeout,20\n2024-03-01 00:02:00,1e400,30\n"
        "2024-03-01 00:03:00,-9999,40\n2024-03-01 00:04:00,nan,-99.125\nlater,5,50\n9999-12-31 00:00:00,5,50\n"
        "2024-03-01 00:05:00, 6 ,60\n"
    )
    np.testing.assert_array_equal(content.loops["A"].pv, [1, np.nan, np.nan, np.nan, np.nan, 6])
    np.testing.assert_array_equal(content.loops["A"].op, [10, 20, 30, 40, np.nan, 60])
    found = {(reject.line, reject.code) for reject in content.rejects.listed}
    assert found == {
        (3, "not_a_number"), (4, "not_finite"), (5, "sentinel"), (6, "not_finite"), (6, "sentinel"), (7, "bad_time"),
        (8, "bad_time"),
    }  # fmt: skip
    assert [reject.line for reject in content.rejects.listed] == [3, 4, 5, 6, 6, 7, 8]
    assert content.rejects.total == 7


def test_a_value_among_its_like_is_no_sentinel(read: Read) -> None:
    content = read(
        HEADER + "2024-03-01 00:00:00,-9998,10\n2024-03-01 00:01:00,-9999,20\n2024-03-01 00:02:00,-10000,30\n"
    )
    assert content.loops["A"].pv.tolist() == [-9998, -9999, -10000]


def test_ragged_and_unquoted_rows(read: Read) -> None:
    content = read(
        HEADER
        + GOOD
        + '2024-03-01 00:04:00,5,50,7\n2024-03-01 00:05:00,"6,60\n2024-03-01 00:06:00,7\n2024-03-01 00:07:00,8,80\n'
    )
    assert content.loops["A"].pv.tolist() == [1, 2, 3, 4, 8]
    assert dict(content.rejects.counts) == {"ragged_row": 2, "unbalanced_quote": 1}
    assert {reject.line for reject in content.rejects.listed} == {6, 7, 8}


def test_a_line_without_an_end(read: Read) -> None:
    options = IngestOptions(max_line_bytes=1000, chunk_bytes=500)
    assert code_of(read, HEADER + GOOD + "x" * 3000, options=options) == "line_too_long"


@pytest.mark.parametrize(
    "text",
    [
        "id,date,time,A.PV,A.OP\n1,2024-03-01,00:00:00,1,10\n2\n3,2024-03-01,00:02:00,3,30\n\n# shift\n",
        "id,TagName,DateTime,Value\n1,A.PV,2024-03-01 00:00:00,1\n2\n3,A.PV,2024-03-01 00:02:00,3\n\n# shift\n",
    ],
    ids=["wide", "long"],
)
def test_a_row_cut_before_its_time_is_told(read: Read, text: str) -> None:
    content = read(text)
    assert content.loops["A"].pv.tolist() == [1, 3]
    assert [(reject.line, reject.code) for reject in content.rejects.listed] == [(3, "ragged_row")]


def test_blank_lines_keep_the_numbers_of_lines(read: Read) -> None:
    content = read("\n\n" + HEADER + "\n" + GOOD + "\n\nnever,1,2\n\n")
    assert content.loops["A"].samples == 4
    assert [(reject.line, reject.code) for reject in content.rejects.listed] == [(11, "bad_time")]


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("last", ["", "never,1,2\n", "   \n"])
def test_thousands_of_blank_lines_at_the_end_are_no_rows(read: Read, end: str, last: str) -> None:
    content = read((HEADER + GOOD + last + "\n" * 20_000).replace("\n", end))
    assert content.loops["A"].samples == content.summary.rows_read - ("never" in last) == 4
    assert [reject.line for reject in content.rejects.listed] == ([6] if "never" in last else [])


@pytest.mark.parametrize("block_columns", [2, 200])
def test_values_without_a_time_are_told(read: Read, monkeypatch: pytest.MonkeyPatch, block_columns: int) -> None:
    monkeypatch.setattr("app.ingest.tables.frames.BLOCK_COLUMNS", block_columns)
    rows = [f"2026-01-01 00:00:{k:02d},{k}.5,{k},{k}" for k in range(20)]
    content = read("\n".join(["Time,A.PV,A.OP,A.SP", *rows, ",7.5,,", ",,,", ",,,8", ""]))
    assert content.summary.rows_kept == 20
    assert [(reject.line, reject.code) for reject in content.rejects.listed] == [(22, "bad_time"), (24, "bad_time")]
    assert content.rejects.listed[0].text == "'' is no time that can be read"


def test_values_without_a_time_of_their_own_group_alone_are_told(read: Read) -> None:
    """Each tag has its times: that of one ends before that of the other."""
    rows = [f"2026-01-01 00:00:{k:02d},{k}.5," + (f"2026-01-01 00:00:{k:02d},{k}" if k < 9 else ",") for k in range(20)]
    content = read("\n".join(["A.PV,,A.OP,", "Timestamp,Value,Timestamp,Value", *rows, "2026-01-01 00:00:59,1,,7", ""]))
    assert [(reject.line, reject.code) for reject in content.rejects.listed] == [(23, "bad_time")]


def test_values_without_a_time_and_a_tag_are_told(read: Read) -> None:
    rows = [f"2026-01-01 00:00:{k:02d},A.{s},{k}.5" for k in range(20) for s in ("PV", "OP")]
    content = read("\n".join(["Time,Tag,Value", *rows, ",,7.5", ",,", ""]))
    assert [(reject.line, reject.code) for reject in content.rejects.listed] == [(42, "bad_time")]


def test_repeated_times(read: Read) -> None:
    content = read(
        HEADER
        + "2024-03-01 00:00:00,1,10\n2024-03-01 00:00:00,1,11\n2024-03-01 00:01:00,2,20\n"
        + "2024-03-01 00:02:00,3,30\n"
    )
    assert content.loops["A"].op.tolist() == [11, 20, 30]
    assert [(reject.line, reject.code, reject.tag) for reject in content.rejects.listed] == [
        (2, "duplicate_time", "A.OP")
    ]


def test_a_repeated_time_keeps_what_the_later_row_does_not_give(read: Read) -> None:
    content = read(HEADER + "2024-03-01 00:00:00,1,10\n2024-03-01 00:00:00,,11\n2024-03-01 00:00:00,,\n" + GOOD[25:])
    assert content.loops["A"].pv.tolist()[0] == 1
    assert content.loops["A"].op.tolist()[0] == 11


def test_a_file_of_one_instant(read: Read) -> None:
    content = read(HEADER + "".join(f"2024-03-01 00:00:00,{i},10\n" for i in range(4)))
    assert content.loops["A"].pv.tolist() == [3]
    assert dict(content.rejects.counts) == {"duplicate_time": 3}


def test_time_backward_is_sorted_and_said(read: Read) -> None:
    content = read(HEADER + "".join(reversed(GOOD.splitlines(keepends=True))))
    assert content.loops["A"].pv.tolist() == [1, 2, 3, 4]
    assert any("sorted" in note for note in content.summary.notes)


def test_a_stamp_rounded_the_wrong_way_gets_the_step_that_is_missing(read: Read) -> None:
    stamps = ["00", "10", "20", "20", "40", "50"]
    content = read(HEADER + "".join(f"2024-03-01 00:00:{stamp},{i},{i}\n" for i, stamp in enumerate(stamps)))
    assert np.diff(content.loops["A"].time_ns).tolist() == [10 * 10**9] * 5


def test_a_truncated_gzip_keeps_what_came(read: Read) -> None:
    rng = np.random.default_rng(1)
    rows = "".join(
        f"2024-03-01 {i // 3600:02d}:{i // 60 % 60:02d}:{i % 60:02d},{rng.normal():.6f},{i}\n" for i in range(20_000)
    )
    content = read(gzip.compress((HEADER + rows).encode())[:-20_000])
    assert 5_000 < content.loops["A"].samples < 20_000
    assert any("damaged" in note for note in content.summary.notes)


def test_a_gzip_damaged_inside_keeps_what_came(read: Read) -> None:
    rng = np.random.default_rng(1)
    rows = "".join(
        f"2024-03-01 {i // 3600:02d}:{i // 60 % 60:02d}:{i % 60:02d},{rng.normal()},{i}\n" for i in range(40_000)
    )
    packed = bytearray(gzip.compress((HEADER + rows).encode()))
    packed[-8] ^= 1  # of the checksum
    content = read(bytes(packed))
    assert 30_000 < content.loops["A"].samples < 40_000
    assert any("damaged after" in note for note in content.summary.notes)
    packed[10:1000] = b"\xff" * 990
    assert code_of(read, bytes(packed)) == "not_an_export"


def test_bombs_are_stopped(read: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is unpacked whatever its ratio is less here: `tests/api/test_hostile_uploads` sends a large one."""
    monkeypatch.setattr(unpacking, "RATIO_FREE_BYTES", 1 << 20)
    packer = zlib.compressobj(9, zlib.DEFLATED, 31)
    bomb = (
        packer.compress(HEADER.encode() + GOOD.encode())
        + b"".join(packer.compress(b"\n" * (1 << 20)) for _ in range(8))
        + packer.flush()
    )
    assert read(bomb, options=IngestOptions(max_ratio=1100)).loops
    assert code_of(read, bomb, options=IngestOptions(max_ratio=100)) == "compression_ratio"
    assert code_of(read, bomb, options=IngestOptions(max_bytes=1 << 20)) == "decompressed_too_large"
    assert code_of(read, bomb) == "compression_ratio"


def test_a_plant_that_stands_still_is_no_bomb() -> None:
    """A second of 2,000 zeros packs 500 to 1."""
    rows = "".join(f"2026-01-31 00:{k // 60:02d}:{k % 60:02d}{',0' * 2000}\n" for k in range(3600)).encode()
    packed = gzip.compress(rows * 5)
    assert len(rows) * 5 > 450 * len(packed)
    assert sum(map(len, Unpacking(IngestOptions()).steps(packed))) == 5 * len(rows) > RATIO_FREE_BYTES


def test_packed_twice_or_an_archive(read: Read) -> None:
    assert code_of(read, gzip.compress(gzip.compress((HEADER + GOOD).encode()))) == "not_an_export"
    assert code_of(read, gzip.compress(b"PK\x03\x04" + bytes(500))) == "not_an_export"
    assert code_of(read, b"PK\x03\x04" + bytes(500)) == "not_an_export"


def test_a_column_of_nothing_but_the_word_for_no_data(read: Read) -> None:
    content = read(HEADER + "2024-03-01 00:00:00,-9999,10\n2024-03-01 00:01:00,-9999,20\n")
    assert content.loops["A"].pv is None
    assert dict(content.rejects.counts) == {"sentinel": 2}


def test_a_word_that_is_no_mode(read: Read) -> None:
    content = read("time,A.PV,A.MODE\n2024-03-01 00:00:00,1,AUTO\n2024-03-01 00:01:00,2,strange\n")
    assert content.loops["A"].automatic.tolist() == [1, -1]
    assert [(r.line, r.code, r.text, r.tag) for r in content.rejects.listed] == [
        (3, "unknown_mode", "strange", "A.MODE")
    ]


def test_hostile_names_are_data(read: Read) -> None:
    names = [
        "'; DROP TABLE loops;--.PV",
        "<script>alert(1)</script>.PV",
        "=cmd|' /C calc'!A0.PV",
        "../../etc/passwd.PV",
        "x" * 10_000 + ".PV",
    ]
    content = read("time," + ",".join(names) + "\n2024-03-01 00:00:00,1,2,3,4,5\n2024-03-01 00:01:00,1,2,3,4,5\n")
    assert set(content.loops) == {name[:-3].rstrip("-") for name in names[:4]}
    assert dict(content.rejects.counts) == {"name_too_long": 1}


@pytest.mark.parametrize("name", ["x" + "[" * 200_000, "(x" * 100_000, "a" + "." * 200_000 + "1", "a" + " ." * 100_000])
def test_names_that_patterns_would_look_at_for_hours(read: Read, name: str) -> None:
    content = read(f"time,A.PV,A.OP,{name}\n" + "".join(f"2024-03-01 00:0{i}:00,{i},1,2\n" for i in range(4)))
    assert content.loops["A"].pv.tolist() == [0, 1, 2, 3]
    assert dict(content.rejects.counts) == {"name_too_long": 1}
    assert read(f"{name},A.OP\n1,2\n2,3\n").loops["A"].op.tolist() == [2, 3]


def test_ten_thousand_columns(read: Read) -> None:
    names = [f"T{i}.PV" for i in range(10_000)]
    row = ",".join(f"{i}.5" for i in range(10_000))
    content = read("time," + ",".join(names) + "\n" + "".join(f"2024-03-01 00:0{i}:00,{row}\n" for i in range(5)))
    assert len(content.loops) == 10_000
    assert content.loops["T77"].pv.tolist() == [77.5] * 5


def test_latin_letters_and_bytes_that_are_none(read: Read) -> None:
    text = "Zeit;Druck_Kühler.PV;Druck_Kühler.OP\n2024-03-01 00:00:00;1,5;2,5\n2024-03-01 00:01:00;1,6;2,6\n"
    assert read(text.encode("cp1252")).loops["Druck_Kühler"].pv.tolist() == [1.5, 1.6]
    late = (HEADER + GOOD * 1).encode() + b"\n" * 300_000 + b"2024-03-01 00:09:00,\xff\xfe,1\n"
    content = read(late)
    assert content.loops["A"].samples == 5
    assert dict(content.rejects.counts) == {"not_a_number": 1}


def test_two_accented_letters_side_by_side_are_no_chinese(read: Read) -> None:
    rows = "".join(f"08.06.2000 12:13:0{i};5{i},5;4{i},5\n" for i in range(4))
    for names in ("Zeit;Istwert;Stellgröße", "ZEIT;ISTWERT;STELLGRÖßE", "Zeit;Füß.Istwert.PV;Füß.Istwert.OP"):
        content = read(f"{names}\n{rows}".encode("cp1252"), name="FIC1.csv")
        assert content.summary.encoding == "cp1252"
        assert [loop.op.tolist() for loop in content.loops.values()] == [[40.5, 41.5, 42.5, 43.5]]


def test_a_chinese_letter_between_capitals_stays_one(read: Read) -> None:
    rows = "".join(f"2024-03-01 00:00:0{i},{i},1{i}\n" for i in range(4))
    content = read(f"时间,A泵B.PV,A泵B.OP\n{rows}".encode("gb18030"))
    assert content.summary.encoding == "gb18030"
    assert list(content.loops) == ["A泵B"]


def test_rejects_are_counted_all_and_listed_some(read: Read) -> None:
    rows = "".join(f"2024-03-01 {i // 60:02d}:{i % 60:02d}:00,No Data,{i}\n" for i in range(500))
    content = read(HEADER + rows, options=IngestOptions(max_rejects=10))
    assert content.rejects.counts["not_a_number"] == 500
    assert len(content.rejects.listed) == 10


def test_what_is_refused_after_the_list_is_full_is_counted(read: Read) -> None:
    content = read(HEADER + "2024-03-01 00:00:00,x,y\n2024-03-01 00:01:00,2,20\n", options=IngestOptions(max_rejects=1))
    assert content.rejects.counts["not_a_number"] == 2
    assert [reject.tag for reject in content.rejects.listed] == ["A.PV"]


def test_a_signal_that_some_chunks_lack(read: Read) -> None:
    rows = "".join(f"2024-03-01 00:{i:02d}:00,{i},{'' if 10 < i < 50 else i}\n" for i in range(60))
    whole, parts = (read(HEADER + rows, options=IngestOptions(chunk_bytes=size)).loops["A"] for size in (1 << 20, 200))
    np.testing.assert_array_equal(parts.op, whole.op)
    assert np.isnan(parts.op).sum() == 39


def test_a_file_that_ends_with_its_chunk(read: Read) -> None:
    text = HEADER + GOOD + "\n" * (len(HEADER + GOOD) % 2)
    assert read(text, options=IngestOptions(chunk_bytes=len(text) // 2)).loops["A"].pv.tolist() == [1, 2, 3, 4]


def test_chunks_of_any_size_give_the_same(read: Read) -> None:
    text = "time,A.PV,A.OP,A.MODE\n" + "".join(
        f"2024-03-01 00:{i // 60:02d}:{i % 60:02d},{i},{-i},AUTO\n" for i in range(300)
    )
    whole = read(text).loops["A"]
    for size in (1, 100, 1000):
        parts = read(text, options=IngestOptions(chunk_bytes=size, buffered_values=50)).loops["A"]
        np.testing.assert_array_equal(parts.time_ns, whole.time_ns)
        np.testing.assert_array_equal(parts.op, whole.op)
        np.testing.assert_array_equal(parts.automatic, whole.automatic)


FRAGMENTS = (
    *(
        HEADER,
        GOOD,
        "Tagname,TimeStamp,Value,DataQuality\n",
        "A.PV,2024-03-01 00:00:00,1,Good\n",
        "#NAMES\n",
        "#ROWS,3\n",
    ),
    *(
        "PROCESSDATA\tx\n",
        "tagname\tA.PV\tA.OP\n",
        '"',
        ",",
        ";",
        "\t",
        "\n",
        "\r\n",
        "\0",
        "1e400",
        "-9999",
        "NaN",
        "Bad",
    ),
    *("7/20/01 11:07,", "1601890328:76000000,", "2024-03-01T00:00:00+01:00,", "0,1,2\n1,2,3\n", "time,SP,PV,OP,MODE\n"),
    *(
        "time [\u03bcs],PV,OP\n",
        "Time (hr);PV;OP\n",
        "2026-03-04 10:00:00,123;1;2\n",
        "Date,Time,Timestamp,A.PV,A.OP\n",
    ),
    *("tag,time,value,quality\n", "A.PV,2026-03-04 10:00,1,1024\n" * 7, f"A.PV,2026-03-04 10:01,1,0x{'f' * 300}\n"),
    *("AUTO", "\ufeff", "é", "塔", "9" * 30, "x" * 300),
)
fragments = st.sampled_from(FRAGMENTS)


@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    parts=st.lists(fragments | st.text(max_size=8) | st.binary(max_size=8), max_size=25),
    packed=st.booleans(),
    known=st.sampled_from(
        ("", HEADER, HEADER + GOOD, "Tagname,TimeStamp,Value,DataQuality\nA.PV,2024-03-01 00:00:00,1,Good\n")
    ),
)
def test_no_bytes_raise_anything_else(tmp_path: Path, parts: list[str | bytes], packed: bool, known: str) -> None:
    data = known.encode() + b"".join(
        part.encode("utf-8", "replace") if isinstance(part, str) else part for part in parts
    )
    path = tmp_path / "fuzzed"
    path.write_bytes(gzip.compress(data) if packed else data)
    try:
        for stretch in read_export(path, filename="fuzzed.csv").loops():
            assert np.all(np.diff(stretch.time_ns) > 0)
    except DataError:
        pass


def test_a_signal_is_not_taken_for_the_time(read: Read) -> None:
    assert code_of(read, "FIC1.PV,FIC1.OP\n" + "50.1,20\n50.2,21\n50.3,22\n" * 5) == "unknown_layout"


def test_tags_of_no_loop_are_told(read: Read) -> None:
    notes = read("time,temp,pressure\n" + "2024-03-01 00:00:00,1,10\n2024-03-01 00:01:00,2,20\n").summary.notes
    assert any("no tag is named like PV" in note and "temp" in note for note in notes)


def test_a_mapping_of_other_tags_is_told(read: Read) -> None:
    mapping = TagMapping.from_bytes(b"tag,loop,signal\nX1,X,PV\n")
    content = read(HEADER + GOOD, mapping=mapping)
    assert content.loops["A"].pv.tolist() == [1, 2, 3, 4]
    assert any("the mapping names none of the tags" in note and "A.PV" in note for note in content.summary.notes)


def test_mapped_tags_of_loops_that_came_are_named_where_they_did_not(read: Read) -> None:
    others = "".join(f"X{i},A,OTHER\n" for i in range(1, 7))
    content = read(HEADER + GOOD, mapping=TagMapping.from_bytes(f"tag,loop,signal\na.pv,A,PV\n{others}".encode()))
    told = [note for note in content.summary.notes if "mapp" in note]
    assert told == ["of loops of the file 6 mapped tags are not in it: X1, X2, X3, X4, X5"]
    content = read(HEADER + GOOD, mapping=TagMapping.from_bytes(b"tag,loop,signal\nA.PV,A,PV\n"))
    assert not any("mapp" in note for note in content.summary.notes)


@pytest.mark.parametrize(
    ("others", "told"),
    [
        (("B",), "of the 2 loops of the mapping 1 is not in this file: B"),
        (("B", "C"), "of the 3 loops of the mapping 2 are not in this file"),  # a mapping of the whole plant
    ],
)
def test_loops_of_the_mapping_that_did_not_come_are_counted(read: Read, others: tuple[str, ...], told: str) -> None:
    rows = "".join(f"{loop}.x,{loop},PV\n" for loop in others)
    content = read(HEADER + GOOD, mapping=TagMapping.from_bytes(f"tag,loop,signal\na.pv,A,PV\n{rows}".encode()))
    assert [note for note in content.summary.notes if "mapp" in note] == [told]


def test_a_file_of_modes_is_told(read: Read) -> None:
    notes = read("time,FIC1.MODE\n2024-03-01 00:00:00,0\n2024-03-01 00:01:00,1\n").summary.notes
    assert notes == ("of its loops the file has the mode alone",)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "cp1252"])
@pytest.mark.parametrize("chunk_bytes", [200, 1 << 20])
def test_line_ends_that_were_made_twice(read: Read, encoding: str, chunk_bytes: int) -> None:
    """A file of Windows sent as one of Unix."""
    rows = [f"2026-01-01 00:00:{k:02d},{k},{'Größe' if k else 7},{k},AUTO" for k in range(50)]
    text = "\r\r\n".join(["Time,A.PV,Note,A.OP,A.MODE", *rows, ""])
    content = read(text.encode(encoding), options=IngestOptions(chunk_bytes=chunk_bytes))
    assert content.loops["A"].op.tolist() == list(range(50))
    assert content.loops["A"].automatic.tolist() == [1] * 50
    assert dict(content.rejects.counts) == {"not_a_number": 49}
    assert content.rejects.listed[-1].line == 51


@pytest.mark.parametrize(
    "names", ["time,PV,OP", "Time;FIC1.PV;FIC1.OP", "Tag,Timestamp,Value", "Report of the night\n\ntime,PV,OP"]
)
@pytest.mark.parametrize(
    ("rows", "why"), [("", "there is none"), ("later,later,later\n", "the first of them is 'later'")]
)
def test_names_without_rows_are_told_from_files_without_names(read: Read, names: str, rows: str, why: str) -> None:
    rows = rows.replace(",", ";") if ";" in names else rows
    with pytest.raises(DataError, match=f"no row has a time that can be read; {why}"):
        read(f"{names}\n{rows}")
