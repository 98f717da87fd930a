"""The demo plant: 60 loops, the same in every run, each with a truth."""

import gzip
from collections import Counter
from datetime import UTC, datetime

import pytest

from app.services.demo import SAMPLES, plant, write_exports

END = datetime(2026, 3, 1, tzinfo=UTC)


@pytest.fixture(scope="module")
def exports(tmp_path_factory):
    return write_exports(tmp_path_factory.mktemp("demo"), plant(), END)


def test_has_60_loops_in_every_condition():
    loops = plant()
    assert len({loop.tag for loop in loops}) == 60
    conditions = {loop.condition for loop in loops}
    assert conditions == {
        "healthy",
        "sticky valve",
        "sticky level valve",
        "tight tuning",
        "external oscillation",
        "integrating level",
        "dead transmitter",
        "in manual",
    }
    assert Counter(loop.right_verdict for loop in loops) == {"no_stiction": 36, "stiction": 17, "not_auditable": 7}


def test_every_unit_is_exported_once_and_every_loop_is_in_one_export(exports):
    assert sorted(tag for export in exports for tag in export.tags) == sorted(loop.tag for loop in plant())
    assert len({export.path.name for export in exports}) == 4


def test_a_wide_export_has_four_columns_a_loop_and_a_line_a_sample(exports):
    lines = exports[0].path.read_text().splitlines()
    assert len(lines) == SAMPLES + 1
    header = lines[0].split(",")
    assert len(header) == 1 + 4 * len(exports[0].tags)
    assert lines[-1].startswith("2026-02-28T23:59:55Z,")


def test_the_other_layouts(exports):
    by_name = {export.path.name: export.path for export in exports}
    assert by_name["reaction_long.csv"].read_text().startswith("Tagname,TimeStamp,Value,DataQuality\n")
    assert by_name["utilities_semicolons.csv"].read_text().splitlines()[1].count(",") > 30
    assert gzip.decompress(by_name["tanks_long.csv.gz"].read_bytes()).startswith(b"Tagname,")


def test_is_the_same_in_every_run(exports, tmp_path):
    again = write_exports(tmp_path, plant(), END)
    assert [a.path.read_bytes() for a in again] == [b.path.read_bytes() for b in exports]
