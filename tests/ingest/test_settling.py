"""What tags tell only beside each other: bare tags, words without a separator, blocks of a module."""

import pytest

from app.ingest import IngestOptions, LoopTags, TagMapping, group, names_no_measurement

from .conftest import Read

BARE = "read as the PV of the loop of its name, which has OP and no other: "
JOINED = "names that end in PV and OP without a separator were read as: "
BLOCKS = "blocks of one module, one with PV and one with OP, were read as one loop: "


def wide(*tags: str) -> str:
    rows = ("".join(f",{10 * k + i}" for k in range(len(tags))) for i in range(9))
    return f"Time,{','.join(tags)}\n" + "".join(f"2024-03-01 00:0{i}:00{row}\n" for i, row in enumerate(rows))


def long(*tags: str) -> str:
    rows = (f"{tag},2024-03-01 00:0{i}:00,{10 * k + i}\n" for i in range(9) for k, tag in enumerate(tags))
    return "Tagname,TimeStamp,Value\n" + "".join(rows)


@pytest.mark.parametrize(
    ("tags", "expected"),
    [
        (["FIC101", "FIC101.OP", "FIC101.SP"], LoopTags("FIC101", "FIC101", "FIC101.OP", "FIC101.SP")),
        (["FIC101.OP", "fic101 t/h"], LoopTags("FIC101", "fic101 t/h", "FIC101.OP")),
        ([r"\\S\FIC101", r"\\S\FIC101.OP"], LoopTags("FIC101", r"\\S\FIC101", r"\\S\FIC101.OP")),
        (["FIC101PV", "FIC101OP", "FIC101SP"], LoopTags("FIC101", "FIC101PV", "FIC101OP", "FIC101SP")),
        (["fic101apv", "fic101amv [%]"], LoopTags("fic101a", "fic101apv", "fic101amv [%]")),
        (["FIC101PV", "FIC101OP", "FIC101.MODE"], LoopTags("FIC101", "FIC101PV", "FIC101OP", mode="FIC101.MODE")),
        (["FIC101.DACA.PV", "FIC101.PIDA.OP", "FIC101.PIDA.SP"], LoopTags("FIC101", "FIC101.DACA.PV", "FIC101.PIDA.OP",
        "FIC101.PIDA.SP")),
        (["F-1/AI1/PV.CV", "F-1/PID1/OUT.CV", "F-1/PID1/MODE.CV"], LoopTags("F-1", "F-1/AI1/PV.CV", "F-1/PID1/OUT.CV",
        mode="F-1/PID1/MODE.CV")),
    ],
)  # fmt: skip
@pytest.mark.parametrize("values", [10, 12_000_000])
@pytest.mark.parametrize("layout", [wide, long])
def test_one_loop(read: Read, layout, tags: list[str], expected: LoopTags, values: int) -> None:
    assert set(group(tags)) == {expected}
    content = read(layout(*tags), options=IngestOptions(buffered_values=values))
    assert content.summary.loops == (expected,)
    loop = content.loops[expected.loop]
    assert loop.pv.tolist() == [10 * tags.index(expected.pv) + i for i in range(9)]
    assert loop.op.tolist() == [10 * tags.index(expected.op) + i for i in range(9)]


@pytest.mark.parametrize(
    ("tags", "note"),
    [
        (["FIC101", "FIC101.OP"], f"{BARE}FIC101 (PV of FIC101)"),
        (["FIC101PV", "FIC101OP"], f"{JOINED}FIC101PV (PV of FIC101), FIC101OP (OP of FIC101)"),
        (["F1.DACA.PV", "F1.PIDA.OP"], f"{BLOCKS}F1.DACA.PV (PV of F1), F1.PIDA.OP (OP of F1)"),
    ],
)
@pytest.mark.parametrize("layout", [wide, long])
def test_it_is_told(read: Read, layout, tags: list[str], note: str) -> None:
    assert read(layout(*tags)).summary.notes == (note,)


@pytest.mark.parametrize(
    "tags",
    [
        ["FIC101", "FIC101.SP"],
        ["FIC101", "FIC101.PV", "FIC101.OP"],
        ["FIC101", "FIC102.OP"],
        ["FIC101PV", "FIC101SP"],
        ["FIC101.DACA.PV", "FIC101.PIDA.PV", "FIC101.PIDA.OP"],
        ["F-1/AI1/PV.CV", "F-1/PID1/OUT.CV", "F-1/PID2/OUT.CV"],
        ["F-1/AI1/PV.CV", "F-1/AI2/PV.CV", "F-1/PID1/OUT.CV"],
        ["F-1/AI1/PV.CV", "F-1/PID1/OUT.CV", "F-1/PV.CV"],
        ["F1.MAIN.PV", "F1.SIDE.OP"],
    ],
)
@pytest.mark.parametrize("layout", [wide, long])
def test_where_it_is_not_told_names_stay_apart(read: Read, layout, tags: list[str]) -> None:
    notes = read(layout(*tags)).summary.notes
    assert not any(note.startswith((BARE, JOINED, BLOCKS)) for note in notes)


def test_what_a_mapping_says_stays() -> None:
    mapping = TagMapping.from_bytes(b"tag,loop,signal\nF1,F1,OTHER\nF2.DACA.PV,F2.DACA,PV\n")
    assert group(["F1", "F1.OP"], mapping) == (LoopTags("F1", op="F1.OP", others=("F1",)),)
    assert {loop.loop for loop in group(["F2.DACA.PV", "F2.PIDA.OP"], mapping)} == {"F2.DACA", "F2.PIDA"}


@pytest.mark.parametrize("word", ["ERR", "Error", "DEV", "DESC", "Description"])
def test_control_errors_and_descriptions_are_no_loops(read: Read, word: str) -> None:
    rows = [f"2026-01-01 00:{k:02d}:00,{k}.5,{k % 7},{k % 3},{k % 5}" for k in range(40)]
    content = read(f"Time,FIC101.PV,FIC101.OP,FIC101.{word},FIC102.{word}\n" + "\n".join(rows))
    assert list(content.loops) == ["FIC101", f"FIC102.{word}"], "one beside no signals of its loop stays what it is"
    assert list(content.loops["FIC101"].others) == [f"FIC101.{word}"]
    assert any("beside the signals of their loops" in note for note in content.summary.notes)
    long = [f"FIC101.{s},2026-01-01 00:{k:02d}:00,{k % 7}" for s in ("PV", "OP", word) for k in range(40)]
    assert list(read("Tag,Time,Value\n" + "\n".join(long)).loops) == ["FIC101"]
    assert names_no_measurement(f"FIC101.{word}")
