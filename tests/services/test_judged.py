"""Of which time a verdict is: a loop that went to manual keeps the verdict of before, and says so."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from sqlalchemy import select, update

from app.services.auditing.audits import start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.auditing.nightly import nightly
from app.services.backend import Backend
from app.services.digests.making import digest_of
from app.services.digests.telling import as_html, as_text
from app.services.plant import changes
from app.services.plant.judged import judged, to_manual
from app.services.plant.nights import nights
from app.services.reports.documents import plant_report
from app.storage import series
from app.storage.samples import Samples
from app.storage.series import Stretch
from app.storage.tables import audits, loops, verdicts
from tests.services.conftest import MINUTE, START_NS
from tests.services.spoiled import loop_id_of, spoil

AddLoops = Callable[..., dict[str, int]]
TOLD = "judged 2025-06-15 15:06 to 20:05; in manual since"


def record(backend: Backend, loop_id: int, first: int, count: int, automatic: float) -> None:
    steps = np.arange(first, first + count)
    rng = np.random.default_rng(first)
    op = 50 + 5 * np.sin(steps / 6) + 0.2 * rng.normal(size=count)
    pv = 20 + 2 * np.sin(steps / 6 - 0.8) + 0.05 * rng.normal(size=count)
    signals = {"pv": pv, "op": op, "automatic": np.full(count, automatic)}
    with backend.database.write() as connection:
        series.add(connection, [Stretch(loop_id, Samples(START_NS + steps * MINUTE, signals))], None)


def run(backend: Backend, audit_id: str) -> int:
    audit_chunk(backend, int(audit_id), "test")
    return int(audit_id)


@pytest.fixture
def left(backend: Backend, add_loops: AddLoops) -> tuple[int, int]:
    """A is in manual for all that is new in the second run, B is not: its runs."""
    ids = add_loops("A", "B", n=0)
    for loop_id in ids.values():
        record(backend, loop_id, 0, 300, 1.0)
    first = run(backend, start_audit(backend).id)
    record(backend, ids["A"], 300, 200, 0.0)
    record(backend, ids["B"], 300, 200, 1.0)
    second = run(backend, nightly(backend).id)
    with backend.database.write() as connection:
        values = {"verdict": "stiction", "reliability": "reliable"}
        connection.execute(update(verdicts).where(verdicts.c.loop_id == ids["A"]).values(**values))
    return first, second


def test_a_loop_that_went_to_manual_says_so(backend: Backend, left: tuple[int, int]) -> None:
    found = judged(backend, ["A", "B"])
    assert {tag: of.words(backend.clock) for tag, of in found.items()} == {"A": TOLD}
    assert judged(backend, ["A", "B"], left[0]) == {}


def test_it_is_what_changed(backend: Backend, left: tuple[int, int]) -> None:
    assert [one.loop for one in changes.changes(backend).to_manual] == ["A"]
    third = run(backend, start_audit(backend).id)
    assert to_manual(backend, third) == []  # news once
    record(backend, loop_id_of(backend, "A"), 500, 100, 0.0)
    assert to_manual(backend, run(backend, start_audit(backend).id)) == []  # though it goes on in manual
    with backend.database.write() as connection:
        connection.execute(update(loops).where(loops.c.tag == "A").values(retired=True))
    assert to_manual(backend, left[1]) == []


def test_what_could_be_judged_since_is_not_said_to_be_beyond_judgement(backend: Backend, add_loops: AddLoops) -> None:
    """Back in automatic, but for less than half of the time before: the engine takes the longer stretch."""
    of = add_loops("A", n=0)["A"]
    for first, count, automatic in ((0, 900, 1.0), (900, 100, 0.0), (1000, 400, 1.0)):
        record(backend, of, first, count, automatic)
    run(backend, start_audit(backend).id)
    told = judged(backend, ["A"])["A"].words(backend.clock)
    assert told == "judged 2025-06-15 15:06 to 2025-06-16 06:05; what was recorded since was not judged"


def test_what_was_judged_since_and_says_otherwise_is_not_said_to_be_unjudged(
    backend: Backend, add_loops: AddLoops
) -> None:
    of = add_loops("A", n=0)["A"]
    for first, count, automatic in ((0, 900, 1.0), (900, 100, 0.0), (1000, 400, 1.0)):
        record(backend, of, first, count, automatic)
    run(backend, start_audit(backend).id)
    with backend.database.write() as connection:
        connection.execute(update(verdicts).values(reasons="shape_path;newer_disagrees"))
    told = judged(backend, ["A"])["A"].words(backend.clock)
    assert told.endswith("; what was recorded since is shorter, and disagrees")


def test_a_loop_that_is_back_in_automatic_did_not_go_to_manual(backend: Backend, left: tuple[int, int]) -> None:
    """Though most of the time since was in manual, as of a unit that stood for a night and runs again."""
    of = loop_id_of(backend, "A")
    record(backend, of, 500, 90, 1.0)
    again = run(backend, start_audit(backend).id)
    told = judged(backend, ["A"])["A"].words(backend.clock)
    assert told == "judged 2025-06-15 15:06 to 20:05; what was recorded since was not judged"
    assert to_manual(backend, left[1], and_since=True) == []
    record(backend, of, 590, 30, 0.0)
    run(backend, start_audit(backend).id)
    assert judged(backend, ["A"])["A"].words(backend.clock) == TOLD
    assert judged(backend, ["A"], again)["A"].words(backend.clock).endswith("was not judged")


def test_a_mode_that_is_not_understood_is_not_told_as_manual(backend: Backend, add_loops: AddLoops) -> None:
    of = add_loops("A", n=0)["A"]
    for first, count, mode in ((0, 900, 1.0), (900, 500, -1.0), (1400, 100, 0.0)):
        record(backend, of, first, count, mode)
    run(backend, start_audit(backend).id)
    told = judged(backend, ["A"])["A"].words(backend.clock)
    assert told == "judged 2025-06-15 15:06 to 2025-06-16 06:05; what was recorded since was not judged"


def test_a_loop_of_which_no_mode_is_understood_is_judged(backend: Backend, add_loops: AddLoops) -> None:
    for tag, of in add_loops("A", "B", n=0).items():
        record(backend, of, 0, 900, -1.0 if tag == "A" else 0.0)
    run(backend, start_audit(backend).id)
    with backend.database.read() as connection:
        causes = dict(connection.execute(select(loops.c.tag, verdicts.c.likely_cause).join_from(loops, verdicts)).all())
    assert causes["A"] != "not_in_automatic" == causes["B"]


def test_the_same_window_is_no_other_night(backend: Backend, left: tuple[int, int]) -> None:
    with backend.database.write() as connection:
        yesterday = datetime.now(UTC) - timedelta(days=1)
        connection.execute(update(audits).where(audits.c.id == left[0]).values(created_at=yesterday))
        connection.execute(update(verdicts).where(verdicts.c.audit_id == left[0]).values(audited_at=yesterday))
    marks = {tag: [night.mark for night in told] for tag, told in nights(backend, ["A", "B"]).items()}
    assert marks["A"] == ["S", "="]
    assert "=" not in marks["B"]
    assert "judged on the same data as before" in nights(backend, ["A"])["A"][1].words


def test_digest_and_report_tell_it(backend: Backend, left: tuple[int, int]) -> None:
    found = digest_of(backend, str(left[1]))
    for told in (as_text(found), as_html(found)):
        assert "A: went to manual" in told
        assert told.count(TOLD) == 2  # what changed, and what to do
    assert TOLD in plant_report(backend)


def test_where_what_came_since_is_damaged_the_rest_tells(backend: Backend, left: tuple[int, int]) -> None:
    """The manual hours in two stretches, of which the second cannot be read."""
    ids = {"A": loop_id_of(backend, "A")}
    record(backend, ids["A"], 500, 100, 0.0)
    run(backend, start_audit(backend).id)
    spoil(backend, ids["A"], START_NS + 500 * MINUTE)
    found = judged(backend, ["A"])["A"]
    assert found.manual
    words = found.words(backend.clock)
    assert words.startswith(f"{TOLD}. What was stored from 2025-06-15 23:26 to 2025-06-16 01:05 cannot be read")
    assert f"{TOLD}. What was stored" in plant_report(backend)
    spoil(backend, ids["A"], START_NS + 300 * MINUTE)
    assert "what was recorded since was not judged" in judged(backend, ["A"])["A"].words(backend.clock)
