"""Table 2 and the ladder of search spaces: where the climb begins, when it goes on, when it ends."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from app.engine.armax import SearchSpace
from app.engine.recording import UniformRecord
from app.engine.reference import reliability
from app.engine.reference.reliability import LadderConfig, climb, read_table2
from app.engine.simulate import LoopSpec, Pid, Signal, TwoParameterValve, first_order, simulate_loop
from app.errors import DataError


def record(high: bool) -> UniformRecord:
    op = np.sin(2 * np.pi * 5 * np.arange(400) / 400)
    pv = op + (np.random.default_rng(0).standard_normal(400) if high else 0.0)
    return UniformRecord(1.0, pv, op, None, np.zeros(400, dtype=np.bool_))


@pytest.fixture
def answers(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Stands in for the identification: says stiction in the spaces of `stiction_in`, notes what was asked."""
    said = SimpleNamespace(stiction_in=set(), too_short_for=set(), asked=[], asked_two=[], points=[])

    class Answering:
        def __init__(self, _: UniformRecord, __: object) -> None:
            pass

        def one_parameter(self, space: SearchSpace, points: object = None) -> SimpleNamespace:
            said.points.append(points)
            orders = (space.na_max, space.nb_max, space.nc_max)
            said.asked.append(orders)
            if orders in said.too_short_for:
                raise DataError("record_too_short", "needs more")
            return SimpleNamespace(stiction=orders in said.stiction_in)

        def two_parameter(self, space: SearchSpace) -> str:
            said.asked_two.append((space.na_max, space.nb_max, space.nc_max))
            return "surface"

    monkeypatch.setattr(reliability, "Identification", Answering)
    return said


@pytest.mark.parametrize(
    ("high", "stiction", "reading", "reliable"),
    [
        (True, True, "high_stiction", True),
        (True, False, "high_no_stiction", False),
        (False, True, "low_stiction", False),
        (False, False, "low_no_stiction", True),
    ],
)
def test_table_2(high: bool, stiction: bool, reading: str, reliable: bool) -> None:
    assert read_table2(high, stiction) == reading
    assert (reading in reliability.RELIABLE) is reliable


def test_low_yper_begins_at_the_nominal_space_and_ends_where_it_agrees(answers: SimpleNamespace) -> None:
    reference = climb(record(high=False))
    assert answers.asked == [(5, 5, 5)]
    assert (reference.reading, reference.reliable, reference.widenings) == ("low_no_stiction", True, 0)


def test_high_yper_begins_where_harmonics_can_be_explained(answers: SimpleNamespace) -> None:
    answers.stiction_in = {(5, 5, 10)}
    reference = climb(record(high=True))
    assert answers.asked == [(5, 5, 10)]
    assert (reference.reading, reference.reliable) == ("high_stiction", True)


def test_disagreement_climbs_rung_by_rung_until_agreement(answers: SimpleNamespace) -> None:
    answers.stiction_in = {(5, 5, 5), (5, 5, 10)}
    reference = climb(record(high=False))
    assert answers.asked == [(5, 5, 5), (5, 5, 10), (5, 5, 25)]
    assert [rung.reading for rung in reference.rungs] == ["low_stiction", "low_stiction", "low_no_stiction"]
    assert [rung.agrees for rung in reference.rungs] == [False, False, True]
    assert (reference.widenings, reference.ending) == (2, "agreement")
    assert reference.search_space == SearchSpace(5, 5, 25)


def test_last_rung_ends_the_climb_unreliable(answers: SimpleNamespace) -> None:
    reference = climb(record(high=True))
    assert answers.asked == [(5, 5, 10), (5, 5, 25), (10, 10, 25)]
    assert (reference.reading, reference.reliable, reference.stiction) == ("high_no_stiction", False, False)
    assert reference.ending == "ladder_end"


def test_record_too_short_for_the_next_rung_ends_the_climb(answers: SimpleNamespace) -> None:
    answers.too_short_for = {(5, 5, 25)}
    reference = climb(record(high=True))
    assert (len(reference.rungs), reference.ending, reference.reliable) == (1, "record_too_short", False)


def test_record_too_short_for_the_first_rung_starts_lower(answers: SimpleNamespace) -> None:
    answers.too_short_for = {(5, 5, 5), (5, 5, 10), (5, 5, 25), (10, 10, 25)}
    answers.stiction_in = {(2, 2, 2)}
    reference = climb(record(high=True))
    assert answers.asked == [(5, 5, 10), (5, 5, 5), (2, 2, 2)]
    assert (reference.search_space, reference.ending) == (SearchSpace(2, 2, 2), "agreement")


def test_record_too_short_for_every_rung_is_refused(answers: SimpleNamespace) -> None:
    answers.too_short_for = set(LadderConfig().rungs)
    with pytest.raises(DataError, match="needs more"):
        climb(record(high=True))


def test_two_parameter_model_is_identified_on_the_last_rung_only(answers: SimpleNamespace) -> None:
    reference = climb(record(high=True))
    assert answers.asked_two == [(10, 10, 25)]
    assert [rung.two for rung in reference.rungs] == [None, None, "surface"]
    assert climb(record(high=True), LadderConfig(two_parameter=False)).last.two is None


def test_two_parameter_model_stays_below_its_widest_space(answers: SimpleNamespace) -> None:
    config = LadderConfig(two_parameter_widest=(5, 5, 10))
    assert climb(record(high=True), config).search_space == SearchSpace(10, 10, 25)
    assert answers.asked_two == [(5, 5, 10)]
    climb(record(high=False), config)
    assert answers.asked_two[-1] == (5, 5, 5)


def test_a_climb_that_is_not_to_widen_stays_on_its_first_rung(answers: SimpleNamespace) -> None:
    reference = climb(record(high=True), LadderConfig(widen=False, two_parameter=False))
    assert answers.asked == [(5, 5, 10)]
    assert (reference.ending, reference.reading, reference.reliable) == ("not_widened", "high_no_stiction", False)
    answers.stiction_in = {(5, 5, 10)}
    assert climb(record(high=True), LadderConfig(widen=False)).ending == "agreement"


def test_wider_rungs_try_part_of_the_grid_and_the_lowest_of_the_first() -> None:
    coarse = LadderConfig(wider_every=10, two_parameter=False)
    noise = np.random.default_rng(3)
    shaken = UniformRecord(1.0, noise.normal(size=600), noise.normal(size=600), None, np.zeros(600, dtype=np.bool_))
    rungs = climb(shaken, replace(coarse, yper_threshold_pct=0.0)).rungs
    if len(rungs) == 1:
        rungs = climb(shaken, replace(coarse, yper_threshold_pct=1e9)).rungs
    first, wider = rungs[0].one, rungs[1].one
    lowest = first.d[np.argsort(first.rmse, kind="stable")[:3]]
    assert set(first.d[::10]) | set(lowest) == set(wider.d)
    assert wider.d[0] == 0.0
    assert len(first.d) == 30


def test_ladder_and_threshold_are_configurable(answers: SimpleNamespace) -> None:
    config = LadderConfig(rungs=((1, 1, 1), (3, 3, 3)), nominal=(1, 1, 1), high=(3, 3, 3), yper_threshold_pct=99.9)
    reference = climb(record(high=True), config)
    assert answers.asked == [(1, 1, 1)]
    assert not reference.high


def test_a_first_rung_off_the_ladder_is_refused() -> None:
    with pytest.raises(ValueError, match="not on the ladder"):
        LadderConfig(nominal=(4, 4, 4))
    with pytest.raises(ValueError, match="not on the ladder"):
        LadderConfig(two_parameter_widest=(4, 4, 4))


def test_flat_record_is_refused_with_a_code() -> None:
    flat = UniformRecord(1.0, np.ones(400), np.arange(400.0), None, np.zeros(400, dtype=np.bool_))
    with pytest.raises(DataError) as refused:
        climb(flat)
    assert refused.value.code == "flat_signal"


def test_climb_on_a_simulated_sticky_valve_agrees_and_does_not_depend_on_units() -> None:
    valve = TwoParameterValve(6.0, 2.0)
    spec = LoopSpec(
        first_order(1.2, 20.0, 3.0), Pid(0.4, 20.0), valve, Signal(), Signal(value=9.0), noise=Signal(noise_sd=0.05)
    )
    loop = simulate_loop(spec, 2000.0, 2.0, seed=3).uniform()
    reference = climb(loop)
    assert reference.reading == "high_stiction"
    assert reference.last.two is not None
    assert reference.last.two.stiction
    other = UniformRecord(2.0, 1000.0 * loop.pv + 3.0, 0.01 * loop.op, None, loop.filled)
    again = climb(other)
    assert again.yper.yper_pct == pytest.approx(reference.yper.yper_pct)
    assert again.last.one.d_best == pytest.approx(0.01 * reference.last.one.d_best)
    assert (again.reading, again.widenings) == (reference.reading, reference.widenings)
