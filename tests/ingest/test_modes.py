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


AUTOMATIC = ("1.AUTO", "MODE_AUTO", "B-AUTO", "Automático", "AUTO(1)", "1 - Auto", "automatique", "SPC", "AUT;NR", "8")
AUTOMATIC += ("LOC AUTO", "REMOTE AUTO", "Automatik", "CAS", "1", "1.0", "2", "3", "4", "true")
MANUAL = ("0.MAN", "MODE_MAN", "B-MAN", "MAN(0)", "0 - Man", "manuel", "LOCAL MANUAL", "Hand", "16", "O/S", "0", "off")
MANUAL += ("32", "64", "128")
OTHERS = ("LOCAL", "AUTO_MAN", "NOT AUTO", "AUTO OFF", "A/M", "Auto disabled", "Normal", "17", "-1")


@pytest.mark.parametrize(("words", "flag"), [(AUTOMATIC, 1.0), (MANUAL, 0.0), (OTHERS, UNKNOWN_MODE)])
def test_words_and_numbers(words: tuple[str, ...], flag: float) -> None:
    flags = automatic_flags(pl.Series(words))
    assert dict(zip(words, flags.tolist(), strict=True)) == dict.fromkeys(words, flag)


@pytest.mark.parametrize("word", ["", " ", "-", "NaN", "null", None])
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


def test_without_any_mode_that_is_understood_none_was_recorded(tmp_path: Path) -> None:
    assert automatic(tmp_path, wide("Ramp", "Ramp", "")) is None


def test_words_are_kept_in_bounds() -> None:
    met = ModesMet()
    for start in range(0, 10_000, 100):
        met.of_texts(pl.Series([f"word {k}x" for k in range(start, start + 100)]))
    assert len(met.unknown) <= 1000
    assert met.notes()[0].endswith(", ...")
