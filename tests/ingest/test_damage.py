"""Files with a little damage: it costs the rows or fields that have it, and nothing else."""

from datetime import datetime, timedelta

import numpy as np
import pytest

from app.errors import DataError
from app.ingest import IngestOptions

from .conftest import Read
from .test_tables import workbook

START = datetime(2024, 3, 1)
COUNT = 40
STAMPS = [str(START + timedelta(seconds=10 * i)) for i in range(COUNT)]
WIDE = ["DateTime,A.PV,A.OP", *(f"{stamp},{i + 0.125},{50 + i}" for i, stamp in enumerate(STAMPS))]
BARE = [
    f"{stamp},A.{word},{i + at},float,GOOD" for i, stamp in enumerate(STAMPS) for at, word in ((0.5, "PV"), (50, "OP"))
]


def text(lines: list[str]) -> str:
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("stamp", ["2024-03-01T00:00:00Z", "2024-03-01T00:00:00", "01.03.2024 00:00:00"])
def test_a_first_stamp_in_another_writing_costs_its_row(read: Read, stamp: str) -> None:
    content = read(text([WIDE[0], stamp + WIDE[1][19:], *WIDE[2:]]))
    assert content.loops["A"].pv.tolist() == [i + 0.125 for i in range(1, COUNT)]
    assert [(reject.line, reject.code) for reject in content.rejects.listed] == [(2, "bad_time")]
