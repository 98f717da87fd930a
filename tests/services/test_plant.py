"""What changed in the plant and why, what a repair changed, and which loops swing together."""

import threading
from collections.abc import Callable
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import update

from app.engine.key_figures import KeyFigures
from app.errors import NotFoundError, RequestError
from app.services.auditing.audits import LoopFilter, start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.auditing.nightly import nightly
from app.services.backend import Backend
from app.services.digests.digest import as_text, digest_of, newest_run
from app.services.plant import glossary, groups, notes
from app.services.plant import overview as plant
from app.services.plant.before_after import compared
from app.services.plant.groups import groups_of, plant_groups
from app.services.plant.loops import loop_health, newest_failure, patch_loop, verdict_history
from app.services.telling.wording import headline, probability
from app.storage import items, loops
from app.storage.items import Failure
from app.storage.tables import audits, newest_rows, verdicts

AddLoops = Callable[..., dict[str, int]]


def audited(backend: Backend) -> int:
    run = start_audit(backend)
    audit_chunk(backend, int(run.id), "test")
    return int(run.id)


def rewrite(backend: Backend, run: int, loop: int, **values: object) -> None:
    """A verdict as if it had been another one, in the row of the verdict after it too."""
    mine = (verdicts.c.audit_id == run, verdicts.c.loop_id == loop)
    after = (newest_rows.c.before_audit_id == run, newest_rows.c.loop_id == loop)
    with backend.database.write() as connection:
        connection.execute(update(verdicts).where(*mine).values(**values))
        if "verdict" in values:
            connection.execute(update(newest_rows).where(*after).values(verdict_before=values["verdict"]))


def test_an_audit_that_failed_is_told_until_one_has_not(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("A", "B")
    assert newest_failure(backend, "A") is None
    run = int(start_audit(backend).id)
    with backend.database.write() as connection:
        [claim] = [c for c in items.claim(connection, run, "test", 2, 60.0) if c.loop_id == loop_named(backend, "A")]
        items.fail(connection, [Failure(claim, "fault", "it broke")])
    assert newest_failure(backend, "A") == (run, "it broke")
    assert newest_failure(backend, "B") is None
    audited(backend)
    assert newest_failure(backend, "A") is None


def loop_named(backend: Backend, tag: str) -> int:
    with backend.database.read() as connection:
        row = loops.by_tag(connection, tag)
    assert row is not None
    return row.id


@pytest.fixture
def two_runs(backend: Backend, add_loops: AddLoops) -> tuple[dict[str, int], int]:
    """Four loops audited twice, with the ids of the loops and of the first run."""
    ids = add_loops("A", "B", "C", "D", n=600, unit="U1")
    first = audited(backend)
    audited(backend)
    return ids, first


def test_a_first_run_is_no_news(backend: Backend, add_loops: AddLoops) -> None:
    assert plant.changes(backend).run_id is None
    add_loops("A")
    audited(backend)
    assert plant.changes(backend).rows == []


def test_nothing_changed(backend: Backend, two_runs: tuple[dict[str, int], int]) -> None:
    assert plant.changes(backend).rows == []


@pytest.mark.parametrize(
    ("before", "why", "because"),
    [
        ({"stiction_probability": None}, "loop", "what was seen differs a little from the record before"),
        ({"engine_version": "0.0.1"}, "method", "the method changed (engine or settings)"),
        ({"config_fingerprint": "other"}, "method", "the method changed (engine or settings)"),
        ({"samples": 100}, "data", "more was recorded than before"),
        ({"samples": 100_000}, "data", "the record changed (gaps, length or sampling)"),
        ({"sampling_interval_s": 1.0}, "data", "the record changed (gaps, length or sampling)"),
    ],
)
def test_a_changed_verdict_says_why(
    backend: Backend, two_runs: tuple[dict[str, int], int], before: dict[str, object], why: str, because: str
) -> None:
    ids, first = two_runs
    rewrite(backend, first + 1, ids["B"], reliability="reliable")
    now = loop_health(backend, "B")["verdict"]
    other = "no_stiction" if now == "stiction" else "stiction"
    rewrite(backend, first, ids["B"], verdict=other, **before)
    (change,) = plant.changes(backend).rows
    assert (change.loop, change.before, change.now, change.why, change.because) == ("B", other, now, why, because)
    assert change.kind == ("new" if now == "stiction" else "cured" if now == "no_stiction" else "flipped")


@pytest.mark.parametrize(
    ("now", "before", "kind"),
    [
        ({"stiction_probability": 0.55}, {"stiction_probability": 0.27}, "wavers"),
        ({"stiction_probability": 0.55}, {"stiction_probability": 0.2}, "new"),
        ({"stiction_probability": 0.55, "reliability": "reliable"}, {"stiction_probability": 0.5}, "new"),
        ({"stiction_probability": 0.55, "reasons": "stiction_began"}, {"stiction_probability": 0.5}, "new"),
        ({"stiction_probability": 0.55}, {"stiction_probability": 0.5, "engine_version": "0.0.1"}, "new"),
    ],
)
def test_a_loop_on_the_edge_wavers_and_is_no_news(
    backend: Backend,
    two_runs: tuple[dict[str, int], int],
    now: dict[str, object],
    before: dict[str, object],
    kind: str,
) -> None:
    ids, first = two_runs
    for tag in ("B", "C"):
        sticks = {"verdict": "stiction", "reliability": "not_reliable", "reasons": "shape_x", **now}
        rewrite(backend, first + 1, ids[tag], **sticks)
        rewrite_newest(backend, ids[tag], verdict="stiction", health=10.0 if tag == "B" else 50.0)
        rewrite(backend, first, ids[tag], **{"verdict": "no_stiction", "reasons": "shape_x", **before})
    rewrite(backend, first + 1, ids["C"], reliability="reliable")
    told = [(change.loop, change.kind) for change in plant.changes(backend).rows]
    assert told == ([("C", "new"), ("B", "wavers")] if kind == "wavers" else [("B", "new"), ("C", "new")])


def test_what_wavered_is_news_where_it_stands_for_a_second_night(
    backend: Backend, two_runs: tuple[dict[str, int], int]
) -> None:
    ids, first = two_runs
    third = audited(backend)
    for tag, before in (("B", 0.4), ("C", 0.1)):
        told = {"reliability": "not_reliable", "reasons": "shape_x", "stiction_probability": 0.55}
        rewrite(backend, third, ids[tag], verdict="stiction", **told)
        rewrite_newest(backend, ids[tag], verdict="stiction")
        rewrite(backend, first + 1, ids[tag], verdict="stiction", **told)
        rewrite(backend, first, ids[tag], **told | {"verdict": "no_stiction", "stiction_probability": before})
    (change,) = plant.changes(backend).rows
    assert (change.loop, change.kind, change.before) == ("B", "new", "no_stiction"), "C was news the night before"
    assert change.because == "said for the second night; probability 0.40 -> 0.55"
    told = digest_of(backend, str(third))
    assert [(one.loop, one.kind) for one in told.changes] == [("B", "new")]
    audited(backend)
    assert [row.loop for row in plant.changes(backend).rows if row.kind == "new" and row.loop == "C"] == []


def test_a_changed_verdict_names_the_evidence_that_moved_most(
    backend: Backend, two_runs: tuple[dict[str, int], int]
) -> None:
    """As data where it was stored so; of an older release out of its sentences."""
    ids, first = two_runs
    second = int(loop_health(backend, "B")["audit_id"])
    rewrite_newest(backend, ids["B"], verdict="stiction")
    reasons = {"reasons": "shape_op_triangle;shape_flat_eighth;few_cycles"}
    now = "OP runs in triangles. 60 % of the travel of OP finds PV standing still. few"
    older = {"extra_json": "{}"}
    called = {"verdict": "stiction", "stiction_probability": 0.99, "reasons_text": now}
    rewrite(backend, second, ids["B"], **called, **reasons, **older)
    rewrite_newest(backend, ids["B"], verdict="stiction")
    then = "PV hardly ever stands still while OP travels (8 %)"
    before = {"verdict": "no_stiction", "stiction_probability": 0.1, "samples": 100}
    rewrite(backend, first, ids["B"], **before, reasons="shape_flat_eighth", reasons_text=then, **older)
    (change,) = plant.changes(backend).rows
    seen = "60 % of the travel of OP finds PV standing still (8 % before), probability 0.10 -> 0.99"
    assert change.because == f"{seen}; more was recorded than before"
    measured = '{"measured":{"shape_op_triangle":[0.4,"<",0.6],"shape_flat_eighth":[0.55,">",0.2]}}'
    rewrite(backend, second, ids["B"], extra_json=measured)
    seen = "55 % of the travel of OP finds PV standing still (8 % before), probability 0.10 -> 0.99"
    assert plant.changes(backend).rows[0].because == f"{seen}; more was recorded than before"
    rewrite(backend, first, ids["B"], stiction_probability=0.0004)
    rewrite(backend, second, ids["B"], stiction_probability=0.9996)
    assert "probability under 0.01 -> over 0.99; " in plant.changes(backend).rows[0].because
    rewrite(backend, second, ids["B"], stiction_probability=0.99)
    rewrite(backend, first, ids["B"], stiction_probability=0.95)
    assert plant.changes(backend).rows[0].because == "more was recorded than before"
    rewrite(backend, first, ids["B"], stiction_probability=0.1, reasons="few_cycles", reasons_text="few")
    assert plant.changes(backend).rows[0].because.startswith("OP runs in triangles, probability 0.10 -> 0.99; ")


def test_a_pv_that_does_not_answer_is_looked_at_today_and_news_of_it_first(
    backend: Backend, two_runs: tuple[dict[str, int], int]
) -> None:
    ids, first = two_runs
    second = int(loop_health(backend, "B")["audit_id"])
    dead = {"verdict": "not_auditable", "likely_cause": "stuck_valve_or_dead_transmitter"}
    for tag in ("B", "C"):
        rewrite(backend, second, ids[tag], **dead)
        rewrite_newest(backend, ids[tag], **dead)
    rewrite(backend, first, ids["B"], **dead)
    (change,) = [change for change in plant.changes(backend).rows if change.loop == "C"]
    assert change.because == "cannot be audited now: PV does not answer OP: stuck valve or dead transmitter"
    rewrite(backend, second, ids["C"], verdict="inconclusive")
    rewrite_newest(backend, ids["C"], verdict="inconclusive")
    rewrite(backend, first, ids["C"], **dead)
    (change,) = [change for change in plant.changes(backend).rows if change.loop == "C"]
    assert change.because == "still: PV does not answer OP: stuck valve or dead transmitter"
    rewrite(backend, first, ids["C"], verdict="no_stiction", likely_cause=None, samples=100)
    (change,) = [change for change in plant.changes(backend).rows if change.loop == "C"]
    assert change.because == "PV does not answer OP: stuck valve or dead transmitter"
    today = plant.look_today(backend, plant.changes(backend))
    assert [row["loop"] for row in today] == ["C", "B"]
    assert all(headline(row) == "a stuck valve or a dead transmitter; look today" for row in today)
    assert {row["loop"] for row in plant.worst(backend, beside={"B", "C"})} == {"A", "D"}


def rewrite_newest(backend: Backend, loop: int, **values: object) -> None:
    with backend.database.write() as connection:
        connection.execute(update(newest_rows).where(newest_rows.c.loop_id == loop).values(**values))


def test_a_valve_that_began_to_stick_is_why_though_more_was_recorded(
    backend: Backend, two_runs: tuple[dict[str, int], int]
) -> None:
    ids, first = two_runs
    second = loop_health(backend, "B")["audit_id"]
    rewrite(backend, first, ids["B"], verdict="not said", samples=100)
    rewrite(backend, int(second), ids["B"], reasons="stiction_began;stretches")
    (change,) = plant.changes(backend).rows
    assert (change.why, change.because) == ("loop", "began to stick within the record")


def test_what_a_night_changed_is_news_though_somebody_audits_again(backend: Backend, add_loops: AddLoops) -> None:
    ids = add_loops("A", "B", n=600)
    first = audited(backend)
    run = nightly(backend)
    assert run is not None
    audit_chunk(backend, int(run.id), "test")
    now = loop_health(backend, "B")["verdict"]
    other = "no_stiction" if now == "stiction" else "stiction"
    rewrite(backend, first, ids["B"], verdict=other)
    again = start_audit(backend, trigger="nightly")  # `loopaudit nightly` once the night's run has ended
    audit_chunk(backend, int(again.id), "test")
    told = plant.changes(backend)
    assert told.run_id == run.id
    assert [(change.loop, change.before, change.now) for change in told.rows] == [("B", other, now)]


def test_what_came_since_the_first_run_is_news(backend: Backend, add_loops: AddLoops) -> None:
    ids = add_loops("A", "B", n=600)
    first = int(nightly(backend).id)
    audit_chunk(backend, first, "test")
    assert not plant.changes(backend).compared
    assert newest_run(backend) == str(first)
    now = loop_health(backend, "B")["verdict"]
    other = "no_stiction" if now == "stiction" else "stiction"
    rewrite(backend, first, ids["B"], verdict=other)
    rewrite_newest(backend, ids["B"], verdict=other)
    again = start_audit(backend, trigger="nightly")  # the second of this date
    audit_chunk(backend, int(again.id), "test")
    told = plant.changes(backend)
    assert (told.run_id, told.first, told.compared) == (str(first), True, True)
    assert [(change.loop, change.before, change.now) for change in told.rows] == [("B", other, now)]
    assert newest_run(backend) == again.id
    assert f"run {again.id}, " in as_text(digest_of(backend, again.id)).splitlines()[0]


def test_what_is_started_days_after_the_last_night_takes_its_place(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("A", "B", "C")
    run = nightly(backend)
    assert run is not None
    audit_chunk(backend, int(run.id), "test")
    asked_for = audited(backend)
    of_one = start_audit(backend, LoopFilter(tags=("A",)))
    audit_chunk(backend, int(of_one.id), "test")
    assert plant.changes(backend).run_id == run.id
    with backend.database.write() as connection:
        days_ago = datetime.now(UTC) - timedelta(days=3)
        connection.execute(update(audits).where(audits.c.id == int(run.id)).values(created_at=days_ago))
    assert plant.changes(backend).run_id == str(asked_for)


@pytest.mark.parametrize(
    ("now", "before", "why", "because"),
    [
        (
            {"verdict": "not_auditable", "likely_cause": "op_at_limits"},
            {},
            "auditable",
            "cannot be audited now: OP at its limit",
        ),
        ({}, {"verdict": "not_auditable", "likely_cause": None}, "auditable",
         "could not be audited before: too little usable data"),
        ({"reasons": "since_repair;shape_x"}, {"verdict": "stiction", "samples": 9000}, "repair",
         "a repair was stated"),
        ({"reasons": "since_repair"}, {"verdict": "stiction", "reasons": "since_repair"}, "loop",
         "probability {before} -> {now}"),
    ],
)  # fmt: skip
def test_a_change_of_what_can_be_audited_names_the_cause(
    backend: Backend,
    two_runs: tuple[dict[str, int], int],
    now: dict[str, object],
    before: dict[str, object],
    why: str,
    because: str,
) -> None:
    ids, first = two_runs
    newest = {"verdict": "no_stiction", **now}
    rewrite(backend, first + 1, ids["B"], **newest)
    rewrite(backend, first, ids["B"], **{"verdict": "no_stiction", **before})
    with backend.database.write() as connection:
        row = newest_rows.c.loop_id == ids["B"]
        connection.execute(update(newest_rows).where(row).values(verdict=newest["verdict"]))
    changes = {change.loop: change for change in plant.changes(backend).rows}
    measured = probability(loop_health(backend, "B")["stiction_probability"])
    told = because.format(before=measured, now=measured)
    assert (changes["B"].why, changes["B"].because) == (why, told)


def test_the_overview_adds_up(backend: Backend, two_runs: tuple[dict[str, int], int]) -> None:
    seen = plant.overview(backend)
    assert (seen.loops, seen.audited, sum(seen.verdicts.values())) == (4, 4, 4)
    assert [unit.unit for unit in seen.units] == ["U1"]
    healths = [loop_health(backend, tag)["health"] for tag in "ABCD"]
    assert seen.health == pytest.approx(sum(healths) / 4)


def test_a_loop_without_a_health_moves_no_mean_and_is_sorted_last(
    backend: Backend, two_runs: tuple[dict[str, int], int]
) -> None:
    ids, first = two_runs
    for loop in ids.values():
        rewrite(backend, first + 1, loop, health=80.0)
        rewrite_newest(backend, loop, health=80.0)
    rewrite(backend, first + 1, ids["A"], health=None)
    rewrite_newest(backend, ids["A"], health=None)
    seen = plant.overview(backend)
    assert (seen.health, seen.units[0].health, seen.units[0].importance) == (80.0, 80.0, 4.0)
    for sort in ("health", "-health", "-priority"):
        page = plant.table(backend, 3, sort=sort)
        last = plant.table(backend, 3, page.next_cursor, sort=sort)
        assert [row["loop"] for row in [*page.rows, *last.rows]] == ["B", "C", "D", "A"]
    assert ["A", "U1", 1.0, loop_health(backend, "A")["verdict"], None] in plant.tiles(backend)["loops"]
    for tag in "BCD":
        rewrite_newest(backend, ids[tag], health=None)
    assert (plant.overview(backend).health, plant.overview(backend).units[0].health) == (None, None)


def test_the_worst_come_first_by_importance(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("A", "B", importance=1.0)
    add_loops("C", importance=9.0)
    audited(backend)
    rows = plant.worst(backend)
    assert [row["priority"] for row in rows] == sorted((row["priority"] for row in rows), reverse=True)
    assert rows[0]["loop"] == "C"
    assert rows[0]["priority"] == pytest.approx(9.0 * (100.0 - rows[0]["health"]))


def test_the_treemap_has_the_worst_of_each_unit_and_more_of_one(
    backend: Backend, add_loops: AddLoops, monkeypatch: pytest.MonkeyPatch
) -> None:
    add_loops("A", "B", "C", unit="U1", importance=1.0)
    add_loops("D", importance=2.0)
    audited(backend)
    monkeypatch.setattr(plant, "MOST_TILES", 2)
    monkeypatch.setattr(plant, "LEAST_TILES", 1)
    told = plant.tiles(backend)
    assert sorted((str(name), count, importance) for name, count, importance, _ in told["units"]) == [
        ("None", 1, 2.0),
        ("U1", 3, 3.0),
    ]
    assert sorted(str(unit) for _, unit, *_ in told["loops"]) == ["None", "U1"]
    healths = [health for *_, health in plant.unit_tiles(backend, "U1")["loops"]]
    assert len(healths) == 2
    assert healths == sorted(healths)
    assert [tag for tag, *_ in plant.unit_tiles(backend, None)["loops"]] == ["D"]


def test_rows_say_what_their_health_is_made_of(backend: Backend, two_runs: tuple[dict[str, int], int]) -> None:
    row = loop_health(backend, "A")
    parts = dict(part.split(" ") for part in row["health_parts"].split(";"))
    assert row["health"] == pytest.approx(100.0 - sum(map(float, parts.values())))


def test_loops_with_one_swing_are_a_group(backend: Backend, two_runs: tuple[dict[str, int], int]) -> None:
    group = plant_groups(backend)[0]
    assert {member.loop for member in group.members} == set("ABCD")
    assert group.in_step
    assert plant_groups(backend) is plant_groups(backend)  # found once
    assert groups_of(backend, "A") == [group]


def test_groups_know_the_units_that_loops_have_now(backend: Backend, two_runs: tuple[dict[str, int], int]) -> None:
    assert {member.unit for member in plant_groups(backend)[0].members} == {"U1"}
    patch_loop(backend, "A", {"unit": "U2"})
    assert {member.loop: member.unit for member in plant_groups(backend)[0].members}["A"] == "U2"


def test_pages_that_cannot_wait_share_one_search_for_groups(
    backend: Backend, two_runs: tuple[dict[str, int], int], monkeypatch: pytest.MonkeyPatch
) -> None:
    going, asked = threading.Event(), []

    def slow(candidates: object) -> tuple[()]:
        asked.append(candidates)
        going.wait(60)
        return ()

    monkeypatch.setattr(groups, "groups", slow)
    assert [groups.soon(backend, 0.01) for _ in range(3)] == [None] * 3
    patch_loop(backend, "A", {"unit": "U2"})
    assert groups.soon(backend, 0.01) is None  # another state, while the last one is worked out
    assert sum(thread.name == "groups" for thread in threading.enumerate()) == 1
    going.set()
    assert groups.plant_groups(backend) == ()
    assert len(asked) == 2


def test_a_search_for_groups_that_failed_is_made_again(
    backend: Backend, two_runs: tuple[dict[str, int], int], monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(candidates: object) -> tuple[()]:
        raise MemoryError

    with monkeypatch.context() as spoiled:
        spoiled.setattr(groups, "groups", broken)
        with pytest.raises(MemoryError):
            plant_groups(backend)
    assert len(plant_groups(backend)) == 1


def test_a_repair_parts_the_verdicts(backend: Backend, two_runs: tuple[dict[str, int], int]) -> None:
    ids, first = two_runs
    early, late = datetime(2026, 1, 1, tzinfo=UTC), datetime(2026, 1, 3, tzinfo=UTC)
    rewrite(backend, first, ids["A"], window_start=early, window_end=early, verdict="stiction")
    rewrite(backend, first + 1, ids["A"], window_start=late, window_end=late, verdict="no_stiction")
    assert notes.newest_repair(backend, "A") is None
    notes.add_note(backend, "A", "packing renewed", "WO-1", datetime(2026, 1, 2, tzinfo=UTC), "somebody")
    repair = notes.newest_repair(backend, "A")
    assert repair is not None
    assert repair.before is not None
    assert repair.after is not None
    assert (repair.before["verdict"], repair.after["verdict"]) == ("stiction", "no_stiction")
    told = {label: (before, after) for label, before, after in compared(backend, "A", repair, "bar")}
    assert told["Verdict"] == ("valve sticks", "no stiction")
    assert told["Size of stiction S, units of OP (95 % interval)"][1] == "none to state"
    assert "Control error SP - PV, standard deviation, bar" in told
    assert all(float(value) > 0.0 for value in told["Travel of OP an hour, units of OP"])
    assert not any("band" in label for label in told)
    assert compared(backend, "A", notes.Repair(repair.repaired_at, None, repair.after), None)[0][1] == "–"
    assert compared(backend, "A", notes.Repair(repair.repaired_at, repair.before, None), None) == []
    (note,) = notes.list_notes(backend, "A")
    assert (note.text, note.work_order, note.written_by) == ("packing renewed", "WO-1", "somebody")
    assert abs(datetime.fromisoformat(note.written_at) - datetime.now(UTC)) < timedelta(minutes=1)
    assert len(verdict_history(backend, "A").rows) == 2


def test_a_window_that_begins_within_the_second_of_a_repair_is_after_it(
    backend: Backend, two_runs: tuple[dict[str, int], int]
) -> None:
    ids, first = two_runs
    noon = datetime(2026, 1, 2, 12, tzinfo=UTC)
    early, late = noon - timedelta(milliseconds=250), noon + timedelta(milliseconds=250)
    rewrite(backend, first, ids["A"], window_start=early, window_end=early, verdict="stiction")
    rewrite(backend, first + 1, ids["A"], window_start=late, window_end=late, verdict="no_stiction")
    notes.add_note(backend, "A", "packing renewed", repaired_at=noon)
    repair = notes.newest_repair(backend, "A")
    assert repair is not None
    assert (repair.before or {}).get("verdict") == "stiction"
    assert (repair.after or {}).get("verdict") == "no_stiction"


def test_a_repair_is_not_still_to_come(backend: Backend, two_runs: tuple[dict[str, int], int]) -> None:
    now = datetime.now(UTC)
    with pytest.raises(RequestError) as refused:
        notes.add_note(backend, "B", "packing renewed", repaired_at=now + timedelta(hours=1))
    assert refused.value.code == "bad_repair_time"
    assert notes.list_notes(backend, "B") == []
    notes.add_note(backend, "B", "by a clock that is fast", repaired_at=now + timedelta(minutes=1))


def test_a_wrong_time_of_a_repair_is_mended_by_a_further_note(
    backend: Backend, two_runs: tuple[dict[str, int], int]
) -> None:
    for day in (20, 2):
        notes.add_note(backend, "C", "packing renewed", repaired_at=datetime(2026, 1, day, tzinfo=UTC))
    notes.add_note(backend, "C", "runs well")
    repair = notes.newest_repair(backend, "C")
    assert repair is not None
    assert repair.repaired_at == "2026-01-02T00:00:00Z"


def test_a_withdrawn_repair_counts_no_longer_and_its_note_stays(
    backend: Backend, two_runs: tuple[dict[str, int], int]
) -> None:
    real = notes.add_note(backend, "D", "packing", repaired_at=datetime(2026, 1, 2, tzinfo=UTC))
    wrong = notes.add_note(backend, "D", "another loop was meant", repaired_at=datetime(2026, 1, 9, tzinfo=UTC))
    done = notes.withdraw_repair(backend, "D", wrong.id, "me")
    assert done.withdrawn_at is not None
    assert notes.withdraw_repair(backend, "D", wrong.id, "somebody else") == done
    repair = notes.newest_repair(backend, "D")
    assert repair is not None
    assert repair.repaired_at == "2026-01-02T00:00:00Z"
    notes.withdraw_repair(backend, "D", real.id, "me")
    assert notes.newest_repair(backend, "D") is None
    assert [(n.text, n.withdrawn_by) for n in notes.list_notes(backend, "D")] == [
        ("another loop was meant", "me"),
        ("packing", "me"),
    ]


def test_the_table_has_the_order_and_the_repair_that_stand(
    backend: Backend, two_runs: tuple[dict[str, int], int]
) -> None:
    notes.add_note(backend, "A", "packing", "WO-1", datetime(2026, 1, 2, tzinfo=UTC))
    wrong = notes.add_note(backend, "A", "not this loop", repaired_at=datetime(2026, 1, 9, tzinfo=UTC))
    notes.withdraw_repair(backend, "A", wrong.id)
    notes.add_note(backend, "A", "runs well")
    notes.add_note(backend, "B", "to be looked at", "WO-3")
    told = {row["loop"]: (row["work_order"], row["repaired_at"]) for row in plant.table(backend, 10).rows}
    assert (told["A"], told["B"]) == (("WO-1", "2026-01-02T00:00:00Z"), ("WO-3", None))


def test_only_a_repair_of_that_loop_can_be_withdrawn(backend: Backend, two_runs: tuple[dict[str, int], int]) -> None:
    repair = notes.add_note(backend, "A", repaired_at=datetime(2026, 1, 2, tzinfo=UTC), text="")
    plain = notes.add_note(backend, "A", "runs well")
    for tag, note_id in (("B", repair.id), ("A", plain.id), ("A", "nonsense"), ("A", "77777"), ("NOWHERE", repair.id)):
        with pytest.raises(NotFoundError):
            notes.withdraw_repair(backend, tag, note_id)
    assert notes.newest_repair(backend, "A") is not None


def test_notes_come_page_by_page(backend: Backend, two_runs: tuple[dict[str, int], int]) -> None:
    for number in range(5):
        notes.add_note(backend, "A", f"note {number}")
    first = notes.note_page(backend, "A", 3)
    rest = notes.note_page(backend, "A", 3, first.next_cursor)
    assert [note.text for note in (*first.rows, *rest.rows)] == [f"note {number}" for number in (4, 3, 2, 1, 0)]
    assert rest.next_cursor is None


def test_every_key_figure_is_defined() -> None:
    defined = {figure.field for figure in glossary.FIGURES}
    assert set(KeyFigures.__dataclass_fields__) <= defined
    assert all(figure.definition for figure in glossary.FIGURES)
