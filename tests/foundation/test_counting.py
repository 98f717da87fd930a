"""One of something is told as one."""

import asyncio
from collections.abc import Callable

import numpy as np
import pytest

from app.cli.audit import beside_shown
from app.cli.tables import totals
from app.counting import counted, counted_times
from app.engine.audit_config import AuditConfig
from app.engine.fitness import checks
from app.engine.mismatch import Comparison
from app.engine.mismatch.compare.aligning import beyond, sample_by_sample
from app.engine.mismatch.compare.comparison import part_in_words
from app.engine.mismatch.compare.even_grid import faults_of_the_clock
from app.engine.recording import Recording
from app.engine.reference import yper
from app.errors import DataError, LoopauditError
from app.http.bodies import LimitBodies
from app.http.receiving import LARGEST_MAPPING, mapping_of
from app.ingest import TagMapping
from app.ingest.exports.notes import mapping_notes
from app.services.auditing import audits
from app.services.damage import damage_in_words
from app.services.moments import PlantClock
from app.services.plant import reliability
from app.settings import Settings

FITNESS = AuditConfig().fitness
MAPPING = b"tag,loop,signal\nA,FIC1,PV\nB,FIC1,OP\nC,FIC2,PV\n"


def test_one_is_one() -> None:
    assert [counted(n, "sample") for n in (0, 1, 2)] == ["0 samples", "1 sample", "2 samples"]
    assert [counted(n, "row has", "rows have") for n in (1, 5)] == ["1 row has", "5 rows have"]
    assert [counted_times(n) for n in (1, 2)] == ["once", "2 times"]


SAID = {
    "length": lambda: checks.check_length(1, FITNESS).text,
    "missing": lambda: checks.check_missing(np.array([True]), None, FITNESS).text,
    "clock": lambda: " ".join(it.text for it in faults_of_the_clock(np.array([0.0, 2.0, 1.0]), 1)),
    "beyond": lambda: beyond(0.0, 9.0, np.array([5.0, 6.0, 11.0]))[0].text,
    "mapping": lambda: " ".join(mapping_notes(TagMapping.from_bytes(MAPPING), ["A"])),
    "damage": lambda: damage_in_words([(n * 10**18, n * 10**18 + 1) for n in range(4)], PlantClock("UTC")),
    "refused": lambda: " ".join(beside_shown(4, 3)),
}
EXPECTED = {
    "length": "1 sample; at least",
    "missing": "in 1 of 1 sample; at least",
    "clock": "time runs back once; sorting by time mixes the samples around a clock that was reset "
    "1 sample with a repeated time is left out",
    "beyond": "; 1 of its samples lies outside and is not compared",
    "mapping": "of loops of the file 1 mapped tag is not in it: B "
    "of the 2 loops of the mapping 1 is not in this file: FIC2",
    "damage": " and 1 stretch more cannot be read",
    "refused": "and 1 more row or value that was refused",
}


@pytest.mark.parametrize("name", list(SAID))
def test_one_of_it_is_told_as_one(name: str) -> None:
    assert EXPECTED[name] in SAID[name]()


def test_thousands_are_parted_as_on_the_pages() -> None:
    assert counted(3000, "loop") == "3,000 loops"
    assert counted_times(14000) == "14,000 times"


def test_both_numbers_of_a_sentence_are_parted_alike() -> None:
    assert "in 1,400 of 1,440 samples" in checks.check_missing(np.arange(1440) < 1400, None, FITNESS).text
    with pytest.raises(DataError, match="has 1,200 samples, the recording 1,440;"):
        sample_by_sample(1440, np.zeros(1200))
    with pytest.raises(DataError, match="op has 1,200 samples, time has 1,440;"):
        Recording("FIC1", np.arange(1440.0), np.zeros(1440), np.zeros(1200))


REFUSED = {
    "body": lambda: LimitBodies(None, Settings())._refusal("/v1/loops", 2_000_001, 2_000_000),
    "open": lambda: told_by(audits._refuse_flood, None),
    "limit": lambda: told_by(reliability._checked, 20_001, "loop"),
    "yper": lambda: told_by(yper._check, np.zeros(1200), np.zeros(1440)),
    "mapping": lambda: told_by(asyncio.run, mapping_of("x" * (LARGEST_MAPPING + 1))),
}
TOLD = {
    "body": "the body has 2,000,001 bytes, at most 2,000,000 are taken",
    "open": "100,000 loops and more wait",
    "limit": "from 1 to 20,000, got 20,001",
    "yper": "PV has 1,200 samples, OP has 1,440;",
    "mapping": f"at most {LARGEST_MAPPING:,} bytes;",
}


def told_by(call: Callable[..., object], *arguments: object) -> str:
    with pytest.raises(LoopauditError) as raised:
        call(*arguments)
    return raised.value.message


@pytest.mark.parametrize("name", list(REFUSED))
def test_limits_are_parted_too(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """They are the largest numbers that a user is told."""
    monkeypatch.setattr(audits.items, "count_open", lambda *_: audits.MOST_OPEN)
    assert TOLD[name] in REFUSED[name]()


def test_what_is_compared_in_a_sentence_is_parted_alike() -> None:
    comparison = Comparison("FIC1", 1.0, np.arange(30_000.0), np.arange(30_000.0))
    assert "of 30,000 samples, the first 4,000 are" in part_in_words(comparison, 0, 4000)
    assert str(totals([{"verdict": "stiction"}] * 1200)).startswith("1,200 recordings: 1,200 valve sticks")
