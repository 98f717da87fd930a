"""Words of states that stand beside numbers, as in PI's tag, time, value, svalue, status."""

from collections.abc import Callable

import pytest

from .conftest import Content, Read

HEADING = "tag;time;value;svalue;status"
ROWS = 60
Row = Callable[[int], str]


def numbers(k: int) -> str:
    return f"{k % 9}.5;"


def modes(k: int) -> str:
    """0 of the list of states is automatic, 1 manual."""
    return "0;AUTO" if k < 40 else "1;MAN"


def table(heading: str = HEADING, status: str = ";0", **tags: Row) -> str:
    rows = [
        f"FIC101.{tag};31-Jan-24 06:{k // 60:02d}:{k % 60:02d};{row(k)}{status}"
        for k in range(ROWS)
        for tag, row in {"PV": numbers, "OP": numbers, **tags}.items()
    ]
    return "\n".join((heading, *rows)) + "\n"


def automatic(content: Content) -> list[float]:
    found = content.loops["FIC101"].automatic
    assert found is not None
    return found.tolist()


@pytest.mark.parametrize("time", ["time", "pictime"])
@pytest.mark.parametrize("words", ["svalue", "StringValue", "digstring"])
def test_modes_are_what_their_words_say(read: Read, time: str, words: str) -> None:
    content = read(table(f"tag;{time};value;{words};status", MODE=modes))
    assert automatic(content) == [1.0] * 40 + [0.0] * 20
    assert content.rejects.counts == {}
    assert not [note for note in content.summary.notes if words in note]


def test_modes_that_have_words_alone(read: Read) -> None:
    content = read(table(MODE=lambda k: ";AUTO" if k < 40 else ";MAN"))
    assert automatic(content) == [1.0] * 40 + [0.0] * 20


def test_modes_that_have_numbers_alone(read: Read) -> None:
    content = read(table(MODE=lambda k: "1;" if k < 40 else "0;NULL"))
    assert automatic(content) == [1.0] * 40 + [0.0] * 20


def test_aveva_has_words_in_vvalue(read: Read) -> None:
    rows = [
        f"2024-01-31 06:00:{k:02d},FIC101.{tag},{value},{word},0,192,192"
        for k in range(ROWS)
        for tag, value, word in (("PV", k, k), ("OP", k, k), ("MODE", "NULL", "AUTO" if k < 40 else "MAN"))
    ]
    content = read("DateTime,TagName,Value,vValue,Quality,QualityDetail,OPCQuality\n" + "\n".join(rows))
    assert automatic(content) == [1.0] * 40 + [0.0] * 20


@pytest.mark.parametrize("number", ["", "-254"])
def test_a_word_beside_a_measurement_says_why_there_is_none(read: Read, number: str) -> None:
    content = read(table("tag;time;value;svalue", "", PV=lambda k: f"{number};I/O Timeout" if k == 7 else numbers(k)))
    (reject,) = content.rejects.listed
    assert (reject.code, reject.text, reject.tag) == ("not_a_number", "I/O Timeout", "FIC101.PV")
    pv = content.loops["FIC101"].pv
    assert pv is not None
    assert [str(value) for value in pv[6:9]] == ["6.5", "nan", "8.5"]


def test_words_beside_all_numbers_leave_them(read: Read) -> None:
    content = read(table(PV=lambda k: f"{k % 9}.5;{k % 9}.5 t/h", RUNS=lambda k: f"{k % 2};{('OFF', 'ON')[k % 2]}"))
    loop = content.loops["FIC101"]
    assert loop.pv is not None
    assert loop.pv.tolist() == [k % 9 + 0.5 for k in range(ROWS)]
    assert content.loops["FIC101.RUNS"].others["FIC101.RUNS"].tolist() == [float(k % 2) for k in range(ROWS)]
    assert content.rejects.counts == {}


def test_columns_that_are_called_after_their_table(read: Read) -> None:
    content = read(table(";".join(f"picomp2.{name}" for name in HEADING.split(";")), MODE=modes))
    assert content.loops["FIC101"].samples == ROWS


def test_a_loop_before_all_names_is_no_table(read: Read) -> None:
    rows = "\n".join(f"2024-01-31 06:00:{k:02d},{k % 9},{k % 7}" for k in range(ROWS))
    content = read(f"FIC7.Time,FIC7.PV,FIC7.OP\n{rows}\n")
    assert content.loops["FIC7"].op is not None


def text_of(k: int) -> str:
    """The number once more, with its thousands parted, its unit or its bound, in few of the rows."""
    return {0: "1,059.4", 1: "1.059,4", 2: "59.4 t/h", 3: "<59.4"}.get(k % 10, "")


def test_numbers_that_are_written_otherwise_beside_them_are_no_words(read: Read) -> None:
    content = read(table("tag;time;value;StringValue", "", PV=lambda k: f"{k % 9}.4375;{text_of(k)}"))
    pv = content.loops["FIC101"].pv
    assert pv is not None
    assert pv.tolist() == [k % 9 + 0.4375 for k in range(ROWS)]
    assert content.rejects.counts == {}


def beside(word: str, number: Row) -> str:
    """PV with a word in every tenth row, and the number that stands beside it."""
    return table("tag;time;value;TextValue", "", PV=lambda k: f"{number(k)};{word}" if k % 10 == 3 else numbers(k))


@pytest.mark.parametrize("word", ["High", "shift change", "Alarm ack"])
def test_alarms_and_remarks_beside_numbers_that_go_on_leave_them(read: Read, word: str) -> None:
    content = read(beside(word, lambda k: f"{k % 9}.5"))
    pv = content.loops["FIC101"].pv
    assert pv is not None
    assert pv.tolist() == [k % 9 + 0.5 for k in range(ROWS)]
    assert content.rejects.counts == {}


def test_an_alarm_beside_a_set_point_that_rests_leaves_it(read: Read) -> None:
    tags = {tag: lambda k: f"{k % 9}.5;{'High' if k % 10 == 3 else ''}" for tag in ("PV", "OP")}
    content = read(table("tag;time;value;TextValue", "", **tags, SP=lambda k: f"50;{'High' if k % 10 == 3 else ''}"))
    sp = content.loops["FIC101"].sp
    assert sp is not None
    assert sp.tolist() == [50.0] * ROWS
    assert content.rejects.counts == {}


@pytest.mark.parametrize("number", ["", "248", "5.5"])
def test_a_word_beside_the_same_number_says_why_there_is_none(read: Read, number: str) -> None:
    content = read(beside("Scan stopped", lambda k: number))
    assert content.rejects.counts == {"not_a_number": 6}


def test_a_word_for_no_data_does_so_beside_numbers_that_go_on(read: Read) -> None:
    content = read(beside("Scan Off", lambda k: f"{k % 9}.5"))
    assert content.rejects.counts == {"not_a_number": 6}


@pytest.mark.parametrize(
    "word",
    [
        *("Sensor Failure", "Invalid", "OPC Bad", "Error 5", "Not Available", "Offline", "No signal", "Stale"),
        *("Out of Service", "Over Range", "Device Fault", "Disconnected", "Substituted", "Manual Entry", "Lost"),
        *("Störung", "Drahtbruch", "Ausfall", "ungültig", "Fehler", "Kein Signal", "Défaut", "Hors service"),
        *("Invalide", "Comm Loss", "Wire break"),
    ],
)
def test_a_word_for_a_fault_does_so_beside_numbers_that_go_on(read: Read, word: str) -> None:
    content = read(beside(word, lambda k: f"{k % 9}.5"))
    assert content.rejects.counts == {"not_a_number": 6}


@pytest.mark.parametrize("word", ["HiHi", "Low alarm", "Terror drill", "Glossy sheet", "Feed changed to tank 7"])
def test_remarks_in_which_such_a_word_is_a_part_of_another_leave_them(read: Read, word: str) -> None:
    assert read(beside(word, lambda k: f"{k % 9}.5")).rejects.counts == {}


def test_modes_with_their_number_before_the_word(read: Read) -> None:
    content = read(table(MODE=lambda k: "0;1 AUTO" if k < 40 else "1;0 MAN"))
    assert automatic(content) == [1.0] * 40 + [0.0] * 20


@pytest.mark.parametrize("number", ["", "-254"])
@pytest.mark.parametrize("word", ["####", "I/O Timeout"])
def test_signs_beside_a_measurement_say_why_there_is_none_too(read: Read, number: str, word: str) -> None:
    content = read(table("tag;time;value;svalue", "", PV=lambda k: f"{number};{word}" if k == 7 else numbers(k)))
    assert content.rejects.counts == {"not_a_number": 1}
