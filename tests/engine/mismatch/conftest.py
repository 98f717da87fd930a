"""What tests of explanations share: of the effects of one record they ask different things, and these compete once."""

import pickle
from collections.abc import Callable, Iterator

import pytest

from app.engine.mismatch import explanation, missing
from app.engine.mismatch.compare import thinning
from app.engine.mismatch.compare.preparing import Prepared
from app.engine.mismatch.missing import Competed

COMPETED: dict[bytes, Competed] = {}
Compete = Callable[[Prepared], Competed]


@pytest.fixture(scope="module")
def one_competition() -> Iterator[Compete]:
    """For tests of what becomes of a selection, not of which it is: the effects of a record compete once a session."""
    compete = explanation.compete

    def once(prepared: Prepared) -> Competed:
        record = prepared.record
        signals = (record.op, record.pv, record.sp, record.measured, record.usable, record.rest)
        between = () if record.finer is None else (record.finer.record.op, record.finer.taken)
        beside = (record.sampling_interval_s, prepared.base.given, prepared.unrelated, missing.WANTED_SAMPLES)
        asked = pickle.dumps((*signals, *between, *beside))
        if asked not in COMPETED:
            COMPETED[asked] = compete(prepared)
        return COMPETED[asked]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(explanation, "compete", once)
        yield once


@pytest.fixture
def competing_on(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Makes names compete on so few samples that a record is a long one which is quickly explained."""

    def wanted(samples: int) -> None:
        for module in (thinning, missing):
            monkeypatch.setattr(module, "WANTED_SAMPLES", samples)

    return wanted
