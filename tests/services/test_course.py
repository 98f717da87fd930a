"""The plant night by night."""

from datetime import UTC, datetime, timedelta

from sqlalchemy import update

from app.services.backend import Backend
from app.services.outward import NightOfUnitOut, NightOut
from app.services.plant.course import course, unit_columns
from app.services.plant.nights import nights
from app.services.reports.documents import plant_report
from app.services.stating import properties
from app.storage.tables import audits, verdicts
from tests.services.audited_plant import AddLoops, audited, rewrite


def test_each_date_has_what_its_last_run_of_the_plant_said(backend: Backend, add_loops: AddLoops) -> None:
    assert course(backend) == []
    ids = add_loops("A", "B", n=600, unit="U1") | add_loops("C", n=600)
    first = audited(backend)
    second, third = audited(backend), audited(backend)
    with backend.database.write() as connection:
        mine = update(audits).where(audits.c.id.in_((first, second)))
        connection.execute(mine.values(created_at=datetime.now(UTC) - timedelta(days=2)))
    said = [(second, "A", "stiction", 50.0, None), (second, "B", "not_auditable", None, "not_in_automatic")]
    said += [(second, "C", "no_stiction", 90.0, None), *((third, tag, "no_stiction", 80.0, None) for tag in "ABC")]
    for run, tag, verdict, health, cause in said:
        fields = {"verdict": verdict, "reliability": "reliable", "health": health, "likely_cause": cause}
        rewrite(backend, run, ids[tag], **fields)
    before, now = course(backend)
    assert (before.run, now.run) == (str(second), str(third))
    assert (before.audited, before.sticking, before.health, before.in_manual) == (3, 1, 70.0, 1)
    assert {of.unit: of.sticking for of in before.units} == {"U1": 1, None: 0}
    assert (now.sticking, now.health, now.in_manual) == (0, 80.0, 0)
    report = plant_report(backend)
    assert f'<td class="tag">{before.date}</td>' in report
    assert '<th class="number">Not judged: not in automatic</th>' in report


def test_a_night_that_was_caught_up_after_midnight_has_its_own_date(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("A", n=600)
    by_day, caught_up = audited(backend), audited(backend)
    morning = datetime(2026, 11, 25, 8, tzinfo=UTC)
    with backend.database.write() as connection:
        for run, at, night in ((by_day, morning, None), (caught_up, morning + timedelta(hours=12), "2026-11-24")):
            of_run = {"created_at": at, "nightly_for": night}
            connection.execute(update(audits).where(audits.c.id == run).values(**of_run))
            connection.execute(update(verdicts).where(verdicts.c.audit_id == run).values(audited_at=at))
    assert [(night.date, night.run) for night in course(backend)] == [
        ("2026-11-24", str(caught_up)),
        ("2026-11-25", str(by_day)),
    ]
    marks = nights(backend, ["A"])["A"]
    assert [night.date for night in marks[-2:]] == ["2026-11-25", "2026-11-24"]  # the verdict now is the last


def test_a_loop_counts_in_the_nights_under_its_tag_before(backend: Backend, add_loops: AddLoops) -> None:
    """Else the valves that stick came to be more with the night in which tags were renamed."""
    ids = add_loops("FIC1", "FIC2", "FIC3", n=600, unit="U1")
    first = audited(backend)
    ids |= add_loops("FIC1A", n=600)
    second, third = audited(backend), audited(backend)
    with backend.database.write() as connection:
        for run, days in ((first, 2), (second, 1)):
            at = datetime.now(UTC) - timedelta(days=days)
            connection.execute(update(audits).where(audits.c.id == run).values(created_at=at))
    for run, tags in ((first, ("FIC1", "FIC2", "FIC3")), (second, ids), (third, ids)):
        for tag in tags:
            rewrite(backend, run, ids[tag], verdict="stiction", reliability="reliable", health=50.0)
    properties.patch_loop(backend, "FIC1A", {"continues": "FIC1"})
    properties.patch_loop(backend, "FIC3", {"retired": True})
    assert [(night.audited, night.sticking) for night in course(backend)] == [(2, 2)] * 3, "no loop counts twice"
    assert [of.sticking for night in course(backend) for of in night.units] == [2] * 3
    properties.patch_loop(backend, "FIC1A", {"retired": True})
    assert [(night.audited, night.sticking) for night in course(backend)] == [(1, 1)] * 3


def test_the_columns_of_the_units_add_up_to_the_plant() -> None:
    stuck = {"D": 1, "A": 2, "C": 3, "B": 5, None: 4}
    both = [
        NightOut("2026-03-01", "1", 90, 0, None, 0, (NightOfUnitOut("A", 0),), 0),
        NightOut("2026-03-02", "2", 90, 15, None, 0, tuple(NightOfUnitOut(*of) for of in stuck.items()), 0),
    ]

    def told(most: int) -> list[tuple[str, int, int]]:
        columns = unit_columns(both, most)
        return [(column.label, *(column.sticking(night) for night in both)) for column in columns]

    assert told(4) == [("A", 0, 2), ("B", 0, 5), ("C", 0, 3), ("D", 0, 1), ("no unit", 0, 4)]
    assert told(3) == [("B", 0, 5), ("C", 0, 3), ("2 other units", 0, 3), ("no unit", 0, 4)]
    assert unit_columns([], 3) == []
