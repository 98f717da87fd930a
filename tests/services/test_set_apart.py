"""What is counted as to be relied on is what the rows that it leads to say of themselves."""

import time
from collections import Counter
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from sqlalchemy import update

from app.services.backend import Backend
from app.services.digests.making import digest_of
from app.services.digests.telling import subject
from app.services.plant import reliability
from app.services.plant.arrivals import arrivals
from app.services.plant.course import course
from app.services.plant.listing import listing
from app.services.plant.overview import overview
from app.services.plant.reliability import RowFilter
from app.services.plant.sticking import sticking
from app.services.plant.worst import complaints_of_old, worst_of_old
from app.services.reports.documents import plant_report
from app.services.stating import notes
from app.services.stating.shelving import shelf
from app.services.telling.wording import rely
from app.storage import loops as stored_loops
from app.storage import series
from app.storage.samples import Samples
from app.storage.series import Stretch
from app.storage.tables import audits, newest_rows, verdicts
from tests.services.audited_plant import audited

DAYS_AGO = {"A1": 0.1, "A2": 3.0, "A3": 0.1, "A4": 3.0, "A5": 20_700.0, "A6": 1.9, "A7": 3.0}
"""When the record of each ended; A5 has no date."""
SAID = {"verdict": "stiction", "reliability": "reliable", "likely_cause": "stiction", "reasons": ""}


@pytest.fixture
def run(backend: Backend, warm_kernels: None) -> int:
    """All of them stick, to be relied on, but A7; the valves of A3 and A4 were repaired after that."""
    random = np.random.default_rng(1)
    with backend.database.write() as connection:
        ids = stored_loops.ensure(connection, DAYS_AGO)
        for tag, days in DAYS_AGO.items():
            times = time.time_ns() - round(days * 86_400) * 10**9 + np.arange(-149, 1) * 60 * 10**9
            op = 50 + 5 * np.sin(np.arange(150) / 6) + random.normal(size=150)
            samples = Samples(times, {"pv": np.roll(op, 3) + random.normal(size=150), "op": op})
            series.add(connection, [Stretch(ids[tag], samples)], None)
    number = audited(backend)
    with backend.database.write() as connection:
        for table in (verdicts, newest_rows):
            said = SAID if table is verdicts else {name: SAID[name] for name in ("verdict", "reliability")}
            connection.execute(update(table).values(**said))
            unsure = update(table).where(table.c.loop_id == ids["A7"])
            connection.execute(unsure.values(reliability="not_reliable"))
        connection.execute(update(newest_rows).values(form="of the columns"))
    for tag in ("A3", "A4"):
        notes.add_note(backend, tag, "packing renewed", repaired_at=datetime.now(UTC))
    return number


def told_of(backend: Backend, audit_id: int | None = None) -> Counter[str]:
    asked = RowFilter(verdict=("stiction",), reliability="reliable", audit_id=audit_id)
    return Counter(rely(row) for row in reliability.table(backend, 20, filters=asked).rows)


def test_the_plant_and_its_night_count_what_their_rows_say(backend: Backend, run: int) -> None:
    assert told_of(backend) == told_of(backend, run) == {"yes": 3, "from before the repair": 2, "from an old record": 1}
    seen = overview(backend)
    assert (seen.verdicts["stiction"], seen.reliable["stiction"]) == (7, 3)
    assert seen.relied("stiction") == "3 can be relied on, 1 from old records, 2 from before the repair"
    (night,) = course(backend)
    assert (night.sticking, night.apart, night.of_units) == (3, 3, {None: 3})
    assert " 7 valves stick (3 can be relied on)" in subject(digest_of(backend, str(run)))


def test_the_report_lists_as_sticking_what_can_be_relied_on_and_names_the_others(backend: Backend, run: int) -> None:
    found = sticking(backend, shelf(backend), overview(backend).reliable["stiction"])
    assert sorted(valve.loop for _, valves in found.units for valve in valves) == ["A1", "A5", "A6"]
    assert sorted(row["loop"] for row in found.apart) == ["A2", "A3", "A4"]
    assert found.more == 0
    apart = plant_report(backend).partition('id="sticking-apart"')[2].partition("</p>")[0]
    assert "A2 (from an old record)" in apart
    assert "A4 (from before the repair)" in apart


def test_a_list_of_old_records_says_of_those_without_a_date_what_is_counted_of_them(backend: Backend, run: int) -> None:
    since_ns = arrivals(backend).current_ns
    old = {"A2": "from an old record", "A7": "from an old record", "A4": "from before the repair", "A5": "yes"}
    assert {row["loop"]: rely(row) for row in worst_of_old(backend, listing(backend, since_ns))} == old
    assert {row["loop"]: rely(row) for row in complaints_of_old(backend, listing(backend, since_ns))} == old
    told = {one.loop: one.told.rpartition(", ")[2] for one in digest_of(backend, str(run)).old}
    assert told == old | {"A5": "rely on it"}


def test_an_earlier_night_counts_by_what_was_known_by_its_end(backend: Backend, run: int) -> None:
    long_ago = datetime.now(UTC) - timedelta(days=2)
    with backend.database.write() as connection:
        connection.execute(update(audits).values(created_at=long_ago, ended_at=long_ago))
    audited(backend)
    assert told_of(backend, run) == {"yes": 4, "from an old record": 2}
    earlier = course(backend)[0]
    assert (earlier.run, earlier.sticking, earlier.apart) == (str(run), 4, 2)
    assert " 7 valves stick (4 can be relied on)" in subject(digest_of(backend, str(run)))


def test_of_a_collection_of_records_of_the_past_none_is_set_apart(backend: Backend, run: int) -> None:
    with backend.database.write() as connection:
        connection.execute(update(audits).values(created_at=datetime.now(UTC) + timedelta(days=40)))
    assert told_of(backend) == {"yes": 4, "from before the repair": 2}
    assert overview(backend).relied("stiction") == "4 can be relied on, 2 from before the repair"
