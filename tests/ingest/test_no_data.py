"""Numbers that stand for no data are refused where they stand apart; readings of the same numbers are kept."""

import numpy as np
import pytest

from app.ingest import IngestOptions

from .conftest import Content, Read

LAYOUTS = ("wide", "long")
CODES = ["-999", "-999.25", "9999", "-99999", "99999", "999999", "9999999", "32767", "-32768", "65535", "1E+38"]
CODES += ["3.4028235E+38", "-3.402823E38", "1e30", "-9999"]


def table(layout: str, values: list[str]) -> str:
    """OP is half its row's number and some noise."""
    stamps = [f"2026-03-01 {i // 60:02d}:{i % 60:02d}:00" for i in range(len(values))]
    if layout == "wide":
        rows = [f"{stamp},{value},{i / 2}" for i, (stamp, value) in enumerate(zip(stamps, values, strict=True))]
        return "\n".join(("Time,A.PV,A.OP", *rows)) + "\n"
    pairs = [f"A.PV,{s},{v}\nA.OP,{s},{i / 2}" for i, (s, v) in enumerate(zip(stamps, values, strict=True))]
    return "\n".join(("Tagname,TimeStamp,Value", *pairs)) + "\n"


def missing(content: Content) -> list[int]:
    return np.flatnonzero(np.isnan(content.loops["A"].pv)).tolist()


def around(middle: float, swing: float, n: int = 40) -> list[str]:
    return [f"{middle + swing * np.sin(i):.3f}" for i in range(n)]


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("code", CODES)
def test_a_code_that_stands_apart(read: Read, layout: str, code: str) -> None:
    values = around(50, 5)
    values[7] = values[8] = code
    content = read(table(layout, values))
    assert missing(content) == [7, 8]
    assert dict(content.rejects.counts) == {"sentinel": 2}
    (note,) = content.summary.notes
    assert note.startswith("numbers far from their tag's others")
    assert note.endswith(f"were refused as codes for no data: {float(code):g} (2)")


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize(
    ("code", "middle", "swing"),
    [
        ("9999", 10_000, 20),
        ("9999", 5_000, 100),
        ("65535", 20_000, 20_000),
        ("32767", 0, 8_000),
        ("-999", -900, 150),
        ("999", 50, 5),
    ],
)
def test_a_reading_that_is_near_its_like(read: Read, layout: str, code: str, middle: float, swing: float) -> None:
    values = around(middle, swing)
    values[7] = code
    content = read(table(layout, values))
    assert content.loops["A"].pv[7] == float(code)
    assert content.rejects.total == 0


@pytest.mark.parametrize("layout", LAYOUTS)
def test_several_codes(read: Read, layout: str) -> None:
    values = around(50, 5)
    values[3], values[9], values[20] = "3.4028235E+38", "32767", "-9999"
    assert missing(read(table(layout, values))) == [3, 9, 20]


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("code", [*CODES, "999.25", "-9999.25"])
def test_a_pv_that_has_nothing_else(read: Read, layout: str, code: str) -> None:
    content = read(table(layout, [code] * 9))
    pv = content.loops["A"].pv
    assert pv is None or np.isnan(pv).all()
    assert dict(content.rejects.counts) == {"sentinel": 9}
    assert content.rejects.listed[0].tag == "A.PV"


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_pv_that_stands_still_on_a_reading(read: Read, layout: str) -> None:
    assert read(table(layout, ["999"] * 9)).loops["A"].pv.tolist() == [999] * 9


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_set_point_that_has_nothing_else(read: Read, layout: str) -> None:
    text = table(layout, ["9999"] * 9).replace("A.PV", "A.SP")
    assert read(text).loops["A"].sp.tolist() == [9999] * 9
    text = table(layout, ["3.4028235E+38"] * 9).replace("A.PV", "A.SP")
    loop = read(text).loops["A"]
    assert loop.sp is None or np.isnan(loop.sp).all()


@pytest.mark.parametrize("layout", LAYOUTS)
def test_modes_are_no_codes(read: Read, layout: str) -> None:
    text = table(layout, around(50, 5)).replace("A.OP", "A.MODE")
    assert "sentinel" not in read(text).rejects.counts


def test_rows_of_codes_alone_are_judged_by_the_rows_before(read: Read) -> None:
    """A wide table of a plant has some minutes a chunk; a transmitter may be away for longer."""
    values = around(50, 5, 100)
    values[40:80] = ["32767"] * 40
    content = read(table("wide", values), options=IngestOptions(chunk_bytes=300))
    assert missing(content) == list(range(40, 80))
    assert content.rejects.counts["sentinel"] == 40


def test_rows_of_codes_alone_are_judged_by_the_rows_behind_them(read: Read) -> None:
    """A set point may stand on such a number, and is known not to from the first value that is far away."""
    values = ["32767"] * 40 + around(50, 5, 60)
    text = table("wide", values).replace("A.OP", "A.PV2").replace("A.PV,", "A.SP,").replace("A.PV2", "A.PV")
    content = read(text, options=IngestOptions(chunk_bytes=300))
    assert np.flatnonzero(np.isnan(content.loops["A"].sp)).tolist() == list(range(40))
    assert (content.rejects.counts["sentinel"], content.summary.values_kept) == (40, 160)
