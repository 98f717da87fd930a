"""The plant in numbers: what is worst, what its health is made of, what failed."""

import pytest

from app.engine.key_figures import KeyFigures
from app.services.auditing.audits import start_audit
from app.services.backend import Backend
from app.services.plant import glossary, reliability, worst
from app.services.plant import overview as plant
from app.services.plant.course import course
from app.services.plant.listing import listing
from app.services.plant.loop_verdicts import loop_health, newest_failure
from app.services.stating import properties
from app.storage import items, loops
from app.storage.asked_rows import RowFilter
from app.storage.items import Failure
from tests.services.audited_plant import AddLoops, audited, rewrite, rewrite_newest


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


def test_the_overview_adds_up(backend: Backend, two_runs: tuple[dict[str, int], int]) -> None:
    seen = plant.overview(backend)
    assert (seen.loops, seen.audited, sum(seen.verdicts.values())) == (4, 4, 4)
    assert [unit.unit for unit in seen.units] == ["U1"]
    healths = [loop_health(backend, tag)["health"] for tag in "ABCD"]
    assert seen.health == pytest.approx(sum(healths) / 4)


def test_means_and_sums_go_out_without_what_adding_leaves_behind(
    backend: Backend, two_runs: tuple[dict[str, int], int]
) -> None:
    """61.79999999999999 and 0.6000000000000001 are nobody's figures."""
    ids, first = two_runs
    for tag, importance, health in (("A", 0.1, 61.8), ("B", 0.2, 61.8), ("C", 0.3, 61.8), ("D", 0.1, 61.8)):
        properties.patch_loop(backend, tag, {"importance": importance})
        rewrite(backend, first + 1, ids[tag], health=health)
        rewrite_newest(backend, ids[tag], health=health)
    [unit] = plant.overview(backend).units
    assert (unit.health, unit.importance) == (61.8, 0.7)
    [tile] = plant.tiles(backend)["units"]
    assert tile[2:4] == [0.7, 61.8]
    assert [4, 61.8] in tile[4]
    assert course(backend)[-1].health == 61.8
    rewrite(backend, first + 1, ids["D"], health=61.9)
    rewrite_newest(backend, ids["D"], health=61.9)
    assert plant.overview(backend).health == course(backend)[-1].health == 61.814


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
        page = reliability.table(backend, 3, sort=sort)
        last = reliability.table(backend, 3, page.next_cursor, sort=sort)
        assert [row["loop"] for row in [*page.rows, *last.rows]] == ["B", "C", "D", "A"]
        place = reliability.page_place(backend, 3, page.next_cursor, sort, RowFilter())
        assert place == reliability.PagePlace(3, 4, None)
        third = reliability.table(backend, 1, reliability.table(backend, 2, sort=sort).next_cursor, sort)
        behind_three = reliability.page_place(backend, 1, third.next_cursor, sort, RowFilter())
        assert reliability.table(backend, 1, behind_three.previous_cursor, sort).rows == third.rows
    assert ["A", "U1", 1.0, loop_health(backend, "A")["verdict"], None] in plant.tiles(backend)["loops"]
    for tag in "BCD":
        rewrite_newest(backend, ids[tag], health=None)
    assert (plant.overview(backend).health, plant.overview(backend).units[0].health) == (None, None)


def test_the_worst_come_first_by_importance(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("A", "B", importance=1.0)
    add_loops("C", importance=9.0)
    audited(backend)
    rows = worst.worst(backend, listing(backend))
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
    assert sorted((str(name), count, importance) for name, count, importance, *_ in told["units"]) == [
        ("None", 1, 2.0),
        ("U1", 3, 3.0),
    ]
    assert sorted(str(unit) for _, unit, *_ in told["loops"]) == ["None", "U1"]
    healths = [health for *_, health in plant.unit_tiles(backend, "U1")["loops"]]
    assert len(healths) == 2
    assert healths == sorted(healths)
    assert [tag for tag, *_ in plant.unit_tiles(backend, None)["loops"]] == ["D"]


def test_the_treemap_has_the_loops_of_each_unit_by_health(backend: Backend, add_loops: AddLoops) -> None:
    ids = add_loops("A", "B", "C", "D", "E", unit="U1") | add_loops("F")
    audited(backend)
    for loop, health in zip(ids.values(), (None, 59.9, 60.0, 79.9, 80.0, 20.0), strict=True):
        rewrite_newest(backend, loop, health=health)
    told = {unit: classes for unit, *_, classes in plant.tiles(backend)["units"]}
    assert told == {
        None: [[1, 20.0], [0, None], [0, None], [0, None]],
        "U1": [[1, 59.9], [2, pytest.approx(69.95)], [1, 80.0], [1, None]],
    }


def test_rows_say_what_their_health_is_made_of(backend: Backend, two_runs: tuple[dict[str, int], int]) -> None:
    row = loop_health(backend, "A")
    parts = dict(part.split(" ") for part in row["health_parts"].split(";"))
    assert row["health"] == pytest.approx(100.0 - sum(map(float, parts.values())))


def test_every_key_figure_is_defined() -> None:
    defined = {figure.field for figure in glossary.FIGURES}
    assert set(KeyFigures.__dataclass_fields__) <= defined
    assert all(figure.definition for figure in glossary.FIGURES)
    assert len({figure.label for figure in glossary.FIGURES}) == len(glossary.FIGURES)


def test_valves_that_stick_reliably_come_first_and_loops_that_were_not_judged_are_not_among_the_worst(
    backend: Backend, add_loops: AddLoops
) -> None:
    ids = add_loops("A", "B", "C", "D", "E", n=600)
    run = audited(backend)
    said = {
        "A": {"verdict": "not_auditable", "likely_cause": "manual", "reliability": "not_reliable", "health": 20.0},
        "B": {"verdict": "stiction", "reliability": "reliable", "health": 70.0},
        "C": {"verdict": "inconclusive", "reliability": "not_reliable", "health": 30.0},
        "D": {"verdict": "stiction", "reliability": "not_reliable", "health": 40.0},
        "E": {"verdict": "stiction", "reliability": "reliable", "health": 60.0},
    }
    for tag, fields in said.items():
        rewrite(backend, run, ids[tag], **{"likely_cause": None, **fields})
        rewrite_newest(backend, ids[tag], **{"likely_cause": None, **fields})
    assert [row["loop"] for row in worst.worst(backend, listing(backend))] == ["E", "B", "C", "D"]
    assert [row["loop"] for row in worst.worst(backend, listing(backend), 2, beside={"E"})] == ["B", "C"]
    assert worst.worst_tags(backend, listing(backend)) == ["E", "B", "C", "D"]


def test_each_cause_that_loops_are_counted_under_finds_these_loops(
    backend: Backend, two_runs: tuple[dict[str, int], int]
) -> None:
    ids, first = two_runs
    causes = {"A": None, "B": None, "C": "not_in_automatic"}
    for tag, cause in causes.items():
        refused = {"verdict": "not_auditable", "reliability": "not_reliable", "likely_cause": cause}
        rewrite(backend, first + 1, ids[tag], **refused)
        rewrite_newest(backend, ids[tag], **refused)
    rewrite_newest(backend, ids["D"], verdict="inconclusive", likely_cause=None)
    counted = plant.overview(backend).refused
    assert counted == {"data": 2, "not_in_automatic": 1}
    for run in (None, first + 1):
        for cause, loops_of in counted.items():
            asked = reliability.RowFilter(likely_cause=cause, audit_id=run)
            assert reliability.count(backend, asked) == loops_of
            rows = reliability.table(backend, 10, filters=asked).rows
            assert [row["loop"] for row in rows] == [tag for tag in "ABC" if (causes[tag] or "data") == cause]
