"""Loops whose controller scans five times between two samples: what the stem does there no free run knows, and a stem
of next to no slip behind a gain many times the true one explains the samples best, with a free run that is far off.
"""

import numpy as np
import pytest

from app.engine.mismatch import explain
from app.engine.mismatch.compare.comparison import record_of
from app.engine.mismatch.compete.competition import descended
from app.engine.mismatch.compete.restarting import (
    STICKS,
    begun_at,
    by_standing,
    restarted,
    stands,
    takes_its_place,
    to_its_end,
)
from app.engine.mismatch.fit.given import identify
from app.engine.mismatch.fit.stems import ShownStem
from app.engine.mismatch.loop.plant import Plant
from app.engine.mismatch.physics import fixed
from tests.proof.scans import made
from tests.proof.stems import healthy

SEED, SCANS = 7, 5


def test_a_stem_that_stands_is_not_displaced_by_a_likelier_one_that_is_refused() -> None:
    loop = made("limit cycle", 4, 333, SCANS)
    base = identify(record_of(loop.comparison))
    (sticks,) = (stem for stem in restarted(base, fixed()) if stem.block.code == "valve.stiction")
    assert takes_its_place(sticks, None)
    assert abs(sticks.fit.parts[0].values[0] / loop.S - 1.0) < 0.1
    block = next(block for block in fixed() if block.name == STICKS)
    mimic = ShownStem(7.9, 0.01, 0.0, 100.0, Plant(8.0, 20.5, 8.0))  # for a gain of 1 and S of 8.95
    refused = to_its_end(descended(*begun_at(base, mimic, block), 6))
    assert refused.score > sticks.fit.score
    assert not stands(refused, base)
    assert by_standing((refused, sticks.fit), base)[0] is sticks.fit
    assert by_standing((refused,), base)[0] is refused


def test_stems_are_looked_for_again_behind_the_first_that_stands() -> None:
    loop = made("limit cycle", 6, 333, SCANS)  # a likelier one that was refused had ended the search
    base = identify(record_of(loop.comparison))
    (size,) = (stem.fit.parts[0].values[0] for stem in restarted(base, fixed()) if takes_its_place(stem, None))
    np.testing.assert_allclose(size, loop.S, rtol=0.05)


@pytest.mark.parametrize("seed", [9301, 9315, 9403], ids=["triangle", "square", "slips a little"])
def test_a_load_that_swings_makes_no_stem_of_a_sound_valve(seed: int) -> None:
    base = identify(record_of(healthy(seed)))
    stems = restarted(base, fixed())
    assert stems
    assert not [stem for stem in stems if takes_its_place(stem, None)]


def test_a_limit_cycle_with_scans_between_its_samples_is_named() -> None:
    loop = made("limit cycle", 1, SEED, SCANS)
    said = explain(loop.comparison)
    assert said.effects[0].code == "valve.stiction"
    size = next(p.value for p in said.effects[0].parameters if p.name == "S")
    np.testing.assert_allclose(size, loop.S, rtol=0.1)
