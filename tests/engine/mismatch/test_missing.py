"""What is asked of a record once is not asked again: which signals may be causes takes as long as many fits."""

import pytest

from app.engine.mismatch import Comparison, LinearSimulation, explain, missing
from app.engine.mismatch.loop.block import Block
from app.engine.mismatch.loop.experiment import Experiment
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.recording import FloatArray
from tests.engine.plain_loop import GIVEN, TS, moves, noise, recorded


def apart() -> FloatArray:
    """A process of three lags beside one another, which no two in a row are."""
    lags = (Plant(1.0, 6.0, 0.0), Plant(1.5, 60.0, 0.0), Plant(2.0, 400.0, 0.0))
    return 50.0 + sum((run_process(moves(), plant, TS) for plant in lags), 0.5 * noise())


@pytest.mark.parametrize(
    ("pv", "given", "richer"),
    [(recorded(moves()), GIVEN, False), (recorded(moves()), None, False), (apart(), None, True)],
    ids=["given", "own", "own dynamics"],
)
def test_causes_are_looked_for_once(
    pv: FloatArray, given: LinearSimulation | None, richer: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Experiment] = []
    library = missing.library

    def counted(record: Experiment) -> tuple[Block, ...]:
        asked.append(record)
        return library(record)

    monkeypatch.setattr(missing, "library", counted)
    said = explain(Comparison("loop", TS, 40.0 + moves(), pv, simulation=given))
    assert ("own_dynamics" in {reason.code for reason in said.evidence}) is richer
    assert len(asked) == 1
