"""What to do about a loop whose newest explanation contradicts its verdict: one answer on every page and list."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from sqlalchemy import Engine, event, update

from app.services.auditing.audits import start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.backend import Backend
from app.services.explaining import explanations as explanations_of
from app.services.loops import find
from app.services.moments import ns_of
from app.services.plant import loop_sheet, reliability
from app.services.reports import documents
from app.services.stating import notes
from app.services.telling.next_steps import Ask
from app.storage import explanations
from app.storage.documents import Document, pack_document
from app.storage.tables import explanations as explanations_table
from app.storage.tables import verdicts
from tests.services.upkeep_plant import with_settings

AddLoops = Callable[..., dict[str, int]]
CLEARED = {"verdict": "no_stiction", "reliability": "reliable", "likely_cause": "no_oscillation", "reasons": ""}


def explain(
    backend: Backend,
    loop_id: int,
    *effects: tuple[str, float],
    state: str = "done",
    until: datetime | None = None,
) -> int:
    """As a worker leaves it."""
    told = [{"effect": code, "alternatives": [], "probability": probability} for code, probability in effects]
    packed = pack_document(Document({"line": {"effects": told}}))
    with backend.database.write() as connection:
        explanation_id = explanations.ask(connection, {"loop_id": loop_id})
        values: dict[str, Any] = {"state": state, "packed": packed, "effects": ";".join(code for code, _ in effects)}
        values["window_end_ns"] = None if until is None else ns_of(until)
        one = explanations_table.c.id == explanation_id
        connection.execute(update(explanations_table).where(one).values(**values))
    return explanation_id


@pytest.fixture
def ids(backend: Backend, add_loops: AddLoops) -> dict[str, int]:
    found = add_loops("A", "B", "C", "D")
    audit_chunk(backend, int(start_audit(backend).id), "test")
    with backend.database.write() as connection:
        connection.execute(update(verdicts).values(**CLEARED))
    return found


def contradicted(backend: Backend) -> list[str]:
    rows = reliability.table(backend, 10, sort="loop").rows
    return [row["loop"] for row in rows if row["next_step"] == Ask.UNTIL_THEY_AGREE]


def test_the_version_of_the_table_changes_with_how_old_an_explanation_may_be(
    backend: Backend, ids: dict[str, int]
) -> None:
    """Whether one still disputes a verdict depends on LOOPAUDIT_HOLD_DAYS: with another one the answer differs."""
    of_a_second = with_settings(backend, hold_days=1 / 86_400)
    assert reliability.in_parts(backend).version == reliability.in_parts(of_a_second).version
    explain(backend, ids["A"], ("valve.stiction", 0.7), until=datetime(2001, 1, 1, tzinfo=UTC))
    known, other = reliability.in_parts(backend), reliability.in_parts(of_a_second)
    assert known.version != other.version


def test_the_table_knows_what_the_page_knows(backend: Backend, ids: dict[str, int]) -> None:
    explain(backend, ids["A"], ("sensor.step", 0.3), ("valve.stiction", 0.7))
    explain(backend, ids["B"], ("sensor.step", 0.9), ("valve.stiction", 0.7))
    explain(backend, ids["C"], ("valve.stiction", 0.4))
    assert contradicted(backend) == ["A"]
    with backend.database.write() as connection:
        connection.execute(update(verdicts).where(verdicts.c.loop_id == ids["A"]).values(verdict="stiction"))
    assert contradicted(backend) == []


@pytest.mark.parametrize(("effects", "state"), [((), "done"), ((("valve.stiction", 0.9),), "open")])
def test_only_the_newest_explanation_counts(
    backend: Backend, ids: dict[str, int], effects: tuple[tuple[str, float], ...], state: str
) -> None:
    explain(backend, ids["A"], ("valve.stiction", 0.7))
    explain(backend, ids["A"], *effects, state=state)
    assert contradicted(backend) == []


@pytest.mark.parametrize(("recorded", "counts"), [("before", False), ("after", True)])
def test_an_explanation_of_before_the_repair_contradicts_nothing_said_since(
    backend: Backend, ids: dict[str, int], recorded: str, counts: bool
) -> None:
    repaired_at = datetime(2025, 6, 1, tzinfo=UTC)
    notes.add_note(backend, "A", "packing renewed", repaired_at=repaired_at)
    until = repaired_at + (timedelta(hours=1) if recorded == "after" else -timedelta(hours=1))
    explain(backend, ids["A"], ("valve.stiction", 0.7), until=until)
    assert contradicted(backend) == (["A"] if counts else [])
    explained = explanations_of.newest(backend, "A")
    assert bool(loop_sheet.loop_sheet(backend, find(backend, "A"), explained)["disagrees"]) is counts


@pytest.mark.parametrize(("days_before", "counts"), [(34, True), (36, False)])
def test_an_explanation_of_long_before_the_verdict_is_told_and_disputes_nothing(
    backend: Backend, ids: dict[str, int], monkeypatch: pytest.MonkeyPatch, days_before: float, counts: bool
) -> None:
    monkeypatch.setattr(documents, "in_words", lambda *told: None)  # the whole of an answer, which there is not
    row = reliability.table(backend, 1, sort="loop").rows[0]
    until = datetime.fromisoformat(row["window_start"]) - timedelta(days=days_before)
    explain(backend, ids["A"], ("valve.stiction", 0.7), until=until)
    assert contradicted(backend) == (["A"] if counts else [])
    sheet = loop_sheet.loop_sheet(backend, find(backend, "A"), explanations_of.newest(backend, "A"))
    assert bool(sheet["disagrees"]) is counts
    assert bool(sheet["older_said"]) is not counts
    report = documents.loop_report(backend, "A")
    assert ("Two answers on this page disagree" in report) is counts
    assert ("An older explanation said that the valve sticks (probability 0.70)" in report) is not counts


def test_how_old_an_explanation_without_a_date_is_is_not_known(backend: Backend, ids: dict[str, int]) -> None:
    explain(backend, ids["A"], ("valve.stiction", 0.7), until=datetime(1970, 1, 2, tzinfo=UTC))
    assert contradicted(backend) == ["A"]


def test_a_damaged_explanation_takes_no_list_with_it(backend: Backend, ids: dict[str, int]) -> None:
    explain(backend, ids["A"], ("valve.stiction", 0.7))
    damaged = explain(backend, ids["B"], ("valve.stiction", 0.7))
    with backend.database.write() as connection:
        one = explanations_table.c.id == damaged
        connection.execute(update(explanations_table).where(one).values(packed=b"\x01damaged"))
    assert contradicted(backend) == ["A"]


def test_as_many_loops_as_there_are_take_one_query(backend: Backend, ids: dict[str, int]) -> None:
    asked: list[str] = []

    def note(*told: Any) -> None:
        asked.append(told[2])

    event.listen(Engine, "before_cursor_execute", note)
    try:
        reliability.table(backend, 10)
        without = len(asked)
        asked.clear()
        for loop_id in ids.values():
            explain(backend, loop_id, ("valve.stiction", 0.7))
        asked.clear()
        reliability.table(backend, 10)
    finally:
        event.remove(Engine, "before_cursor_execute", note)
    assert len(asked) == without
