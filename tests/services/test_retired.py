"""A retired loop keeps what is stored of it, and is left out of whatever is said of all loops."""

import json
from collections.abc import Callable, Iterable
from datetime import UTC, date, datetime, timedelta

import pytest
from sqlalchemy import select, update

from app.errors import NotFoundError, RequestError
from app.services.auditing.audits import LoopFilter, start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.auditing.nightly import announce_explanations, nightly, refuse_empty
from app.services.backend import Backend
from app.services.digests.making import digest_of, run_to_tell
from app.services.digests.telling import as_text
from app.services.loops import get_loop, list_loops
from app.services.moments import ns_of
from app.services.plant import changes, reliability, worst
from app.services.plant import overview as plant
from app.services.plant.arrivals import NOTHING_NEW, arrivals
from app.services.plant.groups import groups_of, plant_groups
from app.services.plant.listing import listing
from app.services.plant.loop_verdicts import loop_health, verdict_history
from app.services.plant.reliability import RowFilter, in_parts
from app.services.plant.repaired import repairs
from app.services.plant.trend import trend
from app.services.reports.documents import loop_report, plant_report
from app.services.stating.notes import add_note, list_notes
from app.services.stating.properties import patch_loop
from app.services.upkeep import doctor
from app.services.upkeep.metrics import metrics
from app.storage import loops as stored_loops
from app.storage import verdicts as stored_verdicts
from app.storage.loops import ListFilter
from app.storage.tables import explanations, loops, newest_rows, verdicts
from tests.table_rows import table_page

AddLoops = Callable[..., dict[str, int]]
GONE, STAYS = "upload-4cddb1367ca0", ("FIC1", "FIC2", "FIC3")
WORST = {"verdict": "stiction", "stiction_probability": 0.99, "health": 1.0}
DAY = timedelta(days=1)


@pytest.fixture
def night(backend: Backend, add_loops: AddLoops) -> str:
    """The second night of a plant whose worst loop, said to stick since then, has sent nothing for four days."""
    ids = add_loops(GONE, *STAYS, n=600, unit="U1", type="flow")
    now = datetime.now(UTC)
    first = nightly(backend, date(2026, 1, 1))
    audit_chunk(backend, int(first.id), "test")
    add_note(backend, GONE, "exchanged", repaired_at=now - DAY)
    second = nightly(backend, date(2026, 1, 2))
    audit_chunk(backend, int(second.id), "test")
    with backend.database.write() as connection:
        for tag, days in ((GONE, 4), *((tag, 0) for tag in STAYS)):
            end_ns, loop_id = ns_of(now - days * DAY), ids[tag]
            connection.execute(update(loops).where(loops.c.id == loop_id).values(newest_ns=end_ns))
            connection.execute(update(verdicts).where(verdicts.c.loop_id == loop_id).values(input_end_ns=end_ns))
        told = (verdicts.c.loop_id == ids[GONE], verdicts.c.audit_id == int(second.id))
        connection.execute(update(verdicts).where(*told).values(**WORST))
        before = {"verdict_before": "no_stiction"}
        connection.execute(update(newest_rows).where(newest_rows.c.loop_id == ids[GONE]).values(**WORST, **before))
        first_told = (verdicts.c.loop_id == ids[GONE], verdicts.c.audit_id == int(first.id))
        connection.execute(update(verdicts).where(*first_told).values(verdict="no_stiction"))
    return second.id


def retire(backend: Backend, retired: bool = True) -> None:
    assert patch_loop(backend, GONE, {"retired": retired}).retired is retired


def named(tags: Iterable[str]) -> int:
    return int(GONE in list(tags))


def metric(backend: Backend, name: str) -> float:
    return sum(sample.value for found in metrics(backend) if found.name == name for sample in found.samples)


def kept(backend: Backend, ask: Callable[..., list[object]]) -> int:
    with backend.database.read() as connection:
        return named(row.tag for row in ask(connection))


def digest(backend: Backend):
    return digest_of(backend, run_to_tell(backend))


ASKED: dict[str, Callable[[Backend], float]] = {
    "loops of the plant": lambda b: plant.overview(b).loops,
    "audited loops": lambda b: plant.overview(b).audited,
    "loops of its unit": lambda b: plant.overview(b).units[0].loops,
    "worst list": lambda b: named(row["loop"] for row in worst.worst(b, listing(b))),
    "page of the table": lambda b: named(row["loop"] for row in reliability.table(b, 9).rows),
    "treemap": lambda b: named(row[0] for row in plant.tiles(b)["loops"]),
    "units of the treemap": lambda b: plant.tiles(b)["units"][0][1],
    "treemap of its unit": lambda b: named(row[0] for row in plant.unit_tiles(b, "U1")["loops"]),
    "changes": lambda b: named(change.loop for change in changes.changes(b).rows),
    "repairs": lambda b: named(repair.loop for repair in repairs(b).listed),
    "groups": lambda b: named(member.loop for group in plant_groups(b) for member in group.members),
    "groups of a neighbour": lambda b: named(m.loop for one in groups_of(plant_groups(b), "FIC1") for m in one.members),
    "what is said of loops": lambda b: kept(b, stored_verdicts.said),
    "what swings": lambda b: kept(b, stored_verdicts.swings),
    "what moves": lambda b: kept(b, stored_verdicts.excerpts),
    "loops behind": lambda b: arrivals(b).behind,
    "loops behind of a run": lambda b: arrivals(b, int(run_to_tell(b))).behind,
    "metric of loops": lambda b: metric(b, "loopaudit_loops"),
    "metric of loops behind": lambda b: metric(b, "loopaudit_loops_behind"),
    "metric of verdicts": lambda b: metric(b, "loopaudit_verdicts"),
    "the doctor's warning": lambda b: int(doctor.records(b).state == "warning"),
    "reliability table": lambda b: named(row["loop"] for row in table_page(b).rows),
    "reliability table by a column of verdicts": lambda b: len(table_page(b, sort="yper_pct").rows),
    "reliability table as JSON": lambda b: len(json.loads(in_parts(b).as_json())["rows"]),
    "verdicts of the digest": lambda b: sum(digest(b).verdicts.values()),
    "worst of the digest": lambda b: named(one.loop for one in digest(b).old),
    "changes of the digest": lambda b: named(change.loop for change in digest(b).changes),
    "repairs of the digest": lambda b: named(repair.loop for repair in digest(b).repairs),
    "text of the digest": lambda b: int(GONE in as_text(digest(b))),
    "report of the plant": lambda b: int(GONE in plant_report(b)),
    "run of the plant": lambda b: start_audit(b).total,
    "run of its unit": lambda b: start_audit(b, LoopFilter(unit="U1")).total,
    "run of its type": lambda b: start_audit(b, LoopFilter(type="flow")).total,
}


def test_it_is_left_out_of_what_is_said_of_all_until_it_is_in_service_again(backend: Backend, night: str) -> None:
    before = {name: ask(backend) for name, ask in ASKED.items()}
    retire(backend)
    without = {name: ask(backend) for name, ask in ASKED.items()}
    assert {name: before[name] - without[name] for name in ASKED} == dict.fromkeys(ASKED, 1)
    assert (plant.overview(backend).retired, metric(backend, "loopaudit_loops_retired")) == (1, 1)
    retire(backend, retired=False)
    assert {name: ask(backend) for name, ask in ASKED.items()} == before


def test_it_keeps_what_is_stored_of_it(backend: Backend, night: str) -> None:
    retire(backend)
    assert get_loop(backend, GONE).retired
    assert loop_health(backend, GONE)["audit_id"] == night
    assert len(verdict_history(backend, GONE).rows) == 2
    assert len(list_notes(backend, GONE)) == 1
    assert "This loop is retired" in loop_report(backend, GONE)
    assert "This loop is retired" not in loop_report(backend, "FIC1")
    assert trend(backend, GONE, end=datetime(2025, 7, 1, tzinfo=UTC), start=datetime(2025, 6, 1, tzinfo=UTC)).samples


def test_it_is_found_where_it_is_asked_for(backend: Backend, night: str) -> None:
    retire(backend)

    def listed(retired: bool | None) -> list[str]:
        return [loop.tag for loop in list_loops(backend, wanted=ListFilter(retired=retired)).rows]

    def rows(retired: bool | None) -> list[str]:
        return [row["loop"] for row in table_page(backend, filters=RowFilter(retired=retired)).rows]

    assert listed(True) == rows(True) == [GONE]
    assert listed(False) == rows(False) == list(STAYS)
    assert listed(None) == rows(None) == [*STAYS, GONE]


def test_a_run_that_names_it_audits_it(backend: Backend, add_loops: AddLoops) -> None:
    add_loops(GONE, *STAYS)
    retire(backend)
    run = start_audit(backend, LoopFilter(tags=(GONE,)))
    audit_chunk(backend, int(run.id), "test")
    assert loop_health(backend, GONE)["audit_id"] == run.id
    assert plant.overview(backend).audited == 0
    mine = RowFilter(audit_id=int(run.id), retired=None)
    assert [row["loop"] for row in table_page(backend, filters=mine).rows] == [GONE]


def test_a_unit_of_retired_loops_has_none_to_audit(backend: Backend, add_loops: AddLoops) -> None:
    add_loops(GONE, unit="OLD")
    add_loops(*STAYS, unit="U1")
    assert plant.unit_names(backend) == ["OLD", "U1"]
    retire(backend)
    assert plant.unit_names(backend) == ["U1"]
    with pytest.raises(RequestError, match="no loop with samples and in service has unit 'OLD'"):
        start_audit(backend, LoopFilter(unit="OLD"))


@pytest.mark.parametrize("retired", [False, True])
def test_nobody_asks_at_night_why_it_sticks(backend: Backend, night: str, retired: bool) -> None:
    retire(backend, retired)
    announce_explanations(backend)
    with backend.database.read() as connection:
        [gone] = stored_loops.ids_of(connection, [GONE]).values()
        asked = list(connection.scalars(select(explanations.c.loop_id)))
    assert (gone in asked) is not retired


def test_a_plant_that_is_smaller_now_has_whole_runs_of_its_size(backend: Backend, add_loops: AddLoops) -> None:
    add_loops(*(f"OLD{k}" for k in range(5)), "FIC1", "FIC2", n=60)
    large, last = start_audit(backend), None
    audit_chunk(backend, int(large.id), "test")
    for k in range(5):
        patch_loop(backend, f"OLD{k}", {"retired": True})
    last = start_audit(backend)
    assert last.total == 2
    audit_chunk(backend, int(last.id), "test")
    assert changes.changes(backend).run_id == last.id


def test_a_plant_whose_loops_are_all_retired_has_no_nights(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("FIC1", n=60)
    refuse_empty(backend)
    patch_loop(backend, "FIC1", {"retired": True})
    with pytest.raises(RequestError) as refused:
        refuse_empty(backend)
    assert refused.value.code == "no_loops"
    with backend.database.read() as connection:
        assert not stored_loops.any_before(connection, datetime.now(UTC) + DAY)


def test_of_a_plant_whose_loops_are_all_retired_nothing_good_is_said(backend: Backend, night: str) -> None:
    for tag in (*STAYS, GONE):
        patch_loop(backend, tag, {"retired": True})
    told = as_text(digest_of(backend, run_to_tell(backend)))
    assert "No loop in service has a verdict." in told
    assert "as far as the records tell" not in told
    assert NOTHING_NEW not in told
    with pytest.raises(NotFoundError, match="no loop of the plant is in service"):
        plant_report(backend)
