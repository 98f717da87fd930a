"""A PV that has come to stand is a failure by how far OP went meanwhile, whatever share of the record that is; one that
stands with reason is not accused."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.fitness import FitnessConfig, assess
from app.engine.recording import Recording
from tests.audited import audited

N, TS = 3000, 10.0
SINCE, SEAM = 2000, 2600
CAUSE = "stuck_valve_or_dead_transmitter"


def alive() -> Recording:
    """A loop that is held at 50, OP going a few per cent to and fro after its load."""
    rng, k = np.random.default_rng(3), np.arange(N)
    op = np.round(48.0 + 2.0 * np.sin(k / 150.0) + 0.1 * rng.standard_normal(N), 2)
    pv = np.round(50.0 + 0.3 * np.sin(k / 150.0 + 1.0) + 0.1 * rng.standard_normal(N), 2)
    return Recording("loop", TS * k, pv, op, np.full(N, 50.0), np.ones(N, bool))


def wound_up(since: int = SINCE) -> Recording:
    """The transmitter freezes away from SP, and OP runs down to 0 within 400 samples and stays."""
    loop = alive()
    pv, op = loop.pv.copy(), loop.op.copy()
    pv[since:] = 50.7
    op[since:] = np.round(np.maximum(op[since] * (1.0 - np.arange(N - since) / 400.0), 0.0), 2)
    return replace(loop, pv=pv, op=op)


def restarted(at: int = SEAM) -> Recording:
    """Its transmitter is started again meanwhile: three samples of 0, and another value that is as dead."""
    loop = wound_up()
    pv = loop.pv.copy()
    pv[at:], pv[at : at + 3] = 50.9, 0.0
    return replace(loop, pv=pv)


def test_a_loop_at_work_does_not_stand():
    assert assess(alive()).standstill is None


@pytest.mark.parametrize("loop", [wound_up(), restarted(), restarted(2990)], ids=["frozen", "restarted", "just now"])
def test_a_frozen_transmitter_is_looked_at_today_restarted_or_not(loop):
    judgement = audited(loop).judgement
    assert (judgement.verdict, judgement.reliability, judgement.likely_cause) == ("inconclusive", "not_reliable", CAUSE)
    assert [reason.code for reason in judgement.reasons] == ["pv_stands", "prior_only", "pv_flat"]
    assert judgement.unanswered_s == (N - 1 - SINCE) * TS
    assert judgement.unanswered_since_s == SINCE * TS
    assert "for the last 2.77 h" in judgement.reasons[0].text


def test_how_much_of_the_stand_was_recorded_is_told_where_it_has_holes():
    loop = wound_up()
    later = replace(loop, time_s=loop.time_s + np.where(np.arange(N) >= SEAM, 60.0 * 3600.0, 0.0))
    stands = assess(later).standstill
    assert stands is not None
    assert stands.for_s - stands.recorded_s == pytest.approx(60.0 * 3600.0 + TS)
    assert "for the last 62.8 h, of which 2.77 h were recorded, up to the end" in stands.text
    whole = assess(loop).standstill
    assert whole is not None
    assert "recorded" not in whole.text


@pytest.mark.parametrize("before", [0, 20_000])
def test_how_much_was_recorded_before_is_nothing_to_it(before):
    """Of 30,000 samples it stands for a thirtieth."""
    loop, k = restarted(), np.arange(before + N)
    first = alive()
    pv, op = (np.concatenate((np.resize(x, before), y)) for x, y in ((first.pv, loop.pv), (first.op, loop.op)))
    longer = Recording("loop", TS * k, pv, op, np.full(len(k), 50.0), np.ones(len(k), bool))
    assert audited(longer).judgement.unanswered_s == audited(loop).judgement.unanswered_s


def test_the_check_does_not_pass_and_says_since_when():
    (finding,) = (one for one in audited(restarted()).fitness.findings if one.code == "pv_flat")
    assert (finding.outcome, finding.unit) == ("fail", "h")
    assert finding.statistic == pytest.approx(2.775)
    assert finding.text.startswith("PV has held 2 values, one after another, for the last 2.77 h")


def test_health_is_capped_while_it_stands_by_parts_that_say_so():
    health = audited(restarted()).health
    lost = {part.code: part.lost for part in health.parts}
    assert (lost["stiction"], lost["service"]) == (40.0, 15.0)
    assert health.value <= 45.0
    told = next(part.text for part in health.parts if part.code == "stiction")
    assert told.startswith("PV has not answered OP for the last 2.77 h")


@pytest.mark.parametrize("since", [0, 40, 1000, 2800])
def test_it_is_said_from_when_on_it_stands(since):
    assert assess(wound_up(since)).standstill.for_s == (N - 1 - since) * TS


def test_without_set_point_and_mode_it_is_seen_too():
    loop = replace(restarted(), sp=None, automatic=None)
    assert audited(loop).judgement.likely_cause == CAUSE


@pytest.mark.parametrize("known", [0, SINCE])
def test_a_set_point_that_is_not_known_claims_no_more_than_none(known):
    """Two stands from the beginning, PV coarse: nothing tells how it moves, and where it should be is not known."""
    k = np.arange(N)
    pv = np.where(k < SEAM, 50.0, 50.9)
    op = np.round(48.0 + 20.0 * np.sin(k / 150.0), 2)
    loop = replace(alive(), pv=pv, op=op, automatic=None)
    without = assess(replace(loop, sp=None)).standstill
    assert without is None
    assert assess(replace(loop, sp=np.where(k < known, 50.0, np.nan))).standstill is None


def test_units_and_signs_are_free():
    given = restarted()
    other = replace(given, pv=7.0 - 0.1 * given.pv, op=-3.0 * given.op, sp=7.0 - 0.1 * given.sp)
    assert audited(other).judgement == audited(given).judgement


def test_dead_before_and_dead_again():
    loop = wound_up()
    pv, op = loop.pv.copy(), loop.op.copy()
    pv[500:900], op[500:900] = 50.7, np.linspace(48.0, 0.0, 400)
    assert assess(replace(loop, pv=pv, op=op)).standstill.for_s == (N - 1 - SINCE) * TS


def test_where_nothing_moved_in_the_whole_record_though_the_mode_says_automatic():
    loop = replace(alive(), pv=np.full(N, 43.0), op=np.zeros(N), op_range=(0.0, 100.0), pv_range=(0.0, 100.0))
    judgement = audited(loop).judgement
    assert (judgement.verdict, judgement.likely_cause) == ("inconclusive", CAUSE)
    assert judgement.unanswered_since_s is None
    shut = replace(loop, pv=np.zeros(N))
    assert audited(shut).judgement.likely_cause == "controller_not_acting"


def _changed(**signals: object) -> Recording:
    """From SINCE on these values in place of those of a loop at work."""
    loop = alive()
    made = {}
    for name, values in signals.items():
        made[name] = getattr(loop, name).copy()
        made[name][SINCE:] = values
    return replace(loop, **made)


LEFT = N - SINCE
TRAVELS = np.round(np.linspace(48.0, 0.0, LEFT), 2)
INNOCENT = {
    "in manual": _changed(pv=50.7, op=TRAVELS, automatic=False),
    "shut down, OP at rest": _changed(pv=50.7, op=48.0),
    "shut down by hand in some steps": _changed(pv=50.7, op=np.repeat([40.0, 20.0, 10.0, 0.0], LEFT // 4)),
    "shut down, OP and SP at 0": _changed(pv=0.0, op=0.0, sp=0.0),
    "shut down slowly, SP with it": _changed(pv=0.0, op=TRAVELS / 10.0, sp=0.0),
    "held at its set point": _changed(pv=50.0, op=np.round(48.0 + 2.0 * np.sin(np.arange(LEFT) / 150.0), 2)),
    "quiet, OP hardly moves": _changed(pv=50.1, op=np.round(48.0 + 0.002 * np.arange(LEFT) / 10.0, 2)),
    "moves again": _changed(pv=np.r_[np.full(LEFT - 200, 50.7), alive().pv[-200:]], op=TRAVELS),
}


@pytest.mark.parametrize("loop", INNOCENT.values(), ids=INNOCENT.keys())
def test_a_pv_that_stands_with_reason_is_not_accused(loop):
    assert assess(loop).standstill is None


def test_a_coarse_pv_stands_for_as_long_as_op_ever_went_meanwhile():
    """PV is stored in steps of 2; OP went over 3 within each, and goes over 4 in the last one."""
    k = np.arange(N)
    op = np.abs((k / 100.0) % 6.0 - 3.0) + 47.0
    pv = np.where((k // 300) % 2 == 0, 50.0, 52.0)
    op[-600:], pv[-600:] = np.linspace(47.0, 51.0, 600), 52.0
    assert assess(replace(alive(), pv=pv, op=op, sp=np.full(N, 50.5))).standstill is None


def test_on_off_control_is_no_standstill():
    k = np.arange(N)
    loop = replace(alive(), op=np.where((k // 200) % 2 == 0, 0.0, 100.0), pv=np.round(np.abs(k % 400 - 200) / 20.0))
    assert assess(loop).standstill is None


@pytest.mark.parametrize("manual", [slice(SINCE, SINCE + 300), slice(SINCE - 50, SINCE + 20), slice(0, 100)])
def test_who_switched_to_manual_meanwhile_hides_nothing(manual):
    """As operators do who see a PV that stands: what stood before, and stands on, is not what PV held for usual."""
    loop = wound_up()
    automatic = np.ones(N, bool)
    automatic[manual] = False
    stands = assess(replace(loop, automatic=automatic)).standstill
    assert stands is not None
    assert stands.for_s == (N - 1 - max(SINCE, manual.stop)) * TS


UNDER_WAY = replace(alive(), pv=np.full(N, 43.0), op=np.full(N, 1.0), op_range=(0.0, 100.0), pv_range=(0.0, 100.0))
HOLED = replace(wound_up(), time_s=TS * (np.arange(N) + 6.0 * (np.arange(N) >= SEAM)))


@pytest.mark.parametrize(
    ("loop", "config", "stands"),
    [
        (wound_up(N - 60), FitnessConfig(least_still=50), (False, True)),
        (wound_up(), FitnessConfig(least_still=N - SINCE + 1), (True, False)),
        (INNOCENT["shut down by hand in some steps"], FitnessConfig(fewest_moves=4), (False, True)),
        (wound_up(), FitnessConfig(least_move=20.0), (True, False)),
        (UNDER_WAY, FitnessConfig(op_limit_band=0.02), (False, True)),
    ],
    ids=["shorter", "longer", "fewer values", "further", "wider limit"],
)
def test_what_a_stand_is_can_be_configured(loop, config, stands):
    assert tuple(assess(loop, given).standstill is not None for given in (None, config)) == stands


@pytest.mark.parametrize(("most_filled", "missing_s"), [(10.0, 0.0), (3.0, 7.0 * TS)])
def test_a_hole_of_a_stand_is_what_a_hole_of_the_record_is(most_filled, missing_s):
    stands = assess(HOLED, FitnessConfig(max_gap_intervals=most_filled)).standstill
    assert stands.for_s - stands.recorded_s == pytest.approx(missing_s)
