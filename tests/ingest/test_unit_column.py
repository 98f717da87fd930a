"""Units beside the values of a long table: a value in another unit than its tag's is none of the same quantity."""

from collections.abc import Callable

import numpy as np
import pytest

from app.errors import DataError
from app.ingest import IngestOptions
from app.ingest.tables.beside_values import BesideValues
from app.ingest.tables.cells import Cells

from .conftest import Read

STAMPS = np.datetime_as_string(np.datetime64("2024-03-01T00:00:00") + np.arange(600)).tolist()
Name = Callable[[int], str]


def table(unit: Name, name: str = "UOM", by_tag: bool = False) -> str:
    cells = [(k, tag) for k in range(600) for tag in ("TIC1.PV", "TIC1.OP")]
    cells = sorted(cells, key=lambda cell: cell[1]) if by_tag else cells
    rows = (f"{tag},{STAMPS[k]},{k},{unit(k) if tag == 'TIC1.PV' else '%'}" for k, tag in cells)
    return "\n".join((f"Tag,Time,Value,{name}", *rows)) + "\n"


@pytest.mark.parametrize("options", [IngestOptions(), IngestOptions(chunk_bytes=3000)])
@pytest.mark.parametrize("by_tag", [False, True])
@pytest.mark.parametrize(
    ("name", "unit"), [("UOM", ("degC", "degF")), ("Unit", ("%", "ppm")), ("EngUnits", ("%", "-"))]
)
def test_values_in_another_unit_are_refused(
    read: Read, name: str, unit: tuple[str, str], by_tag: bool, options: IngestOptions
) -> None:
    content = read(table(lambda k: unit[k >= 400], name, by_tag), options=options)
    loop = content.loops["TIC1"]
    assert loop.pv[:400].tolist() == list(range(400))
    assert np.isnan(loop.pv[400:]).all()
    assert loop.op.tolist() == list(range(600))
    assert dict(content.rejects.counts) == {"other_unit": 200}
    assert content.rejects.listed[0].text == f"in {unit[1]}, and its tag is in {unit[0]}"
    assert dict(content.summary.units) == {"TIC1.PV": unit[0], "TIC1.OP": "%"}


@pytest.mark.parametrize(
    "written",
    [
        ("degC", "\N{DEGREE SIGN}C"),
        ("degC", "\N{MASCULINE ORDINAL INDICATOR}C", "Deg. C", "C", "\N{DEGREE CELSIUS}"),
        ("barg", "bar(g)", "BAR G"),
        ("kg/h", "kg/hr", "kg/hour"),
        ("m3/h", "m\N{SUPERSCRIPT THREE}/h", "m^3/h"),
        ("%", "pct", "percent"),
        ("degC", "", "degC"),
        ("n/a", "N/A", "degC", "null", "none"),
    ],
)
def test_one_unit_written_in_two_ways_or_left_out(read: Read, written: tuple[str, ...]) -> None:
    content = read(table(lambda k: written[k % len(written)]))
    assert content.loops["TIC1"].pv.tolist() == list(range(600))
    assert content.rejects.total == 0


def test_a_column_of_plants_is_none_of_units(read: Read) -> None:
    content = read(table(lambda k: f"U{k // 300}", "Unit"))
    assert content.loops["TIC1"].pv.tolist() == list(range(600))


def test_loops_and_words_in_two_columns(read: Read) -> None:
    lines = [
        f"TIC1,{word},{stamp},{k},{('degC', 'degF')[k >= 400] if word == 'PV' else '%'}"
        for k, stamp in enumerate(STAMPS)
        for word in ("PV", "OP")
    ]
    content = read("\n".join(("Element,Attribute,Timestamp,Value,UOM", *lines)) + "\n")
    assert np.flatnonzero(np.isnan(content.loops["TIC1"].pv)).tolist() == list(range(400, 600))
    assert dict(content.rejects.counts) == {"other_unit": 200}


@pytest.mark.parametrize("column", ["UOM", "svalue"])
def test_a_file_of_too_many_tags_is_left_where_they_are_too_many(
    read: Read, monkeypatch: pytest.MonkeyPatch, column: str
) -> None:
    """And not gone through to its end first, with something kept of each tag."""
    seen: list[Cells] = []
    see = BesideValues.see
    monkeypatch.setattr(BesideValues, "see", lambda self, cells: (seen.append(cells), see(self, cells))[1])
    rows = "".join(f"L{k}.PV,{STAMPS[k]},{k},bar\n" for k in range(600))
    with pytest.raises(DataError) as refused:
        read(f"Tag,Time,Value,{column}\n{rows}", options=IngestOptions(chunk_bytes=3000, max_signals=200))
    assert refused.value.code == "too_many_tags"
    assert 0 < sum(cells.rows.height for cells in seen) <= 200
