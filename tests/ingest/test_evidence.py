"""Texts that tell how numbers are written, held in bounds."""

import numpy as np
import polars as pl
import pytest

from app.ingest.numbers import evidence
from app.ingest.numbers.evidence import Evidence


@pytest.fixture(autouse=True)
def few_are_held(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evidence, "MOST_HELD", 100)


def filled(texts: list[str], chunks: int = 20) -> Evidence:
    found = Evidence(["A.PV"])
    for part in np.array_split(np.array(texts), chunks):
        found.add(pl.Series(["A.PV"] * len(part)), pl.Series(part.tolist()), np.ones(len(part), dtype=bool))
    return found


def test_remarks_of_which_each_is_of_another_form_are_held_in_bounds() -> None:
    assert filled([f"1 {'a' * k}" for k in range(1000)]).odd.height <= 150


def test_a_rare_form_is_held_beside_many_of_another() -> None:
    texts = [f"{k % 90 + 10},5" for k in range(2000)]
    texts[1500] = "1.234,5"
    found = filled(texts).odd
    assert found.height <= 200
    assert "1.234,5" in found["text"]
