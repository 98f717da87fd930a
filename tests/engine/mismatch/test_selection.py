"""Which pairs are offered to the choice of effects, whatever the fits behind them say."""

from types import SimpleNamespace

import pytest

from app.engine.mismatch.compete import selection
from app.engine.mismatch.physics.generic import CODE as UNNAMED

BASE, WORSE, BETTER = (SimpleNamespace(score=score) for score in (0.0, 4.0, 9.0))
RANKING = (SimpleNamespace(fit=WORSE), SimpleNamespace(fit=BETTER))
SURVEYED = tuple(
    SimpleNamespace(block=SimpleNamespace(code=code)) for code in ("valve.stiction", UNNAMED, "sensor.lag")
)


@pytest.fixture
def asked(monkeypatch):
    """What couples are looked for with: of two that are found the first runs much nearer to PV than what they are
    compared with, the second does not."""
    given = []

    def coupled(*told):
        given.append(told)
        return ("nearer", "no nearer")

    monkeypatch.setattr(selection, "couples", lambda *told: told)
    monkeypatch.setattr(selection, "looked_ahead", lambda *told: ())
    monkeypatch.setattr(selection, "coupled", coupled)
    monkeypatch.setattr(selection, "nearer", lambda both, base: both == "nearer" and base is BASE)
    monkeypatch.setattr(selection, "pairs_of", lambda both, base, ranking: [(both, "one"), (both, "other")])
    return given


def test_where_a_single_effect_pays_all_couples_compete_with_the_best_of_them(asked):
    found = selection.found_together(BASE, SURVEYED, RANKING, pays=True)
    assert [both for both, _ in found] == ["nearer", "nearer", "no nearer", "no nearer"]
    ((begun, (_, named, apart), single),) = asked
    assert (begun, single, apart) == (BASE, BETTER, selection.APART)
    assert [scanned.block.code for scanned in named] == ["valve.stiction", "sensor.lag"]


def test_where_none_pays_only_couples_that_run_much_nearer_to_pv_do(asked):
    found = selection.found_together(BASE, SURVEYED, RANKING, pays=False)
    assert found == [("nearer", "one"), ("nearer", "other")]
    assert asked[0][2] is BASE


def test_without_a_ranking_couples_are_compared_with_what_they_begin_from(asked):
    selection.found_together(BASE, SURVEYED, (), pays=True)
    assert asked[0][2] is BASE
