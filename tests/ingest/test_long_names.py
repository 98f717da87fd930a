"""Long tables by whatever names their columns have: no tags are mixed."""

from datetime import datetime, timedelta

import numpy as np
import pytest

from app.errors import DataError

from .conftest import Content, Read

TIMES = [datetime(2024, 3, 14, 8) + timedelta(seconds=k) for k in range(300)]
AT = np.array(TIMES, dtype="datetime64[ns]").astype(np.int64)
SHAPES = [
    ("Series;Time;Value", "{tag};{iso}+00:00;{value}"),
    ("Data source,Time,Value,Units", "\\\\PISRV\\{tag},{iso},{value},t/h"),
    ("Messstelle;Zeitstempel;Wert;Status", "{tag};{iso};{value};Gut"),
    ("event_time,tag_name,value", "{iso},{tag},{value}"),
    ("tag,ts,value_double,value_string", "{tag},{iso},{value},"),
    ("NAME,IP_TREND_TIME,IP_TREND_VALUE,IP_TREND_QSTATUS", "{tag},{iso},{value},Good"),
    ("VarName;TimeString;VarValue;Validity;Time_ms", "{tag};{iso};{value};1;45365333333,3333"),
    (
        "NodeId,SourceTimestamp,ServerTimestamp,Value,StatusCode",
        "ns=2;s={tag},{iso}.000Z,2024-03-14T09:00:00.000Z,{value},Good",
    ),
    ("TagName,SourceTime,Value,Quality", "{tag},{iso},{value},192"),
    ("Variable;Horodatage;Valeur", "{tag};{iso};{value}"),
    ("Etiqueta;Fecha;Hora;Valor", "{tag};{date};{clock};{value}"),
    ("Anlage;Kennung;Wann;Messwert", "Nord;{tag};{iso};{value}"),
    ("Id,Kennung,Wann,Messwert,Einheit", "{number},{tag},{iso},{value},%"),
    ("Loop,Signal,Time,Value", "FIC101,{signal},{iso},{value}"),
    ("Object;Property;Timestamp;Value;Quality", "FIC101;{signal};{iso};{value};192"),
    ("Tag;Timestamp;RealValue;Reading", "{tag};{iso};0;{value}"),
    ("ValueName;Timestamp;RealValue;Quality;Flags", "Archive\\{tag};{iso};{value};192;8392704"),
    ("Signal;Controller;Time;Val;Status", "{signal};FIC101;{iso};{value};Good"),
    (
        ",result,table,_start,_stop,_time,_value,_field,_measurement",
        ",,0,2024-03-14T08:00:00Z,2024-03-14T09:00:00Z,{iso}Z,{value},{signal},FIC101",
    ),
    (",result,table,_time,_value,_field,_measurement", ",,0,{iso}Z,{value},value,{tag}"),
    (",result,table,_time,_value,_field,_measurement", ",,0,{iso}Z,{value},{tag},plant"),
    (",result,table,_time,_value,_field,_measurement,loop", ",,0,{iso}Z,{value},{signal},plant,FIC101"),
]


def table(shape: tuple[str, str], by_tag: bool) -> str:
    heading, row = shape
    order = [(k, s) for k in range(300) for s in ("PV", "OP")]
    order = sorted(order, key=lambda pair: pair[1]) if by_tag else order
    cells = (
        row.format(
            tag=f"FIC101.{signal}",
            signal=signal,
            iso=f"{TIMES[k]:%Y-%m-%dT%H:%M:%S}",
            date=f"{TIMES[k]:%d/%m/%Y}",
            clock=f"{TIMES[k]:%H:%M:%S}",
            value=f"{k}.5" if signal == "PV" else f"{k % 7}.25",
            number=number,
        )
        for number, (k, signal) in enumerate(order)
    )
    return "\n".join((heading, *cells)) + "\n"


def check(content: Content) -> None:
    (name,) = content.loops
    assert name.endswith("FIC101")
    loop = content.loops[name]
    np.testing.assert_array_equal(loop.time_ns, AT)
    np.testing.assert_array_equal(loop.pv, np.arange(300) + 0.5)
    np.testing.assert_array_equal(loop.op, np.arange(300) % 7 + 0.25)
    assert content.rejects.total == 0


@pytest.mark.parametrize("by_tag", [False, True])
@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape[0])
def test_each_tag_has_its_values(read: Read, shape: tuple[str, str], by_tag: bool) -> None:
    check(read(table(shape, by_tag)))


def test_a_wide_table_with_words_stays_one(read: Read) -> None:
    rows = "".join(f"{stamp},{k},{k % 7},{'AUTO' if k % 50 else 'MAN'},unit 1\n" for k, stamp in enumerate(TIMES))
    content = read("Time,A.PV,A.OP,A.MODE,Area\n" + rows)
    assert content.summary.layout == "wide"
    assert content.loops["A"].pv.tolist() == list(range(300))


def test_rows_of_a_stamp_that_words_tell_apart_are_no_wide_table(read: Read) -> None:
    rows = "".join(f"{stamp},{word},{k},{k % 7}\n" for k, stamp in enumerate(TIMES) for word in ("north", "south"))
    with pytest.raises(DataError, match="'Where' tells the rows of one time apart") as refused:
        read("Time,Where,PV,OP\n" + rows)
    assert refused.value.code == "unknown_layout"


WINCC = "Name;TimeStamp;ProcessValue;Quality;Flags"


def wincc(heading: str = WINCC, quality: int = 128) -> str:
    rows = [
        f"SystemArchive\\FIC101/{word}#Value;14.03.2024 08:00:{k:02d};{k},5;{quality};8388612"
        for k in range(40)
        for word in ("PV_Out", "MV")
    ]
    return "\n".join((heading, *rows)) + "\n"


@pytest.mark.parametrize("quality", [128, 76])
def test_an_archive_of_wincc(read: Read, quality: int) -> None:
    """Whose 128 is good, and what OPC has below is uncertain."""
    content = read(wincc(quality=quality))
    assert content.loops["FIC101"].samples == 40
    assert content.loops["FIC101"].op is not None
    assert content.rejects.counts == {}


def test_a_process_value_beside_a_set_point_is_no_value_of_tags(read: Read) -> None:
    rows = "\n".join(f"FIC{k % 2};2024-03-14 08:00:{k // 2:02d};{k},5;7,5;{k % 7},5" for k in range(80))
    content = read(f"Name;TimeStamp;ProcessValue;SetPoint;Output\n{rows}\n")
    assert sorted(content.loops) == ["FIC0", "FIC1"]
    assert content.loops["FIC0"].sp is not None
    assert content.loops["FIC0"].op is not None


def test_a_process_value_of_a_wide_file_is_the_pv(read: Read) -> None:
    rows = "\n".join(f"14.03.2024 08:00:{k:02d};{k},5;{k % 7},5" for k in range(40))
    content = read(f"TimeStamp;ProcessValue;Output\n{rows}\n", name="FIC7.csv")
    assert content.loops["FIC7"].pv is not None


@pytest.mark.parametrize("heading", ["PointID,Path", "TagId,DataSource", "ItemID,Series"])
def test_numbers_of_tags_are_the_tags_beside_words_that_name_none(read: Read, heading: str) -> None:
    rows = "".join(f"{stamp},{n},PLC1,{k}.{n}\n" for k, stamp in enumerate(TIMES) for n in (100, 101))
    content = read(f"Time,{heading},Value\n{rows}")
    assert sorted(content.loops) == ["100", "101"]


@pytest.mark.parametrize("word", ["FIC7", "batch"])
def test_a_name_beside_a_process_value_and_others_is_no_tag(read: Read, word: str) -> None:
    rows = "\n".join(f"14.03.2024 08:00:{k:02d};{word}{k // 20 * (word > 'a')};{k},5;{k % 7},5" for k in range(40))
    content = read(f"TimeStamp;Name;ProcessValue;Valve\n{rows}\n", name="FIC7.csv")
    assert content.loops["FIC7"].pv is not None
    assert content.loops["FIC7"].samples == 40


def test_tags_that_tell_no_signal_stand_beside_a_process_value_too(read: Read) -> None:
    rows = [f"{name};14.03.2024 08:00:{k:02d};{k},5;192" for k in range(40) for name in ("Feed", "Valve")]
    content = read("Name;TimeStamp;ProcessValue;Quality\n" + "\n".join(rows))
    assert sorted(content.loops) == ["Feed", "Valve"]


@pytest.mark.parametrize("name", ["Signal", "Point"])
@pytest.mark.parametrize("called", ["{}.5", "batch {}"])
def test_what_stands_below_names_of_one_loop_is_no_tag(read: Read, name: str, called: str) -> None:
    rows = "".join(f"{at},{called.format(k % 3)},{k % 7}.5,{k}.5,{k % 5}.5\n" for k, at in enumerate(TIMES))
    content = read(f"U1.Time,U1.{name},U1.Value,U1.PV,U1.OP\n{rows}")
    assert content.loops["U1"].pv is not None
    assert content.loops["U1"].op is not None


def test_numbers_below_names_with_a_value_among_them_are_no_tags(read: Read) -> None:
    rows = "".join(f"{stamp},{k % 7}.5,{k}.25\n" for k, stamp in enumerate(TIMES))
    content = read(f"U1.Time,U1.Value,U1.Point\n{rows}")
    assert sorted(content.loops) == ["U1.Point", "U1.Value"]


def test_such_tags_one_after_the_other(read: Read) -> None:
    clocks = [f"08:{k // 60:02d}:{k % 60:02d}" for k in range(2000)]
    rows = [f"{name};14.03.2024 {at};{k},5;192" for name in ("Feed", "Valve") for k, at in enumerate(clocks)]
    content = read("Name;TimeStamp;ProcessValue;Quality\n" + "\n".join(rows))
    assert [content.loops[name].samples for name in ("Feed", "Valve")] == [2000, 2000]
