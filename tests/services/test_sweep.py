"""What a sweep does is done whatever becomes of the rest of it."""

from datetime import UTC, datetime, timedelta

import pytest

from app.services.access.trail import list_trail
from app.services.auditing import ending
from app.services.auditing.audits import get_audit, list_audits, start_audit
from app.services.backend import Backend
from app.services.upkeep import sweep as sweeping
from app.services.upkeep.retention import ACTION
from app.services.upkeep.sweep import sweep
from app.storage import items
from app.storage.items import Failure
from tests.services.audited_plant import AddLoops

BROKEN = ["announce_explanations", "announce_digests", "end_if_complete", "nightly_if_due"]


def broken(*_: object) -> None:
    raise ZeroDivisionError("broken each time")


def left_complete(backend: Backend) -> str:
    """A run of which nothing is left to do, and which has not ended."""
    run = start_audit(backend)
    with backend.database.write() as connection:
        claims = items.claim(connection, int(run.id), "lost", 100, 40.0)
        items.fail(connection, [Failure(claim, "fault", "it broke") for claim in claims])
    return run.id


def did(backend: Backend) -> set[str]:
    return {line.action for line in list_trail(backend).rows}


@pytest.mark.parametrize("name", BROKEN)
def test_what_fails_each_time_keeps_nothing_else_from_being_done(
    backend: Backend, add_loops: AddLoops, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    add_loops("A", created_at=datetime.now(UTC) - timedelta(days=2))
    run = left_complete(backend)
    monkeypatch.setattr(sweeping, name, broken)
    with pytest.raises(ZeroDivisionError):
        sweep(backend)
    assert get_audit(backend, run).ended == (name != "end_if_complete")
    assert ("nightly" in {one.trigger for one in list_audits(backend).rows}) == (name != "nightly_if_due")
    assert ACTION in did(backend)


def test_a_run_that_cannot_be_ended_keeps_no_other_from_its_end(
    backend: Backend, add_loops: AddLoops, monkeypatch: pytest.MonkeyPatch
) -> None:
    add_loops("A")
    first, second = left_complete(backend), left_complete(backend)
    ends = sweeping.end_if_complete
    monkeypatch.setattr(sweeping, "end_if_complete", lambda b, run: broken() if run == int(first) else ends(b, run))
    with pytest.raises(ZeroDivisionError):
        sweep(backend)
    assert [get_audit(backend, run).state for run in (first, second)] == ["planned", "partial"]


def test_a_run_ends_without_the_words_that_cannot_be_written(
    backend: Backend, add_loops: AddLoops, monkeypatch: pytest.MonkeyPatch
) -> None:
    add_loops("A")
    run = left_complete(backend)
    reword = ending.reword
    monkeypatch.setattr(ending, "_hear_others", lambda *_: ["what cannot be written"])
    monkeypatch.setattr(ending, "reword", lambda c, heard: broken() if heard else reword(c, heard))
    assert sweep(backend).ended == 1
    assert get_audit(backend, run).state == "partial"
