"""What is told of both sides of a repair."""

from types import SimpleNamespace
from typing import Any

import pytest

from app.errors import NotFoundError
from app.services.moments import UTC_CLOCK
from app.services.plant import before_after
from app.services.plant.before_after import Repair, _told, compared
from app.services.telling.wording import VERDICT_WORDS

UNKNOWN = ("window_start", "window_end", "health", "stiction_S", "oscillation_period_s", "oscillation_strength")


@pytest.mark.parametrize(("reasons", "told"), [("pv_does_not_answer;prior_only", "–"), ("pv_does_not_answer", "0.60")])
def test_a_prior_is_no_probability_that_was_measured(reasons: str, told: str) -> None:
    said = {"verdict": "inconclusive", "reliability": "not_reliable", "stiction_probability": 0.6, "reasons": reasons}
    assert _told(dict.fromkeys(UNKNOWN) | said, UTC_CLOCK, "%")["Probability of stiction"] == told


@pytest.mark.parametrize(
    ("verdict", "size", "told"),
    [
        ("no_stiction", None, "none to state"),
        ("stiction", None, "the record cannot tell"),
        ("inconclusive", None, "the record cannot tell"),
        ("stiction", (2.0, 1.5, 2.5), "2.00 (1.50 to 2.50)"),
    ],
)
def test_no_size_is_told_apart_from_none_that_is_known(
    verdict: str, size: tuple[float, float, float] | None, told: str
) -> None:
    sizes = dict(zip(("stiction_S", "stiction_S_low", "stiction_S_high"), size or (None,) * 3, strict=True))
    said = {"verdict": verdict, "reliability": "reliable", "stiction_probability": 0.6, "reasons": ""}
    lines = _told(dict.fromkeys(UNKNOWN) | said | sizes, UTC_CLOCK, "%")
    assert lines["Size of stiction S, units of OP (95 % interval)"] == told


@pytest.mark.parametrize("value", [0.0, 0.012345, None])
def test_an_error_of_nothing_is_one_that_is_known(value: float | None) -> None:
    said = {"verdict": "no_stiction", "reliability": "reliable", "stiction_probability": 0.1, "reasons": ""}
    lines = _told(dict.fromkeys(UNKNOWN) | said | {"error_std": value}, UTC_CLOCK, "%")
    assert lines["Control error SP - PV, standard deviation, %"] == {0.0: "0", 0.012345: "0.0123", None: "–"}[value]


@pytest.mark.parametrize("repair", [None, Repair("2026-01-01T00:00:00Z", {"verdict": "stiction"}, None)])
def test_without_a_verdict_since_the_repair_nothing_is_compared(repair: Repair | None) -> None:
    backend: Any = None  # which is not asked
    assert compared(backend, "FIC1", repair, None) == []


def test_a_comparison_goes_on_without_key_figures_that_are_no_longer_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    def dropped(*_: Any) -> dict[str, Any]:
        raise NotFoundError("no_detail", "it is kept no longer")

    monkeypatch.setattr(before_after, "verdict_detail", dropped)
    said = {"verdict": "no_stiction", "reliability": "reliable", "stiction_probability": 0.1, "reasons": ""}
    row = dict.fromkeys(UNKNOWN) | said | {"audit_id": "7"}
    backend: Any = SimpleNamespace(clock=UTC_CLOCK)
    lines = compared(backend, "FIC1", Repair("2026-01-01T00:00:00Z", row, row | {"verdict": "stiction"}), None)
    assert lines[0] == ("Verdict", VERDICT_WORDS["no_stiction"], VERDICT_WORDS["stiction"])
    assert ("Reversals of OP an hour", "–", "–") in lines
