"""What a run says at its end of loops that a neighbour's valve shakes: sticky as far as their own record tells, and not
to be relied on.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any
from weakref import ref

import numpy as np
import pytest
from sqlalchemy import update

from app.engine.plant_wide.excerpts import Excerpts
from app.engine.plant_wide.groups import Candidate
from app.engine.simulate import SimulatedLoop
from app.lab.testbench import neighbours
from app.lab.testbench.neighbours import SOURCE
from app.services.audit_json.excerpts import by_tag
from app.services.audit_json.swings import candidates
from app.services.auditing import ending
from app.services.auditing.audits import cancel_audit, get_audit, start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.auditing.ending import end_if_complete
from app.services.auditing.hearing import SHAKEN_BY_NEIGHBOUR
from app.services.backend import Backend
from app.services.plant.loop_verdicts import loop_health, verdict_detail
from app.services.plant.reliability import RowFilter, in_parts
from app.services.upkeep.sweep import sweep
from app.storage import audits, items, loops, series, verdicts
from app.storage.audits import LoopFilter
from app.storage.samples import Samples
from app.storage.series import Stretch
from app.storage.tables import audit_items, newest_rows
from app.storage.verdicts import ExcerptsRow, SwingRow
from tests.table_rows import table_page

START_NS = 1_750_000_000_000_000_000
ALONE = "sticks too, with a period of its own"
SHAKEN_LOOPS = ("shaken 0", "shaken 2", "shaken 3")


@dataclass(frozen=True)
class Plant:
    backend: Backend
    run: str

    def row(self, tag: str) -> dict[str, Any]:
        [row] = table_page(self.backend, filters=RowFilter(search=tag)).rows
        return row


@cache
def simulated() -> dict[str, SimulatedLoop]:
    """A plant all of whose healthy loops are accused reliably by their own records, and a valve of another plant."""
    return {**neighbours.plant(1110), ALONE: neighbours.plant(1020)[SOURCE]}


def stored(backend: Backend, *tags: str) -> None:
    with backend.database.write() as connection:
        ids = loops.ensure(connection, tags)
        series.add(connection, [Stretch(ids[tag], samples(simulated()[tag])) for tag in tags], None)


def samples(loop: SimulatedLoop) -> Samples:
    return Samples(START_NS + (loop.time_s * 1e9).astype(np.int64), {"pv": loop.pv, "op": loop.op})


def audited(backend: Backend, wanted: LoopFilter | None = None) -> str:
    run = start_audit(backend, wanted)
    audit_chunk(backend, int(run.id), "test")
    return run.id


def held_up(backend: Backend) -> tuple[int, list[items.Claim]]:
    """A run over all loops that is done but for the first, which somebody else has claimed."""
    run = int(start_audit(backend).id)
    with backend.database.write() as connection:
        claims = items.claim(connection, run, "lost", 1, backend.settings.lease_s)
    audit_chunk(backend, run, "test")
    return run, claims


@pytest.fixture
def plant(backend: Backend, warm_kernels: None) -> Plant:
    stored(backend, SOURCE, ALONE, *SHAKEN_LOOPS)
    return Plant(backend, audited(backend))


def test_the_loops_by_themselves_are_relied_on(backend: Backend, warm_kernels: None) -> None:
    """What there is to mend: a healthy valve is accused, reliably, because of its neighbour's."""
    stored(backend, *SHAKEN_LOOPS[:1])
    row = Plant(backend, audited(backend)).row(SHAKEN_LOOPS[0])
    assert (row["verdict"], row["reliability"]) == ("stiction", "reliable")


def test_shaken_loops_are_not_relied_on_and_say_whose_valve_to_look_at(plant: Plant) -> None:
    assert get_audit(plant.backend, plant.run).state == "done"
    for tag in SHAKEN_LOOPS:
        row = plant.row(tag)
        assert (row["verdict"], row["reliability"]) == ("stiction", "not_reliable")
        assert row["reasons"].split(";")[0] == SHAKEN_BY_NEIGHBOUR
        assert f"in step with {SOURCE}" in row["reasons_text"]


def test_loops_of_which_some_are_read_at_a_time_all_say_it(
    backend: Backend, warm_kernels: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ending, "AT_ONCE", 2)
    stored(backend, SOURCE, *SHAKEN_LOOPS)
    plant = Plant(backend, audited(backend))
    for tag in SHAKEN_LOOPS:
        detail = verdict_detail(backend, tag)
        assert plant.row(tag)["reliability"] == "not_reliable"
        assert detail["reasons"][0]["code"] == SHAKEN_BY_NEIGHBOUR
        assert detail["findings"]


def test_who_writes_does_not_wait_while_what_is_kept_of_loops_is_unpacked(
    backend: Backend, warm_kernels: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A reader keeps writers waiting on SQLite."""
    parts: list[int] = []

    def writing_beside(rows: list[ExcerptsRow]) -> dict[str, Excerpts]:
        parts.append(len(rows))
        with backend.database.write() as connection:
            loops.ensure(connection, [f"new {len(parts)}"])
        return by_tag(rows)

    monkeypatch.setattr(verdicts, "EXCERPTS_AT_ONCE", 2)
    monkeypatch.setattr(ending, "by_tag", writing_beside)
    stored(backend, SOURCE, *SHAKEN_LOOPS[:2])
    audited(backend)
    assert parts == [2, 1]


def test_what_is_kept_of_op_and_sp_is_gone_before_the_swings_come(
    backend: Backend, warm_kernels: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a plant each takes tens of megabytes, and a worker's memory is what both took together."""
    kept: list[ref[Excerpts]] = []
    swinging: list[int] = []

    def noted(rows: list[ExcerptsRow]) -> dict[str, Excerpts]:
        found = by_tag(rows)
        kept.extend(map(ref, found.values()))
        return found

    def without_them(rows: list[SwingRow]) -> list[Candidate]:
        assert not any(one() for one in kept)
        swinging.append(len(rows))
        return candidates(rows)

    monkeypatch.setattr(ending, "by_tag", noted)
    monkeypatch.setattr(ending, "candidates", without_them)
    stored(backend, SOURCE, *SHAKEN_LOOPS[:2])
    audited(backend)
    assert swinging == [3]
    assert len(kept) == 3


def test_the_source_and_a_valve_with_a_swing_of_its_own_keep_their_verdicts(plant: Plant) -> None:
    for tag in (SOURCE, ALONE):
        row = plant.row(tag)
        assert (row["verdict"], row["reliability"]) == ("stiction", "reliable")
        assert SHAKEN_BY_NEIGHBOUR not in row["reasons"]


def test_every_view_of_the_verdict_says_the_same(plant: Plant) -> None:
    tag = SHAKEN_LOOPS[0]
    row, health = plant.row(tag), loop_health(plant.backend, tag)
    detail = verdict_detail(plant.backend, tag)
    assert health["reliability"] == row["reliability"] == "not_reliable"
    assert (
        health["health"] == row["health"] == pytest.approx(100.0 - sum(p["lost"] for p in detail["health"]), abs=0.05)
    )
    assert [reason["code"] for reason in detail["reasons"]] == row["reasons"].split(";")
    [valve] = [part for part in detail["health"] if part["code"] == "stiction"]
    assert valve["lost"] == pytest.approx(24.0 * row["stiction_probability"], abs=0.05)
    assert f'"loop":"{tag}"'.encode() in in_parts(plant.backend).as_json()
    filtered = table_page(plant.backend, filters=RowFilter(reliability="reliable", verdict=("stiction",)))
    assert [found["loop"] for found in filtered.rows] == [SOURCE, ALONE]


def test_the_table_that_was_read_before_the_end_is_read_again(backend: Backend, warm_kernels: None) -> None:
    stored(backend, SOURCE, *SHAKEN_LOOPS[:1])
    run, _ = held_up(backend)
    before = in_parts(backend)
    assert b"reliable" in before.as_json()
    with backend.database.write() as connection:
        connection.execute(update(audit_items).where(audit_items.c.state == "claimed").values(lease_until_s=0.0))
    audit_chunk(backend, run, "test")
    after = in_parts(backend)
    assert after.version != before.version
    assert SHAKEN_BY_NEIGHBOUR.encode() in after.as_json()


def test_a_loop_audited_alone_is_heard_beside_what_is_known_of_its_neighbours(plant: Plant) -> None:
    run = audited(plant.backend, LoopFilter(tags=(SHAKEN_LOOPS[0],)))
    row = plant.row(SHAKEN_LOOPS[0])
    assert row["audit_id"] == run
    assert row["reliability"] == "not_reliable"
    assert row["reasons"].split(";").count(SHAKEN_BY_NEIGHBOUR) == 1


def test_a_run_that_its_workers_left_complete_is_ended_by_the_sweep(backend: Backend, warm_kernels: None) -> None:
    stored(backend, SOURCE, *SHAKEN_LOOPS[:1])
    run, lost = held_up(backend)
    assert not end_if_complete(backend, run)
    with backend.database.write() as connection:
        items.fail(connection, [items.Failure(lost[0], "fault", "it broke")])
    assert sweep(backend).ended == 1
    assert get_audit(backend, str(run)).state == "partial"
    assert not end_if_complete(backend, run)


def test_a_run_that_is_cancelled_hears_what_it_has_found(backend: Backend, warm_kernels: None) -> None:
    stored(backend, SHAKEN_LOOPS[1])
    stored(backend, SOURCE, SHAKEN_LOOPS[0])
    run, _ = held_up(backend)
    heard = Plant(backend, str(run))
    assert heard.row(SHAKEN_LOOPS[0])["reliability"] == "reliable"
    assert cancel_audit(backend, str(run)).state == "cancelled"
    assert heard.row(SHAKEN_LOOPS[0])["reasons"].split(";")[0] == SHAKEN_BY_NEIGHBOUR
    assert cancel_audit(backend, str(run)).state == "cancelled"
    assert heard.row(SHAKEN_LOOPS[0])["reasons"].split(";").count(SHAKEN_BY_NEIGHBOUR) == 1


def test_a_cancellation_that_broke_off_is_ended_by_the_sweep(backend: Backend, warm_kernels: None) -> None:
    stored(backend, SOURCE, *SHAKEN_LOOPS[:1])
    run, _ = held_up(backend)
    with backend.database.write() as connection:
        assert audits.cancel(connection, run) == 1
    assert sweep(backend).ended == 1
    assert get_audit(backend, str(run)).state == "cancelled"


def test_who_comes_after_the_end_rewords_nothing(
    backend: Backend, warm_kernels: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A worker that was overtaken by a cancellation, or by another worker: readers keep what they read after the
    end."""
    stored(backend, SHAKEN_LOOPS[1])
    stored(backend, SOURCE, SHAKEN_LOOPS[0])
    run, lost = held_up(backend)
    with backend.database.write() as connection:
        items.fail(connection, [items.Failure(lost[0], "fault", "it broke")])
    doubts = ending._hear_others(backend, run)
    assert [doubt.columns["reliability"] for doubt in doubts] == ["not_reliable"]
    with backend.database.write() as connection:
        assert audits.end_if_complete(connection, run)
    monkeypatch.setattr(ending.audits, "complete", lambda _: [run])
    monkeypatch.setattr(ending, "_hear_others", lambda *_: doubts)
    assert not end_if_complete(backend, run)
    assert Plant(backend, str(run)).row(SHAKEN_LOOPS[0])["reliability"] == "reliable"


def test_a_run_ends_whatever_is_kept_of_a_loop(plant: Plant) -> None:
    with plant.backend.database.write() as connection:
        connection.execute(update(newest_rows).values(swing_json="{}"))
    run = audited(plant.backend, LoopFilter(tags=(SOURCE,)))
    assert get_audit(plant.backend, run).state == "done"
