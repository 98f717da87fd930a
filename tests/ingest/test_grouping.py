"""Tags into loops."""

from pathlib import Path

import pytest

from app.errors import DataError
from app.ingest import IngestOptions, LoopTags, TagMapping, group, read_export, unit_of, without_unit
from app.ingest.tags.grouping import place

from .conftest import Read


@pytest.mark.parametrize(
    ("tags", "expected"),
    [
        (["FIC101.PV", "FIC101.OP", "FIC101.SP", "FIC101.MODE"], LoopTags("FIC101", "FIC101.PV", "FIC101.OP",
        "FIC101.SP", "FIC101.MODE")),
        (["F1_MEAS", "F1_OUT", "F1_SETP", "F1_MD"], LoopTags("F1", "F1_MEAS", "F1_OUT", "F1_SETP", "F1_MD")),
        (["F1-ProcessValue", "F1-CO", "F1-SV"], LoopTags("F1", "F1-ProcessValue", "F1-CO", "F1-SV")),
        (["U/F1/PV.CV", "U/F1/OUT.CV", "U/F1/MODE.ACTUAL"], LoopTags("U/F1", "U/F1/PV.CV", "U/F1/OUT.CV", None,
        "U/F1/MODE.ACTUAL")),
        (["F1:PV", "F1:CV"], LoopTags("F1", "F1:PV", "F1:CV")),
        (["FT_211", "FV_211"], LoopTags("F_211", "FT_211", "FV_211")),
        (["PT-12A", "PV-12A"], LoopTags("P-12A", "PT-12A", "PV-12A")),
        ([r"\\server\FIC1.PV", r"\\server\FIC1.OP"], LoopTags("FIC1", r"\\server\FIC1.PV", r"\\server\FIC1.OP")),
        (["fic1.pv", "FIC1.OP"], LoopTags("fic1", "fic1.pv", "FIC1.OP")),
        (["2111FIC46005.MV", "2111FIC46005.PV"], LoopTags("2111FIC46005", "2111FIC46005.PV", "2111FIC46005.MV")),
        (["FIC1.PV (degC)", "FIC1.OP [%]"], LoopTags("FIC1", "FIC1.PV (degC)", "FIC1.OP [%]")),
        (["4711.PV", "4711.OP"], LoopTags("4711", "4711.PV", "4711.OP")),
        (["塔顶温度.PV", "塔顶温度.OP"], LoopTags("塔顶温度", "塔顶温度.PV", "塔顶温度.OP")),
        (["FIC1 Set Point", "FIC1.controller output", "FIC1-process value"], LoopTags("FIC1", "FIC1-process value",
        "FIC1.controller output", "FIC1 Set Point")),
        (["FIC1.PV", "FIC1.MEAS"], LoopTags("FIC1", "FIC1.PV", others=("FIC1.MEAS",))),
        (["FIC1.PV", "FIC1.MV", "FIC1.OP"], LoopTags("FIC1", "FIC1.PV", "FIC1.OP", others=("FIC1.MV",))),
        (["FIC1.MEAS", "FIC1.PV [m3/h]", "FIC1.SV", "FIC1.SP"], LoopTags("FIC1", "FIC1.PV [m3/h]", None, "FIC1.SP",
        others=("FIC1.MEAS", "FIC1.SV"))),
        (["F1/PID.PV_Out#Value", "F1/PID.MV#Value", "F1/PID.SP#Value", "F1/PID.AutAct#Value"], LoopTags("F1/PID",
        "F1/PID.PV_Out#Value", "F1/PID.MV#Value", "F1/PID.SP#Value", "F1/PID.AutAct#Value")),
        ([r"SystemArchive\F1/PV_Out#Value", r"PVArchive\F1/MV_Out#Value", r"SystemArchive\F1/SP_Out#Value"],
        LoopTags("F1", r"SystemArchive\F1/PV_Out#Value", r"PVArchive\F1/MV_Out#Value",
        r"SystemArchive\F1/SP_Out#Value")),
        ([r"Area1\F1.PV", r"Area1\F1.OP"], LoopTags(r"Area1\F1", r"Area1\F1.PV", r"Area1\F1.OP")),
        (["F1.Val_PV", "F1.Val_CVOut", "F1.Val_SP", "F1.Sts_Auto"], LoopTags("F1", "F1.Val_PV", "F1.Val_CVOut",
        "F1.Val_SP", "F1.Sts_Auto")),
        (["F1.Regelgröße", "F1.Stellgröße", "F1.Führungsgröße"], LoopTags("F1", "F1.Regelgröße", "F1.Stellgröße",
        "F1.Führungsgröße")),
        (["F1.Messwert", "F1.Stellgro\u0308ße"], LoopTags("F1", "F1.Messwert", "F1.Stellgro\u0308ße")),
        (["Mesure F1", "F1_Sortie", "F1_Consigne"], LoopTags("F1", "Mesure F1", "F1_Sortie", "F1_Consigne")),
        (["F1 Medida", "F1 Salida", "F1 Consigna"], LoopTags("F1", "F1 Medida", "F1 Salida", "F1 Consigna")),
        (["F1.测量值", "F1.阀位", "F1.输出", "F1.设定值", "F1.模式"], LoopTags("F1", "F1.测量值", "F1.输出",
        "F1.设定值", "F1.模式", others=("F1.阀位",))),
        (["塔顶温度测量值", "塔顶温度输出"], LoopTags("塔顶温度", "塔顶温度测量值", "塔顶温度输出")),
        (["Wärme.PV (°C)", "Wärme.OP"], LoopTags("Wärme", "Wärme.PV (°C)", "Wärme.OP")),
        (["P1.PV (kg/cm2(g))", "P1.OP [%[x]]", "P1.SP (kg/cm2(g))"], LoopTags("P1", "P1.PV (kg/cm2(g))", "P1.OP [%[x]]",
        "P1.SP (kg/cm2(g))")),
        (["F1.PV t/h", "F1.OP %", "F1.SP, bar"], LoopTags("F1", "F1.PV t/h", "F1.OP %", "F1.SP, bar")),
        (["F1.PV - Feed flow (t/h)", "F1.OP - Valve output", "F1/SP - Set point of the feed (t/h)"], LoopTags("F1",
        "F1.PV - Feed flow (t/h)", "F1.OP - Valve output", "F1/SP - Set point of the feed (t/h)")),
    ],
)  # fmt: skip
def test_one_loop(tags: list[str], expected: LoopTags) -> None:
    assert group(tags) == (expected,)


def test_a_tag_that_says_nothing_stands_alone() -> None:
    assert group(["AMBIENT"]) == (LoopTags("AMBIENT", others=("AMBIENT",)),)


def test_bare_names_belong_to_the_file() -> None:
    assert group(["PV", "Set Point", "controller output"], stem="F9") == (
        LoopTags("F9", "PV", "controller output", "Set Point"),
    )


def test_bare_names_of_other_languages_belong_to_the_file() -> None:
    assert group(["测量值", "Stellgröße", "Consigne"], stem="F9") == (
        LoopTags("F9", "测量值", "Stellgröße", "Consigne"),
    )


@pytest.mark.parametrize(
    ("tags", "expected"),
    [
        (["PV", "OP", "SP", "Mode2"], LoopTags("F9", "PV", "OP", "SP", others=("Mode2",))),
        (["Mode2", "PV2", "PV", "OP"], LoopTags("F9", "PV", "OP", others=("PV2", "Mode2"))),
        (["SP 2", "PV1", "OP_1", "SP1", "MODE1"], LoopTags("F9", "PV1", "OP_1", "SP1", "MODE1", others=("SP 2",))),
        (["Mode2", "PV", "OP", "MODE"], LoopTags("F9", "PV", "OP", mode="MODE", others=("Mode2",))),
        (["PV", "OP", "Mode (0=man, 1=auto)"], LoopTags("F9", "PV", "OP", mode="Mode (0=man, 1=auto)")),
    ],
)
def test_a_number_behind_a_bare_name_is_another_signals(tags: list[str], expected: LoopTags) -> None:
    assert group(tags, stem="F9") == (expected,)


@pytest.mark.parametrize(
    ("tag", "name", "unit"),
    [
        ("P1.PV (kg/cm2(g))", "P1.PV", "kg/cm2(g)"),
        ("F1.PV t/h", "F1.PV", "t/h"),
        ("F1.OP, %", "F1.OP", "%"),
        ("F1.PV bar", "F1.PV", "bar"),
        ("F1 t/h", "F1", "t/h"),
        ("F1.PV - Feed flow ( t/h )", "F1.PV - Feed flow", "t/h"),
        ("Reactor pH", "Reactor pH", ""),
        ("Water in", "Water in", ""),
        ("F1.PV (2)", "F1.PV (2)", ""),
        ("t/h", "t/h", ""),
    ],
)
def test_the_unit_behind_a_name(tag: str, name: str, unit: str) -> None:
    assert (without_unit(tag), unit_of(tag)) == (name, unit)


def test_bare_names_with_units_belong_to_the_file() -> None:
    assert group(["PV t/h", "OP %", "SP, t/h"], stem="F9") == (LoopTags("F9", "PV t/h", "OP %", "SP, t/h"),)


def test_a_mapping_may_give_a_loop_the_mode_of_another_number() -> None:
    mapping = TagMapping.from_bytes(b"tag,loop,signal\nMode2,F9,MODE\n")
    assert group(["PV", "OP", "Mode2"], mapping, stem="F9") == (LoopTags("F9", "PV", "OP", mode="Mode2"),)


def test_a_loop_of_a_mapping_has_no_control_characters_in_its_name() -> None:
    mapping = TagMapping.from_bytes(b'[{"tag": "T1", "loop": "FIC1\\u001b[2J", "signal": "PV"}]')
    assert group(["T1"], mapping) == (LoopTags("FIC1\N{REPLACEMENT CHARACTER}[2J", "T1"),)


def test_mapping_comes_first_and_carries_spans() -> None:
    mapping = TagMapping.from_bytes(b"tag;loop;signal;unit;low;high\nT1;FIC1;PV;t/h;0;12,5\nT2;FIC1;OP;%;0;100\n")
    assert group(["T1", "T2"], mapping) == (LoopTags("FIC1", "T1", "T2"),)
    entry = mapping.find("t1")
    assert entry is not None
    assert (entry.attributes["unit"], entry.number("high")) == ("t/h", 12.5)
    assert (entry.number("unit"), entry.number("loop_type")) == (None, None)
    assert group(["T1"], TagMapping.from_bytes(b'[{"tag": "T1", "loop": "X", "signal": "sp"}]')) == (
        LoopTags("X", sp="T1"),
    )


@pytest.mark.parametrize(
    ("text", "high"),
    [
        ("tag,loop,signal,low,high\nT1,F,PV,0,1.500\n", 1.5),
        ("tag;loop;signal;low;high\nT1;F;PV;0,5;1,500\n", 1.5),
        ("tag;loop;signal;low;high\nT1;F;PV;0;1.500\nT2;F;OP;0;99.5\n", 1.5),
        ("tag;loop;signal;low;high\nT1;F;PV;0,5;1.500\n", None),
        ("tag;loop;signal;low;high\nT1;F;PV;0;1,500\n", None),
        ('tag,loop,signal,low,high\nT1,F,PV,0,"1,500"\n', None),
    ],
)
def test_a_span_whose_mark_may_part_thousands_is_refused(text: str, high: float | None) -> None:
    if high is None:
        with pytest.raises(DataError, match=r"row 1 of the mapping has high '1[.,]500', whose mark may part thousands"):
            TagMapping.from_bytes(text.encode())
    else:
        assert TagMapping.from_bytes(text.encode()).entries["t1"].number("high") == high


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "cp1252"])
def test_a_mapping_is_decoded_as_an_export_is(encoding: str) -> None:
    data = "tag;loop;signal;unit\nWärme.Ist;Wärmetauscher;PV;°C\n".encode(encoding)
    entry = TagMapping.from_bytes(data).find("wärme.ist")
    assert entry is not None
    assert (entry.loop, entry.attributes["unit"]) == ("Wärmetauscher", "°C")


def test_the_names_of_a_mapping_may_be_in_capitals() -> None:
    mapping = TagMapping.from_bytes(b"Tag;LOOP;Signal;Unit\nT1;F;pv;bar\n")
    assert mapping == TagMapping.from_bytes(b"tag,loop,signal,unit\nT1,F,PV,bar\n")


@pytest.mark.parametrize("data", [b"\xff\xfet\x00a", b"tag,loop,signal\nT\x81\xff,A,PV\n", b"\xff\xfe\x00\xd8a\x00"])
def test_a_mapping_that_is_no_text_is_refused(data: bytes) -> None:
    with pytest.raises(DataError) as refused:
        TagMapping.from_bytes(data)
    assert refused.value.code == "bad_mapping"


def test_a_loop_of_a_mapping_may_be_as_long_as_a_tag() -> None:
    assert TagMapping.from_bytes(b"tag,loop,signal\nT1," + 256 * b"F" + b",PV\n").find("T1").loop == 256 * "F"


def test_half_of_a_letter_in_a_mapping_is_stored_as_none() -> None:
    mapping = TagMapping.from_bytes(rb'[{"tag": "T\ud800", "loop": "F\udc00", "signal": "PV", "u\ud800": "\ud800"}]')
    (entry,) = mapping.entries.values()
    assert (entry.tag, entry.loop, dict(entry.attributes)) == ("T?", "F?", {"u?": "?"})


def test_a_row_that_stands_twice_in_a_mapping_is_no_fault() -> None:
    mapping = TagMapping.from_bytes(b"tag,loop,signal,low,high\nT1,F,PV,,\nT1,F,PV,-5,12\n")
    assert mapping.find("T1").number("low") == -5.0


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"[]",
        b"tag,loop,signal\n",
        b"tag,loop,signal\nT1,,PV\n",
        b"tag,loop,signal\nT1," + 257 * b"F" + b",PV\n",
        b"tag,loop,signal\nT1,F,what\n",
        b"[1]",
        b"{",
        b"[" * 5000,
        b"tag,loop,signal\nT1,F,PV\nt1,G,PV\n",
        b"tag,loop,signal\nT1,F,PV\nT1,F,OP\n",
        b"tag,loop,signal,low,high\nT1,F,PV,100,0\n",
        b"tag,loop,signal,low,high\nT1,F,PV,none,100\n",
        b"tag,loop,signal,low,high\nT1,F,PV,0,inf\n",
        b"tag,loop,signal,low,high\nT1,F,PV,nan,\n",
        b'tag,loop,signal\n"' + b"x" * 140_000 + b'",A,PV\n',
    ],
)
def test_a_mapping_that_cannot_be_used(data: bytes) -> None:
    with pytest.raises(DataError, match="mapping"):
        TagMapping.from_bytes(data)


def test_a_zero_byte_far_into_a_file_does_not_come_into_a_name(tmp_path: Path) -> None:
    """PostgreSQL refuses it in a text, so that the whole upload would fail by it."""
    path = tmp_path / "night.csv"
    whole = "".join(f"FIC{n:04d}.PV,2026-01-31T00:00:00Z,{n}\n" for n in range(12_000))
    path.write_text(f"Tagname,TimeStamp,Value\n{whole}FIC\x00101.PV,2026-01-31T00:00:00Z,1\n")
    loops = {loop.loop: loop for loop in read_export(path).loops()}
    assert len(loops) == 12_001
    assert loops["FIC\N{REPLACEMENT CHARACTER}101"].pv is not None


def test_a_bare_mode_or_output_leaves_the_tags_their_loops(read: Read) -> None:
    rows = "".join(f"2024-03-01 00:0{i}:00,1,2,3,4,0,5\n" for i in range(4))
    for bare in ("Mode", "OP", "SP"):
        loops = read(f"time,A.PV,A.OP,B.PV,B.OP,{bare},TI1\n{rows}", name="night.csv").loops
        assert {name: (loop.pv is not None, loop.op is not None) for name, loop in loops.items() if name in "AB"} == {
            "A": (True, True),
            "B": (True, True),
        }
    one = read(f"time,A.PV,A.OP,PV,OP,Mode,TI1\n{rows}", name="night.csv").loops
    assert list(one) == ["night"]
    assert sorted(one["night"].others) == ["A.OP", "A.PV", "TI1"]


@pytest.mark.parametrize("bare", [".PV,.OP", "PV,OP", "..PV,_OP", "PV,OP,SP,Mode"])
def test_a_nameless_loop_leaves_the_named_ones_theirs(read: Read, bare: str) -> None:
    rows = "".join(f"2024-03-01 00:0{i}:00,1,2,3,4,{','.join('5678'[: bare.count(',') + 1])}\n" for i in range(4))
    content = read(f"time,A.PV,A.OP,B.PV,B.OP,{bare}\n{rows}", name="night.csv")
    assert {name: (loop.pv[0], loop.op[0], dict(loop.others)) for name, loop in content.loops.items()} == {
        "A": (1, 2, {}),
        "B": (3, 4, {}),
        "night": (5, 6, {}),
    }


def test_a_pair_without_its_tag_leaves_another_one_its_loop(read: Read) -> None:
    rows = "".join(f"2024-03-01 00:0{i}:00,1,2,3,4\n" for i in range(4))
    assert list(read(f"time,A.PV,A.OP,.PV,.OP\n{rows}", name="night.csv").loops) == ["A", "night"]


def test_lone_signals_of_others_belong_to_the_loop_of_the_file(read: Read) -> None:
    rows = "".join(f"2024-03-01 00:0{i}:00,1,2,3,4,5\n" for i in range(4))
    (loop,) = read(f"time,PV,OP,A.PV,B.OP,TI1\n{rows}", name="night.csv").loops.values()
    assert list(loop.others) == ["A.PV", "B.OP", "TI1"]


LONG_TAGS = ["F1.CO", "F1.MEAS", "F1.MV", "F1.OP", "F1.PV", "F1.SP", "F1.OUT"]


def long(tags: list[str]) -> str:
    rows = (f"{tag},2026-03-01 10:{minute:02d}:00,{len(tag)}{minute}\n" for minute in range(60) for tag in tags)
    return "Tag,Time,Value\n" + "".join(rows)


@pytest.mark.parametrize("buffered_values", [150, 3_000_000])
@pytest.mark.parametrize("tags", [LONG_TAGS, LONG_TAGS[::-1], sorted(LONG_TAGS, key=lambda tag: tag[::-1])])
def test_which_tag_of_a_long_table_has_a_signal_does_not_hang_on_their_order(
    read: Read, tags: list[str], buffered_values: int
) -> None:
    content = read(long(tags), options=IngestOptions(buffered_values=buffered_values))
    (loop,) = content.summary.loops
    assert (loop.pv, loop.op, loop.sp) == ("F1.PV", "F1.OP", "F1.SP")
    assert set(loop.others) == {"F1.CO", "F1.MEAS", "F1.MV", "F1.OUT"} == set(content.loops["F1"].others)
    (note,) = content.summary.notes
    assert note.startswith("4 tags name a signal that their loop has already")
    for told in ("F1.MEAS (PV is F1.PV)", "F1.CO (OP is F1.OP)", "F1.MV (OP is F1.OP)", "F1.OUT (OP is F1.OP)"):
        assert told in note


@pytest.mark.parametrize("tags", [("F1.CO", "F1.MV", "F1.PV"), ("F1.MV", "F1.PV", "F1.CO")])
def test_of_other_names_the_usual_one_has_the_signal(read: Read, tags: tuple[str, ...]) -> None:
    (loop,) = read(long(list(tags))).summary.loops
    (wide,) = group(tags)
    assert loop.op == wide.op == "F1.MV"


@pytest.mark.parametrize("tags", [["F1.OP", "F1.PV", "X"], ["X", "F1.PV", "F1.OP"]])
def test_a_tag_of_the_mapping_goes_before_one_that_is_named_so(read: Read, tags: list[str]) -> None:
    mapping = TagMapping.from_bytes(b"tag,loop,signal\nX,F1,OP\n")
    (loop,) = read(long(tags), mapping=mapping).summary.loops
    (wide,) = group(tags, mapping)
    assert loop.op == wide.op == "X"
    assert loop.others == ("F1.OP",)


@pytest.mark.parametrize(
    ("tag", "loop", "signal"),
    [("㎷", "stem", "OP"), ("ⓅⓋ", "stem", "PV"), ("-12.5 %", "-12.5 %", "OTHER"), ("4711.12", "4711.12", "OTHER")],
)
def test_signs_that_spell_letters_are_a_name_and_numbers_are_none(tag: str, loop: str, signal: str) -> None:
    assert place(tag, "stem") == (tag, loop, signal)


@pytest.mark.parametrize(
    ("tag", "loop", "signal"),
    [
        ("FIC101-PV.UNIT1@NET1", "FIC101.UNIT1@NET1", "PV"),
        ("FIC101-OUT.UNIT0@NET0 (%)", "FIC101.UNIT0@NET0", "OP"),
        ("FT_211.UNIT2@NET1", "F_211.UNIT2@NET1", "PV"),
        ("FI8001.UNIT1@NET1", "FI8001.UNIT1@NET1", "OTHER"),
    ],
)
def test_where_a_point_of_ovation_stands_tells_no_signal(tag: str, loop: str, signal: str) -> None:
    """As NET1 does not, though a T with a number may be a transmitter's; and points of other units are others."""
    assert place(tag, "")[1:] == (loop if signal != "OTHER" else tag, signal)


@pytest.mark.parametrize("where", ["", ".UNIT1@NET1", ".UNIT1@NET1.UNIT2@NET2"])
def test_a_bare_signal_is_of_the_loop_of_its_file_wherever_it_stands(where: str) -> None:
    assert [place(f"PV{where}", stem).loop for stem in ("", "FIC1", "FIC2")] == [where, f"FIC1{where}", f"FIC2{where}"]


def test_a_bare_point_of_ovation_is_the_pv_beside_its_output() -> None:
    tags = ["FIC101.UNIT1@NET1", "FIC101-OUT.UNIT1@NET1", "FIC101.UNIT2@NET1"]
    loops = {loop.loop: (loop.pv, loop.op) for loop in group(tags)}
    assert loops == {"FIC101.UNIT1@NET1": (tags[0], tags[1]), tags[2]: (None, None)}


def test_two_namespaces_of_opc_ua_have_loops_of_their_own() -> None:
    """One name in two of them may be two valves; an index that a plant's loops are known by stays."""
    tags = [f"ns={space};s=FIC101.{word}" for space in (2, 3) for word in ("PV", "OP")]
    assert group(tags) == (LoopTags("ns=2;s=FIC101", *tags[:2]), LoopTags("ns=3;s=FIC101", *tags[2:]))


@pytest.mark.parametrize("prefix", ["", "ns=3;s=", "nsu=http://example.org/UA/;s="])
def test_names_in_the_quotes_of_s7(prefix: str) -> None:
    tags = [f'{prefix}"DB1"."FIC101"."{word}"' for word in ("PV", "OP")]
    assert group(tags) == (LoopTags(f"{prefix}DB1.FIC101", *tags),)
    bare = [f'{prefix}"DB1"."FIC101"', tags[1]]
    assert group(bare) == (LoopTags(f"{prefix}DB1.FIC101", *bare),)
