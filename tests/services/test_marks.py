"""Whatever changes what is told beside a verdict changes the version of the page that tells it."""

from contextlib import nullcontext
from datetime import timedelta
from types import SimpleNamespace
from typing import Any

import pytest

from app.services.plant import written
from app.services.plant.written import Marks, marks_of
from app.storage.notes import Standing
from app.storage.types import now

LATELY, LONG_AGO = now() - timedelta(days=1), now() - timedelta(days=400)
SHELVED = {"until": "2027-01-01T00:00:00Z", "work_order": "W1", "worse": False}


def marked(
    monkeypatch: pytest.MonkeyPatch,
    standing: dict[str, Standing] | None = None,
    shelved: dict[str, Any] | None = None,
    naming: dict[str, int] | None = None,
    hold_days: float = 90.0,
) -> Marks:
    on_shelf = {tag: SimpleNamespace(**SHELVED | one) for tag, one in (shelved or {}).items()}
    monkeypatch.setattr(written, "shelf", lambda _: SimpleNamespace(by_tag=lambda: on_shelf))
    monkeypatch.setattr(written, "notes", SimpleNamespace(standing=lambda *_: standing or {}))
    monkeypatch.setattr(written, "explanations", SimpleNamespace(naming_ids=lambda *_: naming or {}))
    settings = SimpleNamespace(hold_days=hold_days)
    backend: Any = SimpleNamespace(database=SimpleNamespace(read=nullcontext), settings=settings)
    return marks_of(backend, ["A", "B"])


def test_a_loop_is_marked_by_each_that_its_row_does_not_tell(monkeypatch: pytest.MonkeyPatch) -> None:
    assert marked(monkeypatch).tags == set()
    assert marked(monkeypatch, {"A": Standing("W1")}, {"B": {}}, {"A": 1}).tags == {"A", "B"}
    assert marked(monkeypatch, naming={"B": 1}).tags == {"B"}
    assert marked(monkeypatch, shelved={"B": {}, "of another page": {}}).tags == {"B"}


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ({"standing": {"A": Standing("W1")}}, {"standing": {"A": Standing("W2")}}),
        ({"standing": {"A": Standing("W1", LATELY)}}, {"standing": {"A": Standing("W1", LATELY, "W1")}}),
        ({"standing": {"A": Standing("W1", LATELY)}}, {"standing": {"A": Standing("W1", LONG_AGO)}}),
        ({"shelved": {"A": {}}}, {"shelved": {"A": {"worse": True}}}),
        ({"shelved": {"A": {}}}, {"shelved": {"A": {"until": "2027-02-01T00:00:00Z"}}}),
        ({"shelved": {"A": {}}}, {"shelved": {"A": {"work_order": "W2"}}}),
        ({"naming": {"A": 1}}, {"naming": {"A": 2}}),
        ({"naming": {"A": 1}}, {"naming": {"A": 1}, "hold_days": 1.0}),
    ],
)
def test_all_that_it_depends_on_is_told(
    monkeypatch: pytest.MonkeyPatch, before: dict[str, Any], after: dict[str, Any]
) -> None:
    assert marked(monkeypatch, **before).told != marked(monkeypatch, **after).told
    assert marked(monkeypatch, **before).told == marked(monkeypatch, **before).told


def test_that_it_is_no_longer_asked_whether_a_repair_helped_is_told_though_nobody_wrote_anything(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    repaired = {"A": Standing("W1", LATELY)}
    before = marked(monkeypatch, repaired).told
    monkeypatch.setattr(written, "asked_after", lambda at: False)
    assert marked(monkeypatch, repaired).told != before
