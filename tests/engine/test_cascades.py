"""An OP that is another loop's set point is told from all that two loops have in common besides."""

import numpy as np
import pytest

from app.engine.plant_wide import cascades as module
from app.engine.plant_wide.cascades import Cascade, cascades
from app.engine.plant_wide.excerpts import excerpts_of
from app.engine.recording import Recording
from app.engine.signals.innovations import innovations

ORIGIN_S = 1_750_000_000.0
SAMPLES, INTERVAL_S = 3000, 5.0
TIME_S = INTERVAL_S * np.arange(SAMPLES)


def wandering(seed, memory=0.98):
    rng, x = np.random.default_rng(seed), np.zeros(SAMPLES)
    for k in range(1, SAMPLES):
        x[k] = memory * x[k - 1] + rng.standard_normal()
    return x


def measured(seed):
    return 0.2 * wandering(seed, memory=0.0)


def loop(op=None, sp=None, every=1, start_s=0.0):
    """The excerpts of a loop; a signal that is not given stands."""
    signals = (np.full(SAMPLES, 50.0) if x is None else x for x in (op, sp))
    op, sp = (x[::every] for x in signals)
    return excerpts_of(Recording("", TIME_S[::every], np.zeros(len(op)), op, sp), ORIGIN_S + start_s)


def found(**kept):
    return [(one.outer, one.inner) for one in cascades({tag: one for tag, one in kept.items() if one is not None})]


def test_an_op_that_is_a_set_point_makes_a_cascade():
    moved = wandering(1)
    plant = {"LIC1": loop(op=moved), "FIC2": loop(op=wandering(2), sp=moved), "PIC3": loop(op=wandering(3))}
    assert cascades(plant) == (Cascade("LIC1", "FIC2", 1.0),)


@pytest.mark.parametrize(
    "stored",
    [lambda x: -3.0 * x + 1e6, lambda x: np.round(x, 1), lambda x: np.roll(x, 1), lambda x: x + 1e-3 * TIME_S],
    ids=["unit and sign", "rounded", "a scan late", "drifting"],
)
def test_how_the_set_point_was_stored_makes_no_difference(stored):
    moved = wandering(1)
    assert found(LIC1=loop(op=moved), FIC2=loop(sp=stored(moved))) == [("LIC1", "FIC2")]


def test_loops_that_were_recorded_for_other_times_are_compared_where_both_were():
    longer = np.concatenate((wandering(7), wandering(8), wandering(1)))
    whole = Recording("", INTERVAL_S * np.arange(len(longer)), np.zeros(len(longer)), longer)
    last = loop(sp=longer[-SAMPLES:], start_s=2 * SAMPLES * INTERVAL_S)
    assert found(LIC1=excerpts_of(whole, ORIGIN_S), FIC2=last) == [("LIC1", "FIC2")]
    other_day = loop(sp=longer[-SAMPLES:], start_s=86_400.0)
    assert found(LIC1=excerpts_of(whole, ORIGIN_S), FIC2=other_day) == []


def test_loops_of_other_sampling_are_not_compared():
    moved = wandering(1)
    assert found(LIC1=loop(op=moved), FIC2=loop(sp=moved, every=12)) == []


def test_one_op_may_move_several_set_points_and_a_cascade_may_have_three_loops():
    first, second = wandering(1), wandering(2)
    assert found(
        AIC1=loop(op=first), TIC2=loop(op=second, sp=first), FIC3=loop(sp=second), FIC4=loop(sp=2.0 * second)
    ) == [("AIC1", "TIC2"), ("TIC2", "FIC3"), ("TIC2", "FIC4")]


def test_of_two_outer_loops_the_nearer_one_moves_the_set_point():
    moved = wandering(1)
    near = moved + 0.3 * measured(5)
    assert found(LIC1=loop(op=near), LIC2=loop(op=moved), FIC3=loop(sp=moved)) == [("LIC2", "FIC3")]


def test_a_swing_a_drift_or_a_load_in_common_makes_no_cascade():
    load = np.convolve(wandering(9, memory=0.999), np.exp(-np.arange(100) / 20.0) / 20.0, mode="same")
    for shared in (np.sin(TIME_S / 60.0), np.sin(TIME_S / 300.0), 0.001 * TIME_S, load):
        swinging = {f"L{k}": loop(op=shared + measured(k), sp=shared + measured(50 + k)) for k in range(9)}
        assert found(**swinging) == []


def test_single_steps_at_one_time_make_no_cascade():
    step = np.where(np.arange(SAMPLES) < 1400, 0.0, 5.0)
    two = step + np.where(np.arange(SAMPLES) < 2200, 0.0, 3.0)
    assert found(LIC1=loop(op=step), FIC2=loop(sp=step), LIC3=loop(op=two), FIC4=loop(sp=two)) == []


def test_loops_of_one_recipe_make_no_cascade():
    """Both set points are one profile, and what is new in the OP of either comes with it."""
    rng = np.random.default_rng(3)
    profile = np.repeat(rng.standard_normal(SAMPLES // 100), 100)
    answer = profile + 0.1 * wandering(4, memory=0.5)
    assert found(TIC1=loop(op=answer, sp=profile), TIC2=loop(op=wandering(5), sp=2.0 * profile)) == []


def test_a_loop_does_not_move_its_own_set_point():
    moved = wandering(1)
    assert found(LIC1=loop(op=moved, sp=moved)) == []


def test_strangers_make_no_cascade():
    assert found(**{f"L{k}": loop(op=wandering(k), sp=wandering(500 + k)) for k in range(60)}) == []
    assert cascades({}) == ()


def test_the_order_of_the_loops_makes_no_difference():
    moved = wandering(1)
    plant = {"LIC2": loop(op=moved), "LIC1": loop(op=moved.copy()), "FIC3": loop(sp=moved)}
    both = (Cascade("LIC1", "FIC3", 1.0), Cascade("LIC2", "FIC3", 1.0))
    assert cascades(plant) == cascades(dict(reversed(plant.items()))) == both


def stepping(seed, every=60, size=1.0):
    rng = np.random.default_rng(seed)
    return size * np.cumsum(np.repeat(rng.standard_normal(SAMPLES // every), every))


def test_an_outer_loop_that_executes_once_a_minute_is_found():
    moved = stepping(1, every=12)
    assert found(AIC1=loop(op=moved), TIC2=loop(op=wandering(2), sp=moved)) == [("AIC1", "TIC2")]


def test_one_kick_hides_no_cascade():
    moved = wandering(1)
    moved[1500:] += 60.0
    moved[700] += 300.0
    assert found(LIC1=loop(op=moved), FIC2=loop(sp=moved)) == [("LIC1", "FIC2")]


def test_a_trip_in_the_one_excerpt_that_two_loops_share_makes_no_cascade():
    for seed in range(10):
        trip = np.where(np.arange(SAMPLES) < 1480, 0.0, 8.0)
        op, sp = wandering(seed) + trip, wandering(100 + seed) + trip
        late = Recording("", TIME_S[1400:], np.zeros(SAMPLES - 1400), op[1400:])
        assert found(LIC1=excerpts_of(late, ORIGIN_S), FIC2=loop(sp=sp)) == []


def test_what_a_ratio_takes_from_a_pv_is_no_cascade():
    """What is new in PV is new in OP, by its proportional action."""
    rng, pv = np.random.default_rng(7), wandering(6)
    pv = pv + 0.3 * rng.standard_normal(SAMPLES)
    op = -0.8 * pv - 0.02 * np.cumsum(pv)
    assert found(FIC1=loop(op=op), FFIC2=loop(sp=1.7 * pv)) == []


def test_loops_of_one_recipe_of_many_steps_make_no_cascade():
    profile = stepping(3, every=30)
    answer = profile + 0.1 * measured(4)
    assert found(TIC1=loop(op=answer), TIC2=loop(sp=2.0 * profile)) == [("TIC1", "TIC2")]
    assert found(TIC1=loop(op=answer, sp=profile), TIC2=loop(sp=2.0 * profile)) == []


def test_a_set_point_that_both_have_from_elsewhere_makes_no_cascade():
    moved = wandering(1)
    assert found(TIC1=loop(op=moved, sp=moved), TIC2=loop(sp=moved)) == []


def test_stamps_that_are_early_or_late_and_intervals_that_are_a_little_off_make_no_difference():
    moved, rng = wandering(1), np.random.default_rng(2)
    for late in (0.3 * INTERVAL_S * rng.uniform(-1.0, 1.0, SAMPLES), 4e-5 * TIME_S):
        off = Recording("", TIME_S + late, np.zeros(SAMPLES), np.zeros(SAMPLES), moved)
        kept = excerpts_of(off, ORIGIN_S)
        assert kept is not None
        assert kept.interval_s == INTERVAL_S
        assert found(LIC1=loop(op=moved), FIC2=kept) == [("LIC1", "FIC2")]


def test_only_the_cascades_of_the_loops_that_are_asked_for_are_told():
    first, second, third = (wandering(seed) for seed in (1, 2, 3))
    plant = {"A1": loop(op=first), "B2": loop(op=second, sp=first), "C3": loop(sp=second)}
    plant |= {"D4": loop(op=third), "E5": loop(sp=third), "B9": loop(op=second + measured(8))}
    pairs = {asked: [(c.outer, c.inner) for c in cascades(plant, {asked})] for asked in plant}
    assert pairs["A1"] == [("A1", "B2")]
    assert pairs["B2"] == [("A1", "B2"), ("B2", "C3")]
    assert pairs["C3"] == [("B2", "C3")]
    assert pairs["B9"] == []
    assert pairs["E5"] == [("D4", "E5")]
    assert set(cascades(plant)) == {c for asked in plant for c in cascades(plant, {asked})}


def test_no_op_is_looked_at_beside_a_set_point_that_stands(monkeypatch):
    """Of a plant that takes seconds, whenever one loop is audited."""
    plant = {f"L{k}": loop(op=wandering(k)) for k in range(6)}
    plant |= {"M1": loop(sp=wandering(11)), "M2": loop(sp=wandering(12))}
    looked_at = []
    monkeypatch.setattr(module, "innovations", lambda *told: looked_at.append(told) or innovations(*told))
    assert cascades(plant, {"L0"}) == ()
    assert len(looked_at) == 3  # the OP of L0 and two set points


def test_as_many_set_points_as_are_compared_at_once_make_no_difference(monkeypatch):
    plant = {}
    for k in range(9):
        moved = wandering(k)
        plant |= {f"L{k}": loop(op=moved, start_s=3e4 * (k % 2)), f"F{k}": loop(sp=moved, start_s=3e4 * (k % 2))}
    whole = cascades(plant)
    assert [(c.outer, c.inner) for c in whole] == [(f"L{k}", f"F{k}") for k in range(9)]
    monkeypatch.setattr("app.engine.plant_wide.cascades.AT_ONCE", 2)
    assert cascades(plant) == whole


def test_an_inner_loop_that_was_out_of_cascade_for_a_while_is_found():
    moved, k = wandering(1), np.arange(SAMPLES)
    out = (k >= 1400) & (k < 1700)
    assert found(LIC1=loop(op=moved), FIC2=loop(sp=np.where(out, moved[1400], moved))) == [("LIC1", "FIC2")]
    assert found(LIC1=loop(op=moved), FIC2=loop(sp=np.where(k < 1500, 40.0, moved))) == [("LIC1", "FIC2")]


def test_two_that_are_one_line_in_few_excerpts_make_no_cascade():
    moved, k = wandering(1), np.arange(SAMPLES)
    sp = np.where(k < 1500, wandering(2), moved)
    assert found(LIC1=loop(op=moved), FIC2=loop(sp=sp)) == []


def test_a_set_point_two_scans_late_is_found():
    moved = wandering(1)
    assert found(LIC1=loop(op=moved), FIC2=loop(sp=np.roll(moved, 2))) == [("LIC1", "FIC2")]


def test_two_ops_that_are_as_near_are_both_outer():
    moved = wandering(1)
    almost = moved + 0.02 * wandering(5, memory=0.0)
    plant = {"LIC1": loop(op=moved), "LIC1B": loop(op=almost), "FIC2": loop(sp=moved)}
    alike = {one.outer: one.alike for one in cascades(plant)}
    assert set(alike) == {"LIC1", "LIC1B"}
    assert 0.999 < alike["LIC1B"] < alike["LIC1"]


def test_what_is_alike_in_its_largest_samples_alone_is_no_cascade():
    kicks, in_one_excerpt = np.zeros(SAMPLES), np.zeros(SAMPLES)
    kicks[[1160, 1180, 1200]] = (150.0, -130.0, 170.0)
    in_one_excerpt[1152:1216] = 1.0
    own, other = 10.0 * measured(1), 10.0 * measured(2)
    assert found(LIC1=loop(op=in_one_excerpt * own + kicks), FIC2=loop(sp=in_one_excerpt * other + kicks)) == []
    assert found(LIC1=loop(op=in_one_excerpt * own + kicks), FIC2=loop(sp=in_one_excerpt * own + kicks)) != []


@pytest.mark.parametrize("scale", [1e-300, 1e-12, 1e90, 1e300])
def test_the_size_of_the_numbers_makes_no_difference(scale):
    moved = wandering(1)
    plant = {"LIC1": loop(op=scale * moved, sp=scale * wandering(3)), "FIC2": loop(sp=scale * moved)}
    assert [(one.outer, one.inner) for one in cascades(plant)] == [("LIC1", "FIC2")]
