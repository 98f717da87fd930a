"""Plain rows of a long table are read in one pass: the same loops and refusals as field by field."""

import random
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from app.ingest import IngestOptions, read_export
from app.ingest.columns.plans import LongPlan
from app.ingest.files.opening import Lines
from app.ingest.model import LoopSamples
from app.ingest.tables import frames, scanning
from app.ingest.tables.frames import FrameReader
from app.ingest.tables.scanning import Scan, Scanner
from app.ingest.times.stamps import TimeForm
from tests.ingest.conftest import Read
from tests.ingest.test_blocks import same

HEAD = "Tagname,TimeStamp,Value,Quality"
TAGS = ("A.PV", "A.OP", "A.SP", "A.MODE", "Züge.PV", "L-000000001.PV", "L-00000000000000002.PV", "B.PV", "C")
INSTANTS = 24
SMALL_CHUNKS = 1000  # bytes: some of them without the odd row


def scan(*, quality: str = "Good", step: int = 1) -> list[str]:
    """All tags at each instant."""
    return [
        f"{tag},2026-01-31 00:{k:02d}:00,{at * k / 8},{quality}"
        for k in range(0, INSTANTS, step)
        for at, tag in enumerate(TAGS)
    ]


def shuffled() -> list[str]:
    """Other tags at each instant, in another order."""
    draw = random.Random(7)
    return [
        f"{tag},2026-01-31 00:{k:02d}:00,{draw.uniform(-1e5, 1e5):.{draw.randrange(9)}f},Good"
        for k in range(INSTANTS)
        for tag in draw.sample(TAGS, draw.randrange(4, len(TAGS) + 1))
    ]


def changed(row: int, *pairs: tuple[str, str]) -> str:
    """A scan with one odd row in its middle."""
    lines = scan()
    for old, new in pairs:
        assert old in lines[row]
        lines[row] = lines[row].replace(old, new)
    return text(lines)


def text(lines: list[str], end: str = "\n") -> str:
    return end.join([HEAD, *lines]) + end


ODD = 100
PLAIN: dict[str, Callable[[], str]] = {
    "a scan": lambda: text(scan()),
    "no end of the last line": lambda: text(scan())[:-1],
    "line ends of Windows": lambda: text(scan(), "\r\n"),
    "tags in no order": lambda: text(shuffled()),
    "decimal commas": lambda: re.sub(r"\.(\d+);", r",\1;", text(scan()).replace(",", ";")),
    "missing values": lambda: text([line.replace(",5.0,", ",,") for line in scan()]),
    "no quality": lambda: text([line.replace("Good", "") for line in scan()]),
    "values that stand for no data": lambda: text([line.replace(",5.0,", ",-9999,") for line in scan()]),
    "an hour that comes twice": lambda: text(scan() + scan()).replace("2026-01-31 00:", "2025-10-26 02:"),
    "times that repeat and go back": lambda: text(scan() + scan(step=3)),
    "a zero byte in a tag": lambda: text([*scan()[:-80], *(line.replace("B.PV", "B\0.PV") for line in scan()[-80:])]),
}
NOT_PLAIN: dict[str, Callable[[], str]] = {
    "a word for a value": lambda: changed(ODD, (",1.375,", ",No Data,")),
    "no number": lambda: changed(ODD, (",1.375,", ",nan,")),
    "an endless number": lambda: changed(ODD, (",1.375,", ",inf,")),
    "a number with an exponent": lambda: changed(ODD, (",1.375,", ",1.375e3,")),
    "a number with blanks": lambda: changed(ODD, (",1.375,", ", 1.375,")),
    "a number of twenty digits": lambda: changed(ODD, (",1.375,", ",1.3750000000000000001,")),
    "a number that is hardly exact": lambda: changed(ODD, (",1.375,", ",9007199254740993,")),
    "a number without an end": lambda: changed(ODD, (",1.375,", ",1.,")),
    "a minus alone": lambda: changed(ODD, (",1.375,", ",-,")),
    "a short row": lambda: changed(ODD, (",Good", "")),
    "a long row": lambda: changed(ODD, (",Good", ",Good,7")),
    "an empty line": lambda: text([*scan()[:ODD], "", *scan()[ODD:]]),
    "a comment": lambda: text([*scan()[:ODD], "# shift,,,", *scan()[ODD:]]),
    "quotes": lambda: changed(ODD, ("A.OP", '"A.OP"')),
    "no tag": lambda: changed(ODD, ("A.OP", "")),
    "no time": lambda: changed(ODD, ("2026-01-31 00:11:00", "")),
    "a time that is none": lambda: changed(ODD, ("2026-01-31 00:11:00", "yesterday")),
    "a bad quality": lambda: changed(ODD, ("Good", "Bad")),
}


@pytest.fixture
def scans(monkeypatch: pytest.MonkeyPatch) -> list[Scan | None]:
    """What scanning came to, chunk by chunk; it is tried however small a chunk is."""
    found: list[Scan | None] = []
    original = Scanner.scan

    def noted(self: Scanner, lines: Lines) -> Scan | None:
        found.append(original(self, lines))
        return found[-1]

    monkeypatch.setattr(frames, "LEAST_BYTES", 8)
    monkeypatch.setattr(scanning, "PATIENCE", 1000)
    monkeypatch.setattr(Scanner, "scan", noted)
    return found


def read_by_fields(read: Read, monkeypatch: pytest.MonkeyPatch, content: str, options: IngestOptions) -> object:
    with monkeypatch.context() as patched:
        patched.setattr(frames, "LEAST_BYTES", 1 << 60)
        return read(content, options=options)


@pytest.mark.parametrize("chunk_bytes", [SMALL_CHUNKS, 1 << 20])
@pytest.mark.parametrize("name", PLAIN | NOT_PLAIN)
def test_a_scan_gives_what_fields_give(
    read: Read, monkeypatch: pytest.MonkeyPatch, scans: list[Scan | None], name: str, chunk_bytes: int
) -> None:
    content = (PLAIN | NOT_PLAIN)[name]()
    options = IngestOptions(chunk_bytes=chunk_bytes, time_zone="Europe/Berlin")
    by_fields = read_by_fields(read, monkeypatch, content, options)
    assert not scans
    same(read(content, options=options), by_fields)
    refused = name in ("no time", "a time that is none", "a comment", "a bad quality")  # what is read of them tells it
    assert (name in PLAIN or refused) == (None not in scans)
    assert any(scans) == (name in PLAIN or refused or chunk_bytes == SMALL_CHUNKS)


@pytest.mark.parametrize("chunk_bytes", [200, 400])
def test_tags_keep_their_values_where_scans_lie_between_odd_rows(
    read: Read, monkeypatch: pytest.MonkeyPatch, scans: list[Scan | None], chunk_bytes: int
) -> None:
    lines = scan() + [line.replace(" 00:", " 01:") for line in scan()]
    odd = range(20, len(lines), 97)  # another tag each time
    lines = [line.replace("Good", "Bad") if k in odd else line for k, line in enumerate(lines)]
    options = IngestOptions(chunk_bytes=chunk_bytes)
    by_fields = read_by_fields(read, monkeypatch, text(lines), options)
    same(read(text(lines), options=options), by_fields)
    assert sum(found is not None for found in scans) > 2 * len(odd)


@pytest.mark.parametrize("tag", ["A,B.PV", "", 'A"B.PV'])
def test_a_tag_that_only_quotes_can_hold_is_not_found_in_plain_text(
    read: Read, monkeypatch: pytest.MonkeyPatch, scans: list[Scan | None], tag: str
) -> None:
    quoted = '"' + tag.replace('"', '""') + '"'
    lines = [f"{quoted},2026-01-31 00:00:00,1.5,Good", *scan(), *(line.replace("C,", f"{tag},") for line in scan())]
    options = IngestOptions(chunk_bytes=SMALL_CHUNKS)
    by_fields = read_by_fields(read, monkeypatch, text(lines), options)
    same(read(text(lines), options=options), by_fields)


def test_a_tag_that_is_too_long_is_refused(
    read: Read, monkeypatch: pytest.MonkeyPatch, scans: list[Scan | None]
) -> None:
    options = IngestOptions(max_name=13, chunk_bytes=400)
    by_fields = read_by_fields(read, monkeypatch, text(scan()), options)
    content = read(text(scan()), options=options)
    same(content, by_fields)
    assert content.rejects.counts["name_too_long"] == 2 * INSTANTS


def test_a_file_that_is_not_plain_is_not_tried_for_ever(
    read: Read, monkeypatch: pytest.MonkeyPatch, scans: list[Scan | None]
) -> None:
    monkeypatch.setattr(scanning, "PATIENCE", 3)
    bad = [line.replace("Good", '"Good"') for line in scan()]
    read(text(bad), options=IngestOptions(chunk_bytes=400))
    assert 3 <= len(scans) <= 3 + 3  # some are begun before the third is over


def numbers(values: list[str]) -> Scan | None:
    rows = "".join(f"FIC101.PV,noon,{value}\n" for value in values).encode()
    scanner = Scanner(LongPlan("long", 0, 3, (1,), TimeForm("text"), 0, 2), ",", ".", False)
    return scanner.scan(Lines(rows, 1, len(values)))


def test_numbers_are_those_next_to_what_is_written() -> None:
    draw = random.Random(3)
    texts = [f"{draw.uniform(-1, 1) * 10 ** draw.randrange(8):.{draw.randrange(9)}f}" for _ in range(20_000)]
    texts += ["0", "-0", "007.50", "123456789012345678"[:15], "0.000000000000001", "9007199254740992"]
    found = numbers(texts)
    assert found is not None
    expected = np.array([float(value) for value in texts])
    assert np.array_equal(found.values, expected)
    assert np.array_equal(np.signbit(found.values), np.signbit(expected))


def test_each_tag_is_learnt_once(read: Read, monkeypatch: pytest.MonkeyPatch, scans: list[Scan | None]) -> None:
    learnt: list[str] = []
    original = Scanner.learn

    def noted(self: Scanner, tags: list[str]) -> None:
        learnt.extend(tags)
        original(self, tags)

    monkeypatch.setattr(Scanner, "learn", noted)
    rows = [f"FIC{at}.PV,2026-01-31 00:{k:02d}:00,{at}" for at in range(50) for k in range(8)]
    content = read("\n".join(["Tagname,TimeStamp,Value", *rows]) + "\n", options=IngestOptions(chunk_bytes=1000))
    assert len(content.loops) == 50
    assert learnt == [f"FIC{at}.PV" for at in range(50)]
    assert len(scans) > 5


def test_tags_of_all_lengths_are_told_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By words of eight bytes, the last of which goes over the one before."""
    monkeypatch.setattr(frames, "LEAST_BYTES", 8)
    names = ["x" * n + last for n in range(30) for last in "ab"]
    rows = [f"{name}.PV,2026-01-31 00:{k:02d}:00,{at}" for k in range(20) for at, name in enumerate(names)]
    path = tmp_path / "night.csv"
    path.write_text("\n".join(["Tagname,TimeStamp,Value", *rows]) + "\n")
    parted: list[str] = []
    monkeypatch.setattr(FrameReader, "_part", lambda *_: parted.append("parted"))
    loops: list[LoopSamples] = list(read_export(path, options=IngestOptions(chunk_bytes=3000)).loops())
    assert {loop.loop: loop.pv.tolist() for loop in loops} == {name: [at] * 20 for at, name in enumerate(names)}
    assert not parted
