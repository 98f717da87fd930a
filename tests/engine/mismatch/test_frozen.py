"""A PV that stands still wherever it is known is refused, and not explained by what its gaps were bridged with."""

from collections.abc import Callable

import numpy as np
import pytest

from app.engine.evidence import Reason
from app.engine.mismatch import Comparison, explain, locate
from app.engine.mismatch.compare import preparing
from app.engine.mismatch.compare.comparison import record_of
from app.engine.mismatch.compare.patterns import Pattern, find_patterns
from app.engine.mismatch.compare.preparing import prepare
from app.engine.mismatch.loop.block import Part
from app.engine.mismatch.physics.sensor_pattern import STUCK
from app.engine.recording import BoolArray, FloatArray
from app.errors import DataError

N = 600
AT = np.arange(N)
OP = 50.0 + 5.0 * np.sin(AT / 9.0)


def compared(pv: FloatArray, known: BoolArray | None) -> Comparison:
    return Comparison("FIC1", 1.0, OP, pv, known=known)


@pytest.mark.parametrize("answer", [explain, locate])
@pytest.mark.parametrize("gap", [1, 6])
def test_a_pv_that_moves_in_its_gaps_alone_is_refused(answer: Callable[[Comparison], object], gap: int) -> None:
    known = gap <= AT % 40
    pv = np.where(known, 30.0, 30.0 + 0.1 * (AT % 7))
    with pytest.raises(DataError) as raised:
        answer(compared(pv, known))
    assert raised.value.code == "signal_constant"
    assert "PV changes 0 times" in raised.value.message


def test_levels_between_gaps_are_no_fault() -> None:
    """PV stands within each stretch that is known, and is another one in each: nothing tells how far it moves."""
    known = AT % 20 < 15
    level = np.random.default_rng(1).normal(size=N // 20)[AT // 20]
    found = find_patterns(record_of(compared(30.0 + level, known)))
    assert [(pattern.reason.code, pattern.hides_pv) for pattern in found] == [("pv_straight", False)]


def test_a_pv_that_is_on_or_off_leaves_no_limit_that_hides_it() -> None:
    """Between its two ends there is what the gaps were bridged with alone, and that shows no PV that leaves them."""
    known = AT % 31 > 7
    switched = np.where(np.sin(AT / 7.0 + 0.1) > 0.0, 80.0, 20.0)
    pv = np.interp(AT, AT[known], switched[known])
    record = prepare(compared(pv, known)).record
    assert np.array_equal(record.usable, known)


def test_a_pv_that_is_hidden_wherever_it_is_known_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    everywhere = np.ones(N, dtype=np.bool_)
    stuck = Pattern(Part(STUCK, np.array([0.0, N])), everywhere, Reason("pv_repeats", "PV stands"), True)
    monkeypatch.setattr(preparing, "find_patterns", lambda _: (stuck,))
    with pytest.raises(DataError) as raised:
        prepare(compared(OP, None))
    assert raised.value.code == "nothing_known"
