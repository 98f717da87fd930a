"""Files that plants and attackers send, each made when it is asked for; beside it stands what must come of it."""

import gzip
import io
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass

from tests.fuzz.seeds import TEXTS, rows, seeds

HEADER = "time,A.PV,A.OP\n"
GOOD = rows("{time},{pv},{op}\n")
MEGABYTE = bytes(1 << 20)
WORDS = (
    "NaN",
    "nan",
    "NAN",
    "-nan",
    "inf",
    "-Infinity",
    "1e400",
    "-1e400",
    "#N/A",
    "No Data",
    "Bad Input",
    "null",
    "--",
)
NAMES = (
    *(
        "'; DROP TABLE loops;--",
        "<script>alert(1)</script>",
        "=cmd|' /C calc'!A0",
        "+1",
        "@SUM(A1)",
        "../../etc/passwd",
    ),
    *(
        "..\\..\\boot.ini",
        "%2e%2e%2f",
        "{{7*7}}",
        "${jndi:ldap://x}",
        "a\tb",
        "a\u202eb",
        "塔顶",
        "é" * 250,
        "x" * 10_000,
    ),
)


@dataclass(frozen=True)
class Hostile:
    """`ends`: "done" with at least `kept` rows, or the codes with which it may be refused."""

    make: Callable[[], bytes]
    refused: tuple[str, ...] = ()
    kept: int = 0
    name: str = "export.csv"


def bomb(megabytes: int) -> bytes:
    packer = zlib.compressobj(9, zlib.DEFLATED, 31)
    start = packer.compress((HEADER + GOOD).encode())
    return start + b"".join(packer.compress(b"\n" * (1 << 20)) for _ in range(megabytes)) + packer.flush()


def workbook_bomb() -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        part = archive.open("xl/worksheets/sheet1.xml", "w")
        for _ in range(1030):
            part.write(MEGABYTE)
        part.close()
    return packed.getvalue()


def columns(count: int) -> bytes:
    names = ",".join(f"T{i}.PV" for i in range(count))
    return ("time," + names + "\n" + "".join(f"2024-03-01 00:0{i}:00{',1' * count}\n" for i in range(4))).encode()


def tags(count: int) -> bytes:
    return ("Tagname,TimeStamp,Value\n" + "".join(f"T{i}.PV,2024-03-01 00:00:00,1\n" for i in range(count))).encode()


def named(name: str) -> bytes:
    written = name.replace('"', '""')
    return (f'time,"{written}.PV","{written}.OP"\n' + GOOD).encode()


def with_rows(text: str) -> Callable[[], bytes]:
    return lambda: (HEADER + GOOD + text).encode()


CUT = ("empty_file", "not_an_export", "unknown_layout", "nothing_readable")

FILES: dict[str, Hostile] = {
    "empty": Hostile(lambda: b"\n", refused=("empty_file",)),
    "random bytes": Hostile(lambda: bytes(i * i * 31 % 251 for i in range(20_000)), refused=("not_an_export",)),
    "an image": Hostile(lambda: b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" * 400, refused=("not_an_export",)),
    "binary after good rows": Hostile(lambda: (HEADER + GOOD).encode() + bytes(range(14, 256)) * 3, refused=CUT),
    "zeros after good rows": Hostile(lambda: (HEADER + GOOD * 40).encode() + bytes(500), kept=20),
    "said to be UTF-16": Hostile(lambda: b"\xff\xfe" + (HEADER + GOOD).encode(), refused=CUT),
    "UTF-8 and Latin-1 mixed": Hostile(
        lambda: HEADER.encode() + GOOD.encode() + b"2024-03-01 00:30:00,\xe9,1\n", kept=20
    ),
    "UTF-16 cut in a letter": Hostile(lambda: (HEADER + GOOD).encode("utf-16")[:-1], kept=19),
    "10,000 columns": Hostile(lambda: columns(10_000), kept=4),
    "40,000 tags": Hostile(lambda: tags(40_000), kept=40_000),
    "numbers that are none": Hostile(
        with_rows("".join(f"2024-03-02 00:{i:02d}:00,{w},1\n" for i, w in enumerate(WORDS))), kept=33
    ),
    "huge numbers": Hostile(with_rows("2024-03-02 00:00:00," + "9" * 5000 + ",0." + "0" * 5000 + "1\n"), kept=21),
    "time backwards": Hostile(lambda: (HEADER + "".join(reversed(GOOD.splitlines(True)))).encode(), kept=20),
    "the year 9999": Hostile(
        with_rows("9999-12-31 23:59:59,1,1\n0001-01-01 00:00:00,1,1\n2262-04-12 00:00:00,1,1\n"), kept=20
    ),
    "no such days": Hostile(
        with_rows("2024-02-30 00:00:00,1,1\n2024-13-01 00:00:00,1,1\n2024-03-01 25:61:00,1,1\n"), kept=20
    ),
    "offsets that change": Hostile(
        lambda: ("time,A.PV\n" + rows("{day}T{clock}+01:00,{pv}\n") + rows("{day}T{clock}-11:45,{pv}\n")).encode(),
        kept=40,
    ),
    "the hour that comes twice": Hostile(
        lambda: (
            "time,A.PV\n" + "".join(f"2024-10-27 0{h}:{m:02d}:00,1\n" for h in (1, 2, 2, 3) for m in range(0, 60, 5))
        ).encode(),
        kept=36,
    ),
    "a bomb": Hostile(lambda: bomb(80), refused=("compression_ratio",), name="export.csv.gz"),
    "a bomb in a bomb": Hostile(lambda: gzip.compress(bomb(20)), refused=CUT, name="export.csv.gz.gz"),
    "a workbook that is a bomb": Hostile(workbook_bomb, refused=("decompressed_too_large",), name="export.xlsx"),
    "gzip cut": Hostile(lambda: gzip.compress((HEADER + GOOD).encode())[:-30], kept=1, name="export.csv.gz"),
    "quotes that stay open": Hostile(with_rows('2024-03-02 00:00:00,"1,1\n2024-03-02 00:01:00,1,1\n'), kept=21),
    "a quote in a row of quotes": Hostile(lambda: TEXTS["ignition.csv"].replace('"42"', '"42"ÿÿÿ').encode(), kept=18),
    "rows cut short and long": Hostile(with_rows("2024-03-02 00:00:00\n2024-03-02 00:01:00,1,1,1,1\n"), kept=20),
    "a line of 3 MB": Hostile(with_rows("x" * 3_000_000 + "\n2024-03-02 00:00:00,1,1\n"), kept=21),
    "only commas": Hostile(lambda: b"," * 50_000 + b"\n", refused=CUT),
    "a mail": Hostile(lambda: b"Dear all,\nplease find the file attached.\n", refused=("unknown_layout",)),
    **{
        f"a tag named {name[:24]!r}": Hostile(lambda name=name: named(name), kept=20)
        for name in NAMES
        if len(name) < 200
    },
    **{
        f"a tag of {len(name)} letters": Hostile(lambda name=name: named(name), kept=20, refused=("nothing_readable",))
        for name in NAMES
        if len(name) >= 200
    },
    **{
        f"{name} cut at {share:.0%}": Hostile(
            lambda data=data, share=share: data[: int(share * len(data))], refused=CUT, name=name
        )
        for name, data in seeds().items()
        for share in (0.3, 0.93)
    },
}
