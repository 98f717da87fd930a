"""Long tables without names: which column has the values, and which says how good they are."""

import numpy as np
import pytest

from app.errors import DataError

from .conftest import Read, in_pairs

STAMPS = [f"2026-03-01 00:{i:02d}:00" for i in range(40)]
BAD_ROWS = [7, 20]
VALUES = {"PV": [20.5 + 3 * np.sin(i) for i in range(40)], "OP": [40.25 + i % 7 for i in range(40)]}


def rows(form: str, good: str = "", bad: str = "") -> str:
    return "".join(
        form.format(
            number=2 * i + (signal == "OP"),
            tag=f"A.{signal}",
            time=stamp,
            date=stamp[:10],
            clock=stamp[11:],
            value=round(VALUES[signal][i], 3),
            quality=bad if i in BAD_ROWS else good,
        )
        + "\n"
        for i, stamp in enumerate(STAMPS)
        for signal in ("PV", "OP")
    )


@pytest.mark.parametrize("form", ["{tag};{time};{value};{quality}", "{quality};{tag};{time};{value}"])
@pytest.mark.parametrize(
    ("good", "bad"),
    [
        *(("Good", "Bad"), ("gut", "schlecht"), ("OK", "ERR"), ("G", "B"), ("Good [Limit]", "Bad [No Comm]")),
        ("192", "0"),
        ("192", "24"),
    ],
)
def test_qualities_are_known_by_what_they_are(read: Read, form: str, good: str, bad: str) -> None:
    content = read(rows(form, good, bad))
    assert content.summary.layout == "long_bare"
    for signal, values in (("PV", content.loops["A"].pv), ("OP", content.loops["A"].op)):
        kept = [value for i, value in enumerate(VALUES[signal]) if i not in BAD_ROWS]
        assert np.flatnonzero(np.isnan(values)).tolist() == BAD_ROWS
        assert values[~np.isnan(values)].tolist() == pytest.approx(kept, abs=6e-4)
    assert dict(content.rejects.counts) == {"bad_quality": 2 * len(BAD_ROWS)}


@pytest.mark.parametrize(
    ("form", "left"),
    [
        ("{number},{tag},{time},{value}", ""),
        ("{number},{tag},{time},192,{value}", ""),
        ("{tag},{time},100,{value}", "column 3"),
        ("{tag},{time},{value},{quality}", "column 4"),
        ("{tag},{time},{quality},{value}", "column 3"),
        ("{tag},{time},{value},Reactor", "column 4"),
    ],
)
def test_numbers_of_rows_and_codes_are_no_values(read: Read, form: str, left: str) -> None:
    content = read(rows(form, "100", "0"))
    assert content.loops["A"].pv.tolist() == pytest.approx(VALUES["PV"], abs=6e-4)
    told = f"columns beside tag, time and value were not read: {left}"
    assert [note for note in content.summary.notes if "not read" in note] == ([told] if left else [])


@pytest.mark.parametrize("code", ["1", "192", "Good"])
def test_a_value_may_rise_or_rest_beside_a_code(read: Read, code: str) -> None:
    rising = "".join(f"A.{s},{stamp},{i},{code}\n" for i, stamp in enumerate(STAMPS) for s in ("PV", "OP"))
    assert read(rising).loops["A"].pv.tolist() == list(range(40))
    resting = rows("{number},{tag},{time},5.5")
    assert read(resting).loops["A"].pv.tolist() == [5.5] * 40


@in_pairs(
    beside=["{ms}", "{batch}", "{falling}", "0", "0.5"],
    signals=[("50", "60"), ("{rising}", "60"), ("{rising}", "{rising}"), ("0", "0"), ("{digital}", "1"), ("192", "60")],
    samples=[60, 500],
)
def test_whole_values_that_rest_or_rise_go_before_what_stands_behind_them(
    read: Read, beside: str, signals: tuple[str, str], samples: int
) -> None:
    """Tag by tag, so that the first rows may be those of a tag alone."""
    table = ""
    values: dict[str, list[float]] = {"PV": [], "OP": []}
    for signal, form in zip(values, signals, strict=True):
        for k in range(samples):
            minute = f"2026-03-01 {k // 60:02d}:{k % 60:02d}:00"
            numbers = {"ms": k * 37 % 997, "batch": 4711 + k // 20, "falling": 9000 - k}
            value = form.format(rising=1000 + 3 * k, digital=int(k % 9 > 0))
            values[signal].append(float(value))
            table += f"A.{signal},{minute},{value},{beside.format(**numbers)}\n"
    content = read(table)
    assert content.loops["A"].pv.tolist() == values["PV"]
    assert content.loops["A"].op.tolist() == values["OP"]


def test_decimals_in_a_field_of_their_own_are_no_values(read: Read) -> None:
    lines = [f"A.{s},{stamp},50,{i % 10}{i % 7}" for i, stamp in enumerate(STAMPS) for s in ("PV", "OP")]
    with pytest.raises(DataError, match="decimals in a field of their own"):
        read("\n".join(lines) + "\n")


@pytest.mark.parametrize(
    "form",
    [
        "{date};{clock};{tag};{value}",
        "{tag};{date};{clock};{value};Good",
        "{number};{tag};{clock};{date};{value}",
        "{date};{clock};Plant-1;{tag};{value}",
    ],
)
def test_date_and_clock_apart_and_the_column_of_tags(read: Read, form: str) -> None:
    content = read(rows(form))
    assert list(content.loops) == ["A"]
    assert content.loops["A"].time_ns.astype("datetime64[ns]").astype(str)[9] == "2026-03-01T00:09:00.000000000"
    assert content.loops["A"].pv.tolist() == pytest.approx(VALUES["PV"], abs=6e-4)


def test_a_title_of_a_number_is_no_data_without_names(read: Read) -> None:
    lines = rows("{number},{date},{clock},5.5,7").splitlines(keepends=True)[::2]
    content = read("Tags,4\nNo,Date,Time,A.PV,A.OP\n" + "".join(lines))
    assert content.summary.layout == "wide"
    assert content.loops["A"].op.tolist() == [7] * 40


def test_a_title_of_a_time_above_data_without_names_is_one_ragged_row(read: Read) -> None:
    content = read("Export,2026-03-02 00:00:00\n" + rows("{tag},{time},{value}"))
    assert content.loops["A"].pv.tolist() == pytest.approx(VALUES["PV"], abs=6e-4)
    assert dict(content.rejects.counts) == {"ragged_row": 1}


@pytest.mark.parametrize("samples", [60, 500])
@pytest.mark.parametrize("in_turns", [True, False])
def test_names_of_attributes_beside_tags_are_no_tags(read: Read, samples: int, in_turns: bool) -> None:
    tags = {"X17": "PV.CV", "X18": "OUT.CV", "X19": "PV.CV"}
    lines = [
        (k, n, f"{tag},{attribute},2026-03-01 {k // 60:02d}:{k % 60:02d}:00,{n}.5")
        for n, (tag, attribute) in enumerate(tags.items())
        for k in range(samples)
    ]
    lines = sorted(lines) if in_turns else lines
    content = read("".join(f"{line}\n" for _, _, line in lines))
    assert list(content.loops) == list(tags)
