"""What the report of the plant promises of the table, and where it leads to."""

import re
from datetime import UTC, datetime, timedelta

import pytest

from app.services.backend import Backend
from app.services.plant.reliability import RowFilter, count
from app.services.reports.documents import plant_report
from app.services.stating.notes import add_note
from tests.services.audited_plant import AddLoops, audited, rewrite, rewrite_newest

PLANT = "https://plant.example"


@pytest.mark.parametrize(("unit", "query"), [("A & B", "unit=A%20%26%20B"), (None, "no_unit=true")])
def test_the_worst_of_a_unit_say_what_the_table_has_of_it(
    backend: Backend, add_loops: AddLoops, unit: str | None, query: str
) -> None:
    tags = [f"L{number}" for number in range(8)]
    ids = add_loops(*tags, n=600, unit=unit) | add_loops("ELSEWHERE", n=600, unit="U9")
    run = audited(backend)
    for tag, loop_id in ids.items():
        verdict = "no_stiction" if tag == "L7" else "stiction"
        said = {"verdict": verdict, "reliability": "reliable", "health": 40.0}
        rewrite(backend, run, loop_id, **said)
        rewrite_newest(backend, loop_id, **said)
    add_note(backend, "L6", text="waits", shelved_until=datetime.now(UTC) + timedelta(days=3))
    settings = backend.settings.model_copy(update={"public_url": PLANT})
    report = plant_report(Backend(settings, backend.database, backend.queue))
    worst = report[report.index("Worst of each unit") :]
    assert re.findall(r'href="([^"]*/table[^"]*)">([^<]*)<', worst) == [
        (f"{PLANT}/table?{query}&amp;verdict=stiction", "7 valve sticks")
    ]
    asked = RowFilter(verdict=("stiction",), unit=unit, no_unit=None if unit else True)
    assert count(backend, asked) == 7
