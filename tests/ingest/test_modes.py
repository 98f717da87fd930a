"""Modes in words and numbers: automatic, manual, or not understood."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from app.ingest import IngestOptions, read_recordings
from app.ingest.tags.modes import UNKNOWN_MODE, ModesMet, automatic_flags

from .conftest import Read

STAMPS = [f"2026-03-01 00:0{i}:00" for i in range(9)]


def wide(*modes: str) -> str:
    return "Time,A.PV,A.OP,A.MODE\n" + "".join(
        f"{stamp},{i},1{i},{mode}\n" for i, (stamp, mode) in enumerate(zip(STAMPS, modes, strict=False))
    )


def long(*modes: str, tags: tuple[str, ...] = ("A.PV", "A.OP")) -> str:
    rows = zip(STAMPS, modes, strict=False)
    return "Tagname,TimeStamp,Value\n" + "".join(
        "".join(f"{tag},{stamp},{i}.5\n" for tag in tags) + f"A.MODE,{stamp},{mode}\n"
        for i, (stamp, mode) in enumerate(rows)
    )


AUTOMATIC = ("1.AUTO", "MODE_AUTO", "B-AUTO", "Automático", "AUTO(1)", "1 - Auto", "automatique", "SPC", "AUT;NR")
AUTOMATIC += ("LOC AUTO", "REMOTE AUTO", "Automatik", "CAS", "1", "1.0", "2", "3", "4", "true")
AUTOMATIC += ("自动", "自動", "串级", "1-自动", "Авто", "Каскад", "Автоматический")
MANUAL = ("0.MAN", "MODE_MAN", "B-MAN", "MAN(0)", "0 - Man", "manuel", "LOCAL MANUAL", "Hand", "128", "O/S", "0", "off")
MANUAL += ("手动", "手動", "0 手动", "Ручной", "РУЧНОЙ", "Руч.")
AUTOMATIC += ("RSP", "Remote SP", "remote set point", "P-AUTO", "Lokal Automatik", "Automatikbetrieb")
MANUAL += ("P-MAN", "Lokal Hand", "Forced Manual")
OTHERS = (
    "LOCAL",
    "Lokal",
    "Shutdown",
    "badge",
    "AUTO/MAN",
    "AUTO_MAN",
    "NOT AUTO",
    "AUTO OFF",
    "A/M",
    "Auto disabled",
    "Normal",
    "17",
    "-1",
)
OTHERS += ("自动手动", "Авто/Руч")


@pytest.mark.parametrize(("words", "flag"), [(AUTOMATIC, 1.0), (MANUAL, 0.0), (OTHERS, UNKNOWN_MODE)])
def test_words_and_numbers(words: tuple[str, ...], flag: float) -> None:
    flags = automatic_flags(pl.Series(words))
    assert dict(zip(words, flags.tolist(), strict=True)) == dict.fromkeys(words, flag)


NO_DATA = ("I/O Timeout", "No Data", "Bad", "BAD INPUT", "Bad_Quality", "Comm Fail", "Scan Off", "#N/A", "Pt Created")


@pytest.mark.parametrize("word", ["", " ", "-", "NaN", "null", None, *NO_DATA])
def test_nothing_written(word: str | None) -> None:
    assert np.isnan(automatic_flags(pl.Series([word], dtype=pl.String))).all()


@pytest.mark.parametrize("layout", [wide, long])
@pytest.mark.parametrize("chunk_bytes", [16 << 20, 120])
def test_words_that_are_not_understood_are_told(read: Read, layout, chunk_bytes: int) -> None:
    text = layout("AUTO", "LOCAL", "LOCAL", "MAN", "Ramp")
    content = read(text, options=IngestOptions(chunk_bytes=chunk_bytes))
    assert content.loops["A"].automatic.tolist() == [1, -1, -1, 0, -1]
    assert dict(content.rejects.counts) == {"unknown_mode": 3}
    note = "modes that are not understood count neither as automatic nor as manual: LOCAL (2), Ramp (1)"
    assert content.summary.notes == (note,)


@pytest.mark.parametrize("layout", [wide, long])
def test_numbers(read: Read, layout) -> None:
    content = read(layout("8", "16", "4", "17", "0"))
    assert content.loops["A"].automatic.tolist() == [1, 0, 1, -1, 0]
    assert [(reject.code, reject.text) for reject in content.rejects.listed] == [("unknown_mode", "17")]
    assert content.summary.notes == (
        "modes as numbers other than 0 and 1 were read as: 4 automatic, 8 automatic, 16 manual",
        "modes that are not understood count neither as automatic nor as manual: 17 (1)",
    )


DELTAV = {0: 0, 1: 0, 2: 0, 4: 0, 8: 0, 16: 1, 32: 1, 48: 1, 64: 1, 80: 1, 128: 0, 144: 0, 3: -1}
FIELDBUS = {0: 0, 1: 0, 2: 1, 4: 1, 8: 1, 16: 0, 32: 0, 64: 0, 128: 0, 3: -1}


@pytest.mark.parametrize(
    ("tag", "flags"),
    [
        *((f"FIC-101/PID1/MODE.{end}", DELTAV) for end in ("ACTUAL", "TARGET", "CV")),
        ("fic-101/pid1/mode.actual", DELTAV),
        ("FIC-101.MODE_BLK.ACTUAL", FIELDBUS),
    ],
)
def test_bits_by_the_name(tag: str, flags: dict[int, int]) -> None:
    met = ModesMet()
    for number, flag in flags.items():
        assert met.flags(met.of_numbers(np.array([float(number)]), tag), tag).tolist() == [flag]
        assert met.flags(met.of_texts(pl.Series([str(number)]), tag), tag).tolist() == [flag]


@pytest.mark.parametrize(
    ("modes", "flags"),
    [
        ((8, 16, 48), [0, 1, 1]),
        ((8, 16, 80), [0, 1, 1]),
        ((8, 16, 144), [0, 1, 0]),
        ((8, 16, 4), [1, 0, 1]),
        ((8, 16), [-1, -1]),
        ((16,), [-1]),
        ((8, 16, 32), [-1, -1, -1]),
        ((8, 1, 0, 128), [-1, 0, 0, 0]),
    ],
)
@pytest.mark.parametrize("layout", [wide, long])
def test_bits_by_what_stands_beside_them(read: Read, layout, modes: tuple[int, ...], flags: list[int]) -> None:
    assert read(layout(*map(str, modes))).loops["A"].automatic.tolist() == flags


@pytest.mark.parametrize("layout", [wide, long])
def test_bits_of_which_nothing_tells_whose_they_are(read: Read, layout) -> None:
    content = read(layout("8", "16", "16"))
    assert content.summary.notes == (
        "nothing tells whether modes are counted as in DeltaV (8 MAN, 16 AUTO) or in FOUNDATION Fieldbus "
        "(8 AUTO, 16 MAN): A.MODE",
        "modes that are not understood count neither as automatic nor as manual: 16 (2), 8 (1)",
        "not one mode of these tags is understood, and their loops are judged as if no mode had been recorded, unless "
        "other files have some: A.MODE",
    )


@pytest.mark.parametrize(
    ("modes", "flags"),
    [
        ((2, 4, 1, 16, 48), [0, 0, 0, 1, 1]),
        ((16, 8, 2, 8, 4), [0, 1, 1, 1, 1]),
        ((2, 4, 1, 3, 2), [1, 1, 1, 1, 1]),
        ((2, 4, 3, 16, 48), [0, 0, -1, 1, 1]),
        ((8, 16, 0, 16, 8), [-1, -1, 0, -1, -1]),
    ],
)
@pytest.mark.parametrize("layout", [wide, long])
@pytest.mark.parametrize("options", [IngestOptions(chunk_bytes=30), IngestOptions(chunk_bytes=30, buffered_values=4)])
def test_what_a_later_chunk_tells(read: Read, layout, modes, flags: list[int], options: IngestOptions) -> None:
    content = read(layout(*map(str, modes)), options=options)
    assert content.loops["A"].automatic.tolist() == flags
    unknown = [str(mode) for mode, flag in zip(modes, flags, strict=True) if flag == -1]
    assert [reject.text for reject in content.rejects.listed] == unknown
    whole = read(layout(*map(str, modes)))
    assert (whole.rejects, whole.summary.notes) == (content.rejects, content.summary.notes)


def test_more_modes_that_are_not_understood_than_lines_are_held(read: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.ingest.tags.modes.MOST_LINES", 3)
    content = read(wide("8", "16", "8", "16", "8"), options=IngestOptions(chunk_bytes=30))
    assert dict(content.rejects.counts) == {"unknown_mode": 5}
    assert [(reject.line, reject.text) for reject in content.rejects.listed] == [(2, "8"), (3, "16"), (4, "8")]


def test_each_tag_of_a_long_table_counts_for_itself(read: Read) -> None:
    tags = {"A/MODE.ACTUAL": 16, "B.MODE": 4, "C/MODE.ACTUAL": 8}
    rows = [(tag, stamp, mode) for stamp in STAMPS for tag, mode in tags.items()]
    rows += [(f"{loop}.{signal}", stamp, 1.5) for stamp in STAMPS for loop in "ABC" for signal in ("PV", "OP")]
    rows += [("B.MODE", "2026-03-01 00:09:00", 8), ("B.PV", "2026-03-01 00:09:00", 2)]
    text = "Tagname,TimeStamp,Value\n" + "".join(f"{tag},{stamp},{value}\n" for tag, stamp, value in rows)
    content = read(text)
    assert {loop: set(samples.automatic.tolist()) for loop, samples in content.loops.items()} == {
        "A": {1.0},
        "B": {1.0},
        "C": {0.0},
    }
    assert content.summary.notes[0] == (
        "modes as numbers other than 0 and 1 were read as: 4 automatic, 8 manual, 8 automatic, 16 automatic"
    )


def automatic(tmp_path: Path, text: str) -> list[bool] | None:
    path = tmp_path / "a.csv"
    path.write_text(text)
    (recording,) = read_recordings(path).recordings
    return None if recording.automatic is None else recording.automatic.tolist()


@pytest.mark.parametrize("layout", [wide, long])
def test_a_recording_is_not_automatic_in_a_mode_that_is_not_understood(tmp_path: Path, layout) -> None:
    assert automatic(tmp_path, layout("AUTO", "LOCAL", "LOCAL", "AUTO")) == [True, False, False, True]
    assert automatic(tmp_path, layout("Ramp", "Ramp", "MAN", "AUTO")) == [False, False, False, True]


def test_a_mode_that_is_not_understood_goes_on_until_the_next_one(tmp_path: Path) -> None:
    assert automatic(tmp_path, wide("AUTO", "", "LOCAL", "", "AUTO", "")) == [True, True, False, False, True, True]


@pytest.mark.parametrize("layout", [wide, long])
def test_of_a_recording_of_which_no_mode_is_understood_none_is_known(tmp_path: Path, layout) -> None:
    assert automatic(tmp_path, layout("Ramp", "Ramp", "Soak")) is None
    assert automatic(tmp_path, layout("Ramp", "Bad", "MAN")) == [False, False, False]


@pytest.mark.parametrize("layout", [wide, long])
@pytest.mark.parametrize("chunk_bytes", [16 << 20, 120])
def test_tags_of_which_no_mode_is_understood_are_told(read: Read, layout, chunk_bytes: int) -> None:
    def notes(*modes: str) -> list[str]:
        told = read(layout(*modes), options=IngestOptions(chunk_bytes=chunk_bytes)).summary.notes
        return [note.rsplit(": ", 1)[1] for note in told if note.startswith("not one mode of these tags")]

    assert notes("Ramp", "Soak", "Ramp", "17") == ["A.MODE"]
    assert notes("Ramp", "Bad", "", "Ramp") == ["A.MODE"]
    assert notes("Ramp", "Ramp", "Ramp", "0") == notes("Ramp", "", "Auto") == notes("Ramp", "", "2") == []
    assert notes("Bad", "", "Bad", "No Data") == []


@pytest.mark.parametrize("layout", [wide, long])
def test_words_of_a_historian_without_a_value_are_refused_and_leave_the_mode(
    read: Read, tmp_path: Path, layout
) -> None:
    modes = ("AUTO", "I/O Timeout", "MAN", "No Data", "AUTO", "Bad")
    content = read(layout(*modes))
    assert [(reject.code, reject.text) for reject in content.rejects.listed] == [
        ("not_a_number", word) for word in ("I/O Timeout", "No Data", "Bad")
    ]
    assert not content.summary.notes
    assert automatic(tmp_path, layout(*modes)) == [True, True, False, False, True, True]


def test_without_any_mode_that_is_written_none_was_recorded(tmp_path: Path) -> None:
    assert automatic(tmp_path, wide("", "-", "")) is None


def test_words_are_kept_in_bounds() -> None:
    met = ModesMet()
    for start in range(0, 10_000, 100):
        met.of_texts(pl.Series([f"word {k}x" for k in range(start, start + 100)]), "A.MODE")
    assert len(met.unknown) <= 1000
    assert met.notes()[0].endswith(", ...")


@pytest.mark.parametrize(
    ("word", "texts"),
    [
        *(("MA", ("1", "0")), ("AM", ("1", "0")), ("AUTO", ("TRUE", "FALSE")), ("auto", ("1", "0"))),
        *(("MANUAL", ("0", "1")), ("MANUAL", ("False", "True")), ("Manual", ("Auto", "Man"))),
    ],
)
def test_switches_of_automatic_and_of_manual(read: Read, word: str, texts: tuple[str, str]) -> None:
    rows = "".join(f"2024-01-31 06:00:{k:02d},{k},{k + 40},{texts[k % 3 == 0]}\n" for k in range(60))
    content = read(f"Time,CP01:FIC101.MEAS,CP01:FIC101.OUT,CP01:FIC101.{word}\n{rows}")
    assert content.loops["CP01:FIC101"].automatic.tolist() == [float(k % 3 > 0) for k in range(60)]


@pytest.mark.parametrize("tag", ["FIC101.ma", "FIC101_MA", "FIC101.PV.MA", "FIC101.PV_AUTO"])
def test_a_current_is_no_mode(read: Read, tag: str) -> None:
    rows = "".join(f"2024-01-31 06:00:{k:02d},{k},{k + 40},{k % 9 + 4}\n" for k in range(60))
    assert read(f"Time,FIC101.PV,FIC101.OP,{tag}\n{rows}").loops["FIC101"].automatic is None


def test_the_switch_of_a_controller_of_pcs_7_is_its_mode(read: Read) -> None:
    rows = (f"2026-03-01 00:00:{k:02d},5{k % 7}.5,4{k % 5}.5,{k // 30}" for k in range(60))
    names = "Time,FIC1/PID.PV_IN,FIC1/PID.LMN,FIC1/PID.QMAN_AUT"
    loop = read("\n".join((names, *rows, ""))).loops["FIC1/PID"]
    assert loop.automatic.tolist() == [0.0] * 30 + [1.0] * 30
