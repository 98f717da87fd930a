"""What becomes of a selection that unseen data refuse: what is left of it is weighed like any other, and it is that
which the second recording judges.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from app.engine.evidence import Reason
from app.engine.mismatch import Comparison, explain, explanation
from app.engine.mismatch.compare.preparing import Prepared
from app.engine.mismatch.compete.selection import Selection
from app.engine.mismatch.fit.fitting import Fit
from app.engine.mismatch.missing import Competed
from app.engine.recording import FloatArray
from tests.engine.plain_loop import GIVEN, TS, moves, noise, recorded

pytestmark = pytest.mark.usefixtures("one_competition")
REFUSED = Reason("held_out_disagrees", "refused")


def backlash(u: FloatArray, half: float = 1.5) -> FloatArray:
    v, x = np.empty_like(u), u[0]
    for t, now in enumerate(u):
        v[t] = x = min(max(x, now - half), now + half)
    return v


def loop(name: str, seed: int = 3, added: FloatArray | float = 0.0) -> Comparison:
    u = moves(seed=seed)
    return Comparison(name, TS, 40.0 + u, recorded(backlash(u), added), simulation=GIVEN)


@pytest.fixture
def refusing(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """So many selections are refused by unseen data, one after the other."""

    def refuse(times: int) -> None:
        told = iter([(REFUSED,)] * times)
        monkeypatch.setattr(explanation, "unseen_data_refuse", lambda *_: next(told, ()))
        monkeypatch.setattr(explanation, "mostly_worse", lambda *_: True)

    return refuse


@pytest.fixture
def in_a_pair(one_competition: Callable[[Prepared], Competed], monkeypatch: pytest.MonkeyPatch) -> None:
    """What is found is the second of two effects beside itself, as far as the first alone is concerned."""

    def paired(prepared: Prepared) -> Competed:
        found = one_competition(prepared)
        return replace(found, selection=replace(found.selection, alone=found.selection))

    monkeypatch.setattr(explanation, "compete", paired)


def test_a_refused_name_is_not_what_the_second_recording_judges(refusing: Callable[[int], None]) -> None:
    second = loop("second", 8, noise(9) - noise())
    named = explain(loop("first"), second)
    assert named.validation.explained.rmse < 0.6 * named.validation.refitted.rmse
    refusing(1)
    bare = explain(loop("first"), second)
    assert bare.effects == ()
    assert bare.validation.explained.rmse == pytest.approx(bare.validation.refitted.rmse)


@pytest.mark.usefixtures("in_a_pair")
def test_the_first_of_a_refused_pair_is_no_surer_than_what_it_leaves_allows(
    refusing: Callable[[int], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    def lowered(_: Fit, selection: Selection) -> Selection:
        left = (Reason("lack_of_fit", "much is left"),)
        return replace(selection, effects=tuple(replace(e, most=0.3, left=left) for e in selection.effects))

    monkeypatch.setattr(explanation, "reviewed", lowered)
    refusing(1)
    said = explain(loop("first"))
    assert [effect.probability for effect in said.effects] == [0.3]
    assert "lack_of_fit" in {reason.code for reason in said.effects[0].evidence}
    assert REFUSED in said.evidence


@pytest.mark.usefixtures("in_a_pair")
def test_the_first_of_a_refused_pair_does_not_stand_where_op_moves_nothing(
    refusing: Callable[[int], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    still = Reason("op_moves_nothing", "PV does not answer OP")
    told = iter([(), (still,)])
    monkeypatch.setattr(explanation, "op_moves_nothing", lambda _: next(told))
    refusing(1)
    said = explain(loop("first"))
    assert said.effects == ()
    assert said.verdict == "inconclusive"
    assert {REFUSED, still} <= set(said.evidence)
