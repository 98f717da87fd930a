"""A small good file in every layout and package that the readers know, to start a fuzzer from."""

import gzip
import io

import polars as pl

MINUTES = [f"2024-03-01 00:{minute:02d}:00" for minute in range(20)]


def rows(form: str) -> str:
    """A line for each of twenty minutes: `form` may use {time}, {day}, {clock}, {seconds}, {i}, {pv} and {op}."""
    return "".join(
        form.format(
            time=time,
            day=time[:10],
            clock=time[11:],
            seconds=1709251200 + 60 * i,
            i=i,
            pv=50 + (i % 5) * 0.25,
            op=40 + i % 7,
        )
        for i, time in enumerate(MINUTES)
    )


def frame() -> pl.DataFrame:
    return pl.read_csv(io.BytesIO(WIDE.encode()), try_parse_dates=True)


def parquet() -> bytes:
    packed = io.BytesIO()
    frame().write_parquet(packed)
    return packed.getvalue()


WIDE = "DateTime,FIC1.PV,FIC1.OP\n" + rows("{time},{pv},{op}\n")

TEXTS: dict[str, str] = {
    "wide.csv": WIDE,
    "modes.csv": "time,A.PV,A.OP,A.SP,A.MODE\n" + rows("{time},{pv},{op},50,AUTO\n"),
    "recording.csv": "time,SP,PV,OP,MODE\n" + rows("{i},50,{pv},{op},1\n"),
    "long.csv": "Tagname,TimeStamp,Value,DataQuality\n" + rows("FIC1.PV,{time},{pv},Good\nFIC1.OP,{time},{op},Good\n"),
    "bare.csv": rows("{seconds}:76000000,FIC1.PV,{pv},float,GOOD\n{seconds}:76000000,FIC1.OP,{op},float,BAD\n"),
    "aveva.csv": "DateTime,TagName,Value,vValue,Quality,QualityDetail,OPCQuality,wwTagKey\n"
    + rows("{time}.0000000,FIC1.PV,{pv},{pv},0,192,192,1\n{time}.0000000,FIC1.OP,{op},{op},0,192,192,2\n"),
    "FIC1.PV.csv": rows("{day}T{clock}.0000000Z,{pv}\n"),
    "pi.csv": "FIC1.PV,,FIC1.OP,\n" + rows("{time},{pv},{time},{op}\n"),
    "sql.csv": "id,date,time,FT_211,FV_211\n" + rows("{i},{day},{clock},{pv},{op}\n"),
    "ignition.csv": '"#NAMES"\n"t_stamp","FIC1/PV","FIC1/OP"\n"#TYPES"\n"date","D","D"\n"#ROWS","20"\n'
    + rows('"{time}","{pv}","{op}"\n'),
    "trendminer.csv": "Name,FIC1.PV,FIC1.OP\nDescription,flow,valve\nUnit,t/h,%\nType,ANALOG,ANALOG\n"
    + rows("{day}T{clock}+01:00,{pv},{op}\n"),
    "german.csv": "Zeit;FIC1.PV;FIC1.OP\n" + rows("01.03.2024 {clock};50,5;{op}\n"),
    "dcs.txt": "PROCESSDATA\tFIC1 Data\tyyyy-MM-dd HH:mm:ss\n8\t60\t2024-03-01 00:00:00\t20\n"
    "tagname\tFIC1.MV\tFIC1.PV\tFIC1.SV\tFIC1.MODE\tbOpOFL\tbPvOFL\tbSpOFL\tbAutOFL\ndesc\t\t\t\t\t\t\t\t\n\t\t\t\t\t\t\t\t\n"
    + rows("{time}\t{op}\t{pv}\t50\t1\t0\t0\t0\t0\n"),
}


def seeds() -> dict[str, bytes]:
    """Bytes by the name under which they would be sent."""
    found = {name: text.encode() for name, text in TEXTS.items()}
    found["wide.csv.gz"] = gzip.compress(WIDE.encode(), mtime=0)
    found["two.csv.gz"] = gzip.compress(WIDE[:200].encode(), mtime=0) + gzip.compress(WIDE[200:].encode(), mtime=0)
    found["utf16.csv"] = TEXTS["pi.csv"].encode("utf-16")
    found["latin.csv"] = TEXTS["german.csv"].replace("FIC1", "Kühler").encode("cp1252")
    found["chinese.csv"] = TEXTS["wide.csv"].replace("FIC1", "塔顶温度控制").encode("gb18030")
    found["wide.parquet"] = parquet()
    return found
