"""Which values are refused for their quality, and what is said where the file does not tell its meaning."""

import numpy as np
import polars as pl
import pytest

from app.ingest import IngestOptions, TagMapping
from app.ingest.tags.quality import Quality

from .conftest import Content, Read

STAMPS = [f"2026-03-01 00:{i:02d}:00" for i in range(20)]


def long(good: str, bad: str, name: str = "Quality") -> str:
    """Every fifth value is bad."""
    rows = (
        f'A.{signal},{stamp},{i},"{bad if i % 5 == 0 else good}"\n'
        for i, stamp in enumerate(STAMPS)
        for signal in ("PV", "OP")
    )
    return f"Tagname,TimeStamp,Value,{name}\n" + "".join(rows)


def refused(content: Content, signal: str = "pv") -> list[int]:
    return np.flatnonzero(np.isnan(getattr(content.loops["A"], signal))).tolist()


BAD_ROWS = [0, 5, 10, 15]
UNTOLD = "the file does not tell which quality number is good, {} was taken, the most frequent of {}"


@pytest.mark.parametrize("chunk_bytes", [16 << 20, 300])
@pytest.mark.parametrize(
    ("good", "bad"),
    [
        ("Gut", "Schlecht"),
        ("Bon", "Mauvais"),
        ("0x00C0", "0x0000"),
        ("192", "0"),
        ("1", "0"),
        ("1073741824", "2147483648"),
        ("0", "2147483648"),
    ],
)
def test_words_and_numbers_that_tell(read: Read, good: str, bad: str, chunk_bytes: int) -> None:
    content = read(long(good, bad), options=IngestOptions(chunk_bytes=chunk_bytes))
    assert refused(content) == refused(content, "op") == BAD_ROWS
    assert dict(content.rejects.counts) == {"bad_quality": 8}
    assert content.summary.notes == ()


@pytest.mark.parametrize(("good", "bad"), [("0", "1"), ("-1", "0"), ("0", "8")])
def test_numbers_that_do_not_tell_are_judged_by_the_most_frequent(read: Read, good: str, bad: str) -> None:
    content = read(long(good, bad))
    assert refused(content) == BAD_ROWS
    assert content.summary.notes == (UNTOLD.format(good, f"{good}, {bad}"),)


def test_numbers_of_opc_tell_though_most_are_bad(read: Read) -> None:
    content = read(long("0", "192"))
    assert len(refused(content)) == 16
    assert content.summary.notes == ("most values were refused for their quality: 0 (32)",)


def test_of_words_that_are_as_frequent_the_alphabet_tells_which_comes_first(read: Read) -> None:
    text = "Tag,Time,Value,Quality\n" + "".join(
        f"FIC1.{signal},2024-01-01 00:{minute:02d}:00,{minute}.5,{('Timeout', 'Bad', 'Offline')[minute % 3]}\n"
        for minute in range(30)
        for signal in ("PV", "OP")
    )
    told = "most values were refused for their quality: Bad (20), Offline (20), Timeout (20)"
    assert told in read(text).summary.notes


def test_of_numbers_that_are_as_frequent_the_smallest_comes_first() -> None:
    quality = Quality()
    for chunk in (["0"] * 4, ["7", "5"], ["3"]):
        quality.learn(pl.Series(chunk))
    assert quality.notes() == [UNTOLD.format(0, "0, 3, 5")]


def test_of_more_words_than_are_counted_the_same_are_named_each_time() -> None:
    quality = Quality()
    quality.learn(pl.Series([f"fault {number:04d}" for number in reversed(range(5000))]))
    told = "fault 0000 (1), fault 0001 (1), fault 0002 (1)"
    assert quality.notes() == [f"most values were refused for their quality: {told}"]


@pytest.mark.parametrize("name", ["CONFIDENCE", "OPCQuality"])
def test_names_that_tell(read: Read, name: str) -> None:
    assert refused(read(long("100", "0", name))) == BAD_ROWS
    content = read(long("0", "0", name))
    assert dict(content.rejects.counts) == {"bad_quality": 40}
    assert content.summary.notes[0] == "most values were refused for their quality: 0 (40)"


@pytest.mark.parametrize(
    ("name", "good", "bad"),
    [
        ("Qualität", "Gut", "Schlecht"),
        ("QUALITA\u0308T", "Gut", "Schlecht"),
        ("Qualité", "Bonne", "Mauvaise"),
        ("Calidad", "Buena", "Mala"),
        ("StatusCode", "Good", "BadNoCommunication"),
        ("Validity", "Valid", "Invalid"),
        ("IsGood", "True", "False"),
        ("Is Valid", "1", "0"),
        ("QStatus", "Good", "Bad"),
        ("Güte", "Gut", "Schlecht"),
        ("State of it", "Good", "Bad Input"),
    ],
)
def test_other_names_and_words_alone(read: Read, name: str, good: str, bad: str) -> None:
    assert refused(read(long(good, bad, name))) == BAD_ROWS


def test_ones_are_good_by_their_name(read: Read) -> None:
    assert dict(read(long("0", "0", "IsGood")).rejects.counts) == {"bad_quality": 40}


@pytest.mark.parametrize(
    ("usual", "other"), [("False", "True"), ("Normal", "HIHI"), ("Raw", "Interpolated"), ("g", "%")]
)
def test_words_of_something_else_in_a_long_table_are_no_qualities(read: Read, usual: str, other: str) -> None:
    assert refused(read(long(usual, other, "Further"))) == []


def test_which_number_is_good_is_decided_by_all_rows(read: Read) -> None:
    """The first chunk has zeros alone, most of the file has ones."""
    rows = [f"A.PV,2026-03-01 {i // 60:02d}:{i % 60:02d}:00,{i},{0 if i < 20 else 1}\n" for i in range(100)]
    content = read("Tagname,TimeStamp,Value,Quality\n" + "".join(rows), options=IngestOptions(chunk_bytes=600))
    assert content.loops["A"].samples == 100
    assert np.isfinite(content.loops["A"].pv).tolist() == [i >= 20 for i in range(100)]
    assert content.rejects.counts == {"bad_quality": 20}


def wide(head: str, row: str, bad: str = "Bad", good: str = "Good") -> str:
    qualities = [bad if i % 5 == 0 else good for i in range(20)]
    return head + "\n" + "".join(row.format(t=t, i=i, q=qualities[i]) + "\n" for i, t in enumerate(STAMPS))


@pytest.mark.parametrize(
    ("head", "row"),
    [
        ("Time,A.PV.Value,A.PV.Quality,A.OP.Value,A.OP.Quality", "{t},{i},{q},{i},Good"),
        ("Time,A.PV,A.PV Status,A.OP,A.OP Status", "{t},{i},{q},{i},Good"),
        ("Time,A.PV,Status,A.OP,Status", "{t},{i},{q},{i},Good"),
        ("Time,A.PV,Status,A.OP", "{t},{i},{q},{i}"),
        ("Zeit,A.PV,Qualität,A.OP,Qualität", "{t},{i},{q},{i},Good"),
        ("Zeit,A.PV,A.PV_Qualität,A.OP,A.OP_Qualität", "{t},{i},{q},{i},Good"),
        ("Time,A.PV.Value,A.PV.StatusCode,A.OP.Value,A.OP.StatusCode", "{t},{i},{q},{i},Good"),
    ],
)
def test_a_column_judges_the_value_it_names_or_stands_right_of(read: Read, head: str, row: str) -> None:
    content = read(wide(head, row))
    assert refused(content) == BAD_ROWS
    assert refused(content, "op") == []
    assert dict(content.rejects.counts) == {"bad_quality": 4}
    assert content.loops["A"].others == {}


@pytest.mark.parametrize(
    ("head", "row"),
    [("Time,A.PV,A.OP,Quality", "{t},{i},{i},{q}"), ("Time,Quality,A.PV,A.OP", "{t},{q},{i},{i}")],
)
def test_a_single_column_judges_the_whole_row(read: Read, head: str, row: str) -> None:
    content = read(wide(head, row))
    assert refused(content) == refused(content, "op") == BAD_ROWS
    content = read(wide(head, row, "1", "0"))
    assert refused(content) == refused(content, "op") == BAD_ROWS
    assert content.summary.notes == (UNTOLD.format(0, "0, 1"),)


def test_the_state_of_something_is_no_quality(read: Read) -> None:
    content = read(wide("Time,A.PV,A.OP,Status", "{t},{i},{i},{q}", "Stopped", "Running"))
    assert refused(content) == []
    assert content.rejects.total == 0


@pytest.mark.parametrize("chunk_bytes", [16 << 20, 300])
@pytest.mark.parametrize(
    "codes",
    [
        {"0": 15, "1024": 5},
        {"0": 12, "9830400": 3, "3145728": 2, "2150957056": 3},
        {"0x00000000": 12, "0x00960000": 5, "0x80350000": 3},
        {"0": 12, "9830400": 5, "-2144010240": 3},
    ],
)
def test_of_ua_the_two_highest_bits_tell(read: Read, codes: dict[str, int], chunk_bytes: int) -> None:
    texts = [code for code, times in codes.items() for _ in range(times)]
    rows = "".join(f"A.PV,{stamp},{i},{code}\n" for i, (stamp, code) in enumerate(zip(STAMPS, texts, strict=True)))
    content = read(f"Tagname,TimeStamp,Value,Quality\n{rows}", options=IngestOptions(chunk_bytes=chunk_bytes))
    bad = {"2150957056", "0x80350000", "-2144010240"}
    assert refused(content) == [i for i, code in enumerate(texts) if code in bad]


def test_bits_of_a_vendor_above_the_byte_of_opc_make_it_no_ua(read: Read) -> None:
    rows = "".join(f"A.PV,{stamp},{i},{(192, 1216, 192, 0)[i % 4]}\n" for i, stamp in enumerate(STAMPS))
    assert refused(read(f"Tagname,TimeStamp,Value,Quality\n{rows}")) == [3, 7, 11, 15, 19]


@pytest.mark.parametrize("chunk_bytes", [16 << 20, 300])
@pytest.mark.parametrize("good", ["448", "4288", "65728", "262336", "0x000400C0"])
def test_good_of_opc_below_bits_of_a_vendor(read: Read, good: str, chunk_bytes: int) -> None:
    options = IngestOptions(chunk_bytes=chunk_bytes)
    content = read(long(good, good), options=options)
    assert refused(content) == []
    assert content.summary.notes == ()
    for bad in ("0", "0x00040000"):
        assert refused(read(long(good, bad), options=options)) == BAD_ROWS


def test_codes_that_are_neither_are_judged_by_the_most_frequent(read: Read) -> None:
    assert refused(read(long("0", "301"))) == BAD_ROWS


def test_words_with_their_code_behind_them(read: Read) -> None:
    words = ["OK (0x0)", "Good (192)", "Good(0)", "Bad (0x80000000)", "The operation failed (0x80020000)"]
    text = "Tag,Time,Value,Quality\n" + "".join(
        f"A.{signal},2024-03-01 00:0{i}:00,{i},{word}\n" for i, word in enumerate(words) for signal in ("PV", "OP")
    )
    content = read(text)
    assert content.loops["A"].pv.tolist()[:3] == [0, 1, 2]
    assert content.rejects.counts["bad_quality"] == 4


@pytest.mark.parametrize("chunk_bytes", [16 << 20, 300])
@pytest.mark.parametrize(
    ("name", "good", "bad"),
    [
        *(("Valid", good, bad) for good, bad in (("1", "0"), ("True", "False"), ("Y", "N"), ("", "no"), ("ok", "bad"))),
        *(("Is Valid", "Y", "N"), ("gültig", "ja", "nein")),
        *(("IsBad", "0", "1"), ("Bad", "FALSE", "TRUE"), ("Error", "n", "y"), ("Has Error", "No", "Yes")),
        *(("Error", "0.0", "1.0"), ("Invalid", "", "True"), ("Fehler", "nein", "ja")),
        *(("Qual", "192", "0"), ("QC", "216", "24"), ("vtq", "Good", "Bad"), ("Q", "G", "B"), ("Sts", "OK", "NOK")),
    ],
)
def test_flags_and_short_names_of_a_long_table(read: Read, name: str, good: str, bad: str, chunk_bytes: int) -> None:
    content = read(long(good, bad, name), options=IngestOptions(chunk_bytes=chunk_bytes))
    assert refused(content) == refused(content, "op") == BAD_ROWS
    assert dict(content.rejects.counts) == {"bad_quality": 2 * len(BAD_ROWS)}
    assert not [note for note in content.summary.notes if "not read" in note]


@pytest.mark.parametrize(
    ("name", "one", "other"),
    [
        *(("Error", "0.25", "1"), ("Error", "0", "-1.5"), ("Bad", "Bath", "Bed"), ("Q", "1", "0"), ("Q", "192.5", "0")),
        *(
            ("Sts", "Normal", "Alarm"),
            ("Sts", "on", "off"),
            ("QC", "7", "9"),
            ("Valid", "Jan", "Feb"),
            ("Valid", "0", "1"),
            ("Valid", "0", "0"),
            ("Error", "1", "1"),
            ("Q", "200", "0"),
            ("Questionable", "0", "1"),
            ("Lab", "2", "3"),
        ),
    ],
)
def test_a_column_that_may_be_anything_judges_nothing_and_is_told(read: Read, name: str, one: str, other: str) -> None:
    content = read(long(one, other, name))
    assert refused(content) == []
    assert not content.rejects.counts
    assert content.summary.notes == (f"columns beside tag, time and value were not read: {name}",)


def test_what_is_wrong_may_stand_beside_flags_further_down() -> None:
    good, bad = ("False", "", "n/a", "Good", "OK", "0"), ("Sensor break", "27")
    quality = Quality(good_if_set=False)
    assert [word for word in (*good, *bad) if quality.is_bad(word)] == list(bad)


def test_a_quality_goes_before_flags_and_these_are_told(read: Read) -> None:
    rows = "".join(f"{n},A.{s},{stamp},1.{n},Good,False,\n" for n, stamp in enumerate(STAMPS) for s in ("PV", "OP"))
    content = read("Id,Tag,Time,Value,Status,Questionable,Remark\n" + rows)
    assert not content.rejects.counts
    assert content.summary.notes == ("columns beside tag, time and value were not read: Questionable",)


@pytest.mark.parametrize("names", ["Point,When,Number,State", "PointName,RecordTime,ValueAsReal,QualityDesc"])
@pytest.mark.parametrize(("good", "bad"), [("Good", "Bad"), ("gut", "schlecht")])
def test_words_alone_under_names_that_are_not_known(read: Read, names: str, good: str, bad: str) -> None:
    content = read(long(good, bad).replace("Tagname,TimeStamp,Value,Quality", names))
    assert refused(content) == refused(content, "op") == BAD_ROWS


def test_words_alone_beside_loop_and_signal(read: Read) -> None:
    content = read(long("Good", "Bad", "State").replace("A.", "A,").replace("Tagname", "Loop,Signal"))
    assert refused(content) == refused(content, "op") == BAD_ROWS


@pytest.mark.parametrize("names", ["Point,When,Number,Site", "Loop,Signal,Time,Value,Site", ""])
def test_a_town_is_no_quality(read: Read, names: str) -> None:
    rows = long("Bad Homburg", "Bad Vilbel").partition("\n")[2]
    rows = rows.replace("A.", "A,") if names.startswith("Loop") else rows
    content = read(f"{names}\n{rows}" if names else rows)
    assert not content.rejects.counts


@pytest.mark.parametrize("ending", [".Q", "_Q", ".QUAL", "_ST", "/sts", " Stat"])
@pytest.mark.parametrize(("good", "bad"), [("192", "24"), ("GOOD", "BAD"), ("Good", "Bad - No Data"), ("G", "B")])
def test_a_short_ending_names_a_quality_where_one_stands_there(read: Read, ending: str, good: str, bad: str) -> None:
    rows = (f"2026-03-01 00:{i:02d}:00,{i},{bad if i == 7 else good},{i % 9},{good}" for i in range(60))
    content = read(f"Time,A.PV,A.PV{ending},A.OP,A.OP{ending}\n" + "\n".join(rows))
    assert content.rejects.counts == {"bad_quality": 1}
    assert content.loops.keys() == {"A"}


@pytest.mark.parametrize(
    ("value", "name", "good", "bad"),
    [
        ("A/PV.CV", "A/PV.ST", "GoodNonCascade_NonSpecific", "BadSensorFailure_NonSpecific"),
        ("A/PV.CV", "A/PV.ST", "192", "28"),
        ("A/PV#Value", "A/PV#ST", "16#80", "16#28"),
        ("A.PV", "A.PV.ST", "0x80", "0x00"),
        ("A.PV", "A.PV.ST", "0xA4", "0x1C"),
    ],
)
def test_status_beside_a_value_in_control_systems(read: Read, value: str, name: str, good: str, bad: str) -> None:
    rows = (f"2026-03-01 00:{i:02d}:00,{i},{bad if i in (6, 7) else good},{i % 9}" for i in range(60))
    content = read(
        f"Time,{value},{name},A/OP\n".replace("A/OP", "A.OP" if "/" not in value else "A/OP") + "\n".join(rows)
    )
    assert refused(content) == [6, 7]
    assert content.rejects.counts == {"bad_quality": 2}


def test_numbers_of_profibus_beside_a_value_are_told_and_judge_nothing(read: Read) -> None:
    """A count may be 128 as well, and nothing but good ones of OPC tells that it is none."""
    rows = (f"2026-03-01 00:{i:02d}:00,{i},{0 if i in (6, 7) else 128},{i % 9}" for i in range(60))
    content = read("Time,A.PV,A.PV.ST,A.OP\n" + "\n".join(rows))
    assert refused(content) == []
    (note,) = content.summary.notes
    assert note.startswith("columns are called as qualities of values are, and nothing tells which")


@pytest.mark.parametrize("name", ["A.PV_Q", "A.PV.ST", "Q", "Status", "A.PV Status"])
@pytest.mark.parametrize(
    ("good", "bad"),
    [("Good", "Comm Fail"), ("Good", "No Status"), ("OK", "BAD"), ("NR", "IOP"), ("NR", "OOP"), ("Gut", "Drahtbruch")],
)
def test_words_beside_good_ones_say_what_is_wrong(read: Read, name: str, good: str, bad: str) -> None:
    odd = {6: bad, 7: "OOS", 8: "BAD"}
    rows = (f"2026-03-01 00:{i:02d}:00,{i},{odd.get(i, good)},{i % 9}" for i in range(60))
    content = read(f"Time,A.PV,{name},A.OP\n" + "\n".join(rows))
    assert refused(content) == [6, 7, 8]
    assert content.rejects.counts == {"bad_quality": 3}


@pytest.mark.parametrize("status", ["NR", "QST", "CND", "CLP+", "CLP-", "IOP", "IOP-", "OOP", "NRDY", "BAD", "PTPF"])
def test_data_status_of_centum(read: Read, status: str) -> None:
    content = read(long("NR", status))
    assert refused(content) == ([] if status in ("NR", "QST", "CND", "CLP+", "CLP-") else BAD_ROWS)


@pytest.mark.parametrize(("usual", "other"), [("OK", "HIHI"), ("Running", "Good"), ("Open", "Closed")])
def test_words_of_states_below_a_short_ending_judge_nothing(read: Read, usual: str, other: str) -> None:
    rows = (f"2026-03-01 00:{i:02d}:00,{i},{other if i % 9 == 7 else usual},{i % 9}" for i in range(60))
    content = read("Time,A.PV,A.PV_ST,A.OP\n" + "\n".join(rows))
    assert content.rejects.total == 0 or "bad_quality" not in content.rejects.counts
    assert refused(content) == []


@pytest.mark.parametrize("name", ["A.PV_ST", "ST", "A.Q"])
@pytest.mark.parametrize(
    "states",
    [
        *(("NR", "HI", "LO"), ("NR", "HH", "DV+"), ("G", "R", "Y"), ("OK", "START", "FAIL"), ("Good", "HIHI", "LO")),
        ("0x00", "0x80", "0x81"),
    ],
)
def test_alarms_lamps_and_bits_of_states_beside_a_value_refuse_nothing(
    read: Read, name: str, states: tuple[str, str, str]
) -> None:
    """CENTUM's alarms are NR, too, where there are none, and a value beyond a limit is measured."""
    rows = (f"2026-03-01 00:{i:02d}:00,{i},{states[max(i % 5 - 2, 0)]},{i % 9}" for i in range(60))
    assert refused(read(f"Time,A.PV,{name},A.OP\n" + "\n".join(rows))) == []


@pytest.mark.parametrize("name", ["Status", "A.PV Status"])
@pytest.mark.parametrize("alarm", ["HI", "LO", "HH", "MHI", "DV-", "VEL+"])
def test_alarms_of_centum_below_the_name_of_a_status(read: Read, name: str, alarm: str) -> None:
    rows = (f"2026-03-01 00:{i:02d}:00,{i},{'NR' if i % 5 < 3 else alarm},{i % 9}" for i in range(60))
    assert refused(read(f"Time,A.PV,{name},A.OP\n" + "\n".join(rows))) == []


@pytest.mark.parametrize("name", ["Status", "ST", "A.PV_ST"])
@pytest.mark.parametrize("other", ["R", "RUN", "Ready"])
def test_a_pump_that_is_not_running_is_no_status_of_centum(read: Read, name: str, other: str) -> None:
    rows = (f"2026-03-01 00:{i:02d}:00,{i},{'NR' if i % 5 < 3 else other},{i % 9}" for i in range(60))
    assert refused(read(f"Time,A.PV,{name},A.OP\n" + "\n".join(rows))) == []


@pytest.mark.parametrize("column", ["Status", "Quality"])
def test_alarms_of_centum_beside_rows_of_tags(read: Read, column: str) -> None:
    content = read(long("NR", "HI").replace("Quality", column))
    assert refused(content) == []


@pytest.mark.parametrize("name", ["A.Status", "A Status", "A_ST"])
@pytest.mark.parametrize(("usual", "other"), [("Run", "Stop"), ("OPEN", "CLOSED"), ("0", "1")])
def test_the_state_of_a_control_valve_is_no_quality(read: Read, name: str, usual: str, other: str) -> None:
    """A.CV may be one; what A.PV.CV has beside it in DeltaV is a quality by its words."""
    rows = (f"2026-03-01 00:{i:02d}:00,{i},{other if i % 9 == 7 else usual},{i % 9}" for i in range(60))
    content = read(f"Time,A.CV,{name},A.PV\n" + "\n".join(rows))
    assert content.rejects.counts == {}
    assert np.isfinite(content.loops["A"].op).all()


@pytest.mark.parametrize("steps", [("150", "180", "192"), ("192", "150", "20"), ("130", "216", "0")])
def test_set_points_below_a_short_ending_are_no_numbers_of_profibus(read: Read, steps: tuple[str, str, str]) -> None:
    rows = (f"2026-03-01 00:{i:02d}:00,{i},{steps[i // 20]},{i % 9}" for i in range(60))
    content = read("Time,A.PV,A.PV_ST,A.OP\n" + "\n".join(rows))
    assert content.rejects.counts == {}
    assert "A.PV_ST" in str(content.summary.loops)


@pytest.mark.parametrize("state", ["1", "RUN", "12.5", "128", "0"])
def test_a_short_ending_may_be_that_of_a_signal(read: Read, state: str) -> None:
    rows = (f"2026-03-01 00:{i:02d}:00,{i},{state},{i % 9},{state}" for i in range(60))
    content = read("Time,A.PV,A.PV_ST,A.OP,A.OP_ST\n" + "\n".join(rows))
    assert content.rejects.total == 0
    assert np.isfinite(content.loops["A"].pv).all()


CODES_OF_ANOTHER = [("500", "340"), ("1000", "403"), ("500", "1"), ("500", "500")]


@pytest.mark.parametrize(("usual", "odd"), CODES_OF_ANOTHER)
@pytest.mark.parametrize("name", ["Quality", "Status", "A.PV_Status"])
def test_codes_of_ignition_are_others_where_no_good_one_of_it_stands(
    read: Read, name: str, usual: str, odd: str
) -> None:
    rows = (f"2026-03-01 00:{i:02d}:00,{i},{odd if i == 7 else usual},{i % 9}" for i in range(60))
    content = read(f"Time,A.PV,{name},A.OP\n" + "\n".join(rows))
    assert content.rejects.counts.get("bad_quality", 0) <= 1
    rows = (
        f"A.{tag},2026-03-01 00:{i:02d}:00,{i},{odd if i == 7 else usual}" for i in range(60) for tag in ("PV", "OP")
    )
    content = read(f"tag,time,value,{'status' if name == 'Status' else 'quality'}\n" + "\n".join(rows))
    assert content.rejects.counts.get("bad_quality", 0) <= 2


@pytest.mark.parametrize("usual", ["192", "200", "216"])
def test_they_are_those_of_ignition_beside_its_good_ones(read: Read, usual: str) -> None:
    rows = (f"2026-03-01 00:{i:02d}:00,{i},{500 if i % 3 else usual},{i % 9}" for i in range(60))
    assert read("Time,A.PV,Quality,A.OP\n" + "\n".join(rows)).rejects.counts == {"bad_quality": 40}


def test_integers_near_the_good_ones_are_no_qualities_where_they_are_many(read: Read) -> None:
    rows = (f"2026-03-01 00:{i:02d}:00,{i},{192 + i % 20},{i % 9},{192 + i % 20}" for i in range(60))
    content = read("Time,A,A_Q,B,B_Q\n" + "\n".join(rows))
    assert {"A_Q", "B_Q"} <= {tag for loop in content.summary.loops for tag in loop.others}


def test_a_column_called_as_a_quality_that_is_0_in_all_rows_is_told_beside_others(read: Read) -> None:
    rows = [f"2026-03-01 00:{i:02d}:00,{i},{0 if i in (6, 7) else 192},{i % 9},0" for i in range(60)]
    content = read("Time,A.PV,A.PV_Q,A.OP,A.OP_Q\n" + "\n".join(rows))
    assert refused(content) == [6, 7]
    (note,) = content.summary.notes
    assert note.endswith("no value was refused by them: A.OP_Q")


@pytest.mark.parametrize("name", ["Q", "ST"])
@pytest.mark.parametrize(("numbers", "told"), [(("0", "128"), True), (("192", "300"), False), (("0", "1"), False)])
def test_a_short_name_over_what_may_be_qualities_is_told(
    read: Read, name: str, numbers: tuple[str, str], told: bool
) -> None:
    """PROFIBUS has 128 for good, and a flow may be that, too: it is a signal, and judges nothing."""
    rows = "".join(f"{stamp},{i},{i % 7},{numbers[i % 2]}\n" for i, stamp in enumerate(STAMPS))
    content = read(f"time,A.PV,A.OP,{name}\n{rows}")
    assert (content.summary.tags, refused(content)) == (3, [])
    note = f"the column {name} was read as a signal, though what it holds (0, 128) may be qualities"
    assert any(one.startswith(note) for one in content.summary.notes) == told
    assert told or content.summary.notes == ()


@pytest.mark.parametrize(("words", "told"), [(("Good", "Bad"), True), (("192", "0"), False)])
def test_a_mapping_that_takes_what_judges_for_a_signal_is_told(read: Read, words: tuple[str, str], told: bool) -> None:
    """The bad values come in with the good ones, and of words nothing comes of the signal either."""
    rows = "".join(f"{stamp},{i},{i % 7},{words[i % 5 == 0]}\n" for i, stamp in enumerate(STAMPS))
    text = f"time,A.PV,A.OP,Quality\n{rows}"
    assert refused(read(text)) == BAD_ROWS
    mapped = TagMapping.from_bytes(b"tag,loop,signal\nA.PV,A,PV\nA.OP,A,OP\nQuality,A,SP\n")
    content = read(text, mapping=mapped)
    assert refused(content) == []
    note = "the mapping has Quality as a signal: what it says of the values is not heeded"
    assert (note in content.summary.notes) == told
