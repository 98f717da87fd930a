"""The verdict: right on textbook loops, the same in any unit, never surer than its data."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from app.engine.corroborate import Corroboration
from app.engine.features import NAMES
from app.engine.fitness import assess, with_cycles
from app.engine.judgement import Judgement
from app.engine.oscillation import detect
from app.engine.recording import Recording
from app.engine.reference.published_rule import READINGS
from app.engine.rivals import Rival
from app.engine.simulate import (
    LoopSpec,
    Pid,
    Signal,
    TwoParameterValve,
    Wave,
    first_order,
    integrator,
    keep,
    rebuild,
    simulate_loop,
)
from app.engine.verdict.config import VerdictConfig
from app.engine.verdict.judging import conclude, judge
from app.engine.verdict.reasons import methods_reason
from app.engine.verdict.shape_model import fitted_model
from app.engine.verdict.weighing import weigh
from app.engine.verdict.wording import WORDED, is_spoken, sentence_without_value


@cache
def simulated(seed: int = 1, length_s: float = 1200.0, **changes) -> Recording:
    spec = LoopSpec(
        plant=first_order(1.0, 3.0, 1.0),
        controller=Pid(Kc=0.3, Ti_s=6.0),
        noise=Signal(noise_sd=0.03),
        settle_s=300.0,
        **changes,
    )
    return simulate_loop(spec, length_s, 1.0, seed=seed).recording("loop")


@cache
def sticky(length_s: float = 1200.0) -> Recording:
    return simulated(length_s=length_s, valve=TwoParameterValve(2.0, 2.0), upset=Signal(value=3.0))


@cache
def shaken() -> Recording:
    return simulated(upset=Signal(noise_sd=1.0, noise_tau_s=20.0))


@cache
def verdict(recording: Recording, config: VerdictConfig | None = None) -> Judgement:
    fitness = assess(recording)
    oscillation = detect(fitness.record)
    return judge(fitness.record, oscillation, with_cycles(fitness, oscillation), config=config)


def test_a_textbook_limit_cycle_is_sticky_and_reliable():
    said = verdict(sticky())
    assert (said.verdict, said.reliability, said.likely_cause) == ("stiction", "reliable", "stiction")
    assert said.stiction_probability > 0.8


@pytest.mark.parametrize(("make", "for_stiction"), [(sticky, True), (shaken, False)])
def test_a_shape_tells_as_data_which_side_it_speaks_for(make, for_stiction):
    told = [reason.measured for reason in verdict(make()).reasons if reason.code.startswith("shape_")]
    assert [measured.passed for measured in told] == [for_stiction] * 3


def test_what_the_published_methods_say_is_kept_beside_their_sentence():
    said = verdict(sticky())
    assert methods_reason(said.methods) == said.reasons[-1]
    assert any(method.applies and method.says == "stiction" for method in said.methods)


def test_a_loop_shaken_by_its_load_is_not_sticky():
    said = verdict(shaken())
    assert said.verdict == "no_stiction"
    assert said.stiction_probability < 0.3


def test_a_sine_from_outside_is_not_called_sticky_and_reliable():
    outside = simulated(upset=Signal(waves=(Wave(2.0, 60.0),), noise_sd=0.1, noise_tau_s=30.0))
    said = verdict(outside)
    assert (said.verdict, said.reliability) != ("stiction", "reliable")


@pytest.mark.parametrize("unit", [(-1.0, 0.0, 1.0, 0.0), (1.8, 32.0, -0.16, 20.0), (1e-4, 300.0, 1e3, 0.0)])
@pytest.mark.parametrize("make", [sticky, shaken])
def test_no_unit_changes_what_is_said(make, unit):
    pv_scale, pv_offset, op_scale, op_offset = unit
    loop = make()
    other = Recording("loop", loop.time_s * 60.0, loop.pv * pv_scale + pv_offset, loop.op * op_scale + op_offset)
    one, two = verdict(loop), verdict(other)
    assert two.stiction_probability == pytest.approx(one.stiction_probability, abs=1e-5)
    assert (two.verdict, two.reliability, two.likely_cause) == (one.verdict, one.reliability, one.likely_cause)
    assert [r.code for r in two.reasons] == [r.code for r in one.reasons]


def test_other_columns_change_nothing():
    loop = sticky()
    more = Recording(loop.name, loop.time_s, loop.pv, loop.op, others={"TI100": np.cumsum(loop.pv)})
    assert verdict(more) == verdict(Recording(loop.name, loop.time_s, loop.pv, loop.op))


def test_reasons_are_sentences_with_codes_of_their_own():
    for make in (sticky, shaken):
        reasons = verdict(make()).reasons
        assert len({r.code for r in reasons}) == len(reasons)
        assert all(len(r.text) > 10 and "{" not in r.text for r in reasons)
        assert "published_methods" in {r.code for r in reasons}


@pytest.mark.parametrize("kind", ["swinging_door", "exception"])
@pytest.mark.parametrize("band", [0.05, 0.2, 0.5])
@pytest.mark.parametrize("period_s", [25.0, 60.0, 150.0])
def test_no_historian_makes_a_sine_sticky_and_reliable(kind, band, period_s):
    loop = simulated(upset=Signal(waves=(Wave(2.0, period_s),)))

    def stored(x):
        return rebuild(loop.time_s, x, keep(loop.time_s, x, band * float(np.std(x)), kind), kind)

    said = verdict(Recording("compressed", loop.time_s, stored(loop.pv), stored(loop.op)))
    assert (said.verdict, said.reliability) != ("stiction", "reliable")


def test_a_shape_of_a_few_stored_points_is_the_historians():
    loop = sticky()

    def stored(x):
        return rebuild(loop.time_s, x, keep(loop.time_s, x, 1.5 * float(np.std(x)), "exception"), "exception")

    said = verdict(Recording("compressed", loop.time_s, stored(loop.pv), stored(loop.op)))
    assert said.reliability == "not_reliable"
    assert "stored_points" in {reason.code for reason in said.reasons}


def strangers() -> list[Recording]:
    """PV and OP that have nothing to do with each other: noise, wandering, and two limit cycles of sticky valves."""
    noise, walk = np.random.default_rng(8).normal(size=(2, 1500))
    other = simulated(51, valve=TwoParameterValve(3.0, 1.0), upset=Signal(value=-2.5, noise_sd=0.05, noise_tau_s=30.0))
    return [
        Recording("noise", np.arange(1500.0), noise, np.cumsum(walk)),
        Recording("walks", np.arange(1500.0), np.cumsum(noise), np.cumsum(walk)),
        Recording("cycles", other.time_s, sticky().pv, other.op),
    ]


@pytest.mark.parametrize("loop", strangers(), ids=lambda loop: loop.name)
def test_of_strangers_nothing_is_said_reliably(loop):
    said = verdict(loop)
    assert said.reliability == "not_reliable"
    assert "uncoupled" in {reason.code for reason in said.reasons}


@pytest.mark.parametrize("controller", [Pid(Kc=0.1, Ti_s=6.0), Pid(Kc=0.05, Ti_s=3.0)])
def test_a_weak_coupling_that_is_no_chance_clears_a_valve_reliably(controller):
    spec = LoopSpec(
        plant=first_order(1.0, 3.0, 1.0),
        controller=controller,
        noise=Signal(noise_sd=0.5),
        upset=Signal(noise_sd=1.0, noise_tau_s=5.0),
        settle_s=300.0,
    )
    loop = simulate_loop(spec, 1500.0, 1.0, seed=3).recording("loop")
    features = weigh(assess(loop).record, detect(assess(loop).record)).features
    assert max(features.named("ccf_odd"), features.named("ccf_even")) < 0.4
    said = verdict(loop)
    assert (said.verdict, said.reliability) == ("no_stiction", "reliable")


def test_mostly_in_manual_makes_nothing_reliable():
    loop = sticky()
    mode = np.arange(len(loop.pv)) < 500
    said = verdict(Recording("manual", loop.time_s, loop.pv, loop.op, automatic=mode))
    assert (said.reliability, "mode_share" in {reason.code for reason in said.reasons}) == ("not_reliable", True)


@pytest.mark.parametrize("make", [sticky, shaken])
def test_few_cycles_make_nothing_reliable(make):
    loop = make()
    period = int(detect(assess(loop).record).samples_per_cycle)
    part = slice(0, 4 * period)
    said = verdict(Recording("short", loop.time_s[part], loop.pv[part], loop.op[part]))
    assert said.reliability == "not_reliable"


def test_coarse_sensors_take_the_reliability_of_stiction():
    loop = sticky()
    step = np.ptp(loop.pv) / 3
    said = verdict(Recording("coarse", loop.time_s, np.round(loop.pv / step) * step, loop.op))
    assert (said.verdict, said.reliability) != ("stiction", "reliable")


def test_near_one_half_nothing_is_decided():
    said = verdict(sticky(), VerdictConfig(undecided_within=0.51))
    assert said.verdict == "inconclusive"


def test_the_weighing_shows_what_it_came_from():
    fitness = assess(sticky())
    weighing = weigh(fitness.record, detect(fitness.record))
    assert weighing.contributions.shape == (len(NAMES),)
    assert weighing.contributions.sum() > 0
    standing = [rival.stands_out for rival in weighing.rivals]
    assert standing == sorted(standing, reverse=True)


def test_fitted_numbers_fit_the_features():
    model = fitted_model()
    assert model.centre.shape == model.scale.shape == model.slope.shape == (len(NAMES),)
    assert model.hidden.shape[:2] == (len(model.out), len(NAMES))
    at_centre = model.log_odds(np.array([model.centre, model.centre]))
    assert at_centre.shape == (2,)
    assert at_centre[0] == at_centre[1]


def test_wording_speaks_of_features_only():
    assert set(NAMES) >= WORDED


@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0])
@pytest.mark.parametrize(("spread", "disagree"), [(0.8, False), (1.2, True)])
def test_windows_disagree_where_their_spread_reaches_the_other_side_whatever_the_scale(scale, spread, disagree):
    fitness = assess(sticky())
    oscillation = detect(fitness.record)
    weighing = replace(weigh(fitness.record, oscillation), log_odds=2.5 * scale, window_spread=2.5 * scale * spread)
    said = conclude(weighing, oscillation, with_cycles(fitness, oscillation), VerdictConfig(), fitted_model())
    assert ("windows_disagree" in {reason.code for reason in said.reasons}) is disagree


@pytest.mark.parametrize(("probability", "reliable"), [(0.62, True), (0.55, False)])
def test_a_cycle_that_is_shown_to_be_the_valves_makes_a_likely_verdict_clear(probability, reliable):
    fitness = assess(sticky())
    oscillation = detect(fitness.record)
    weighing = replace(weigh(fitness.record, oscillation), log_odds=float(np.log(probability / (1.0 - probability))))
    said = conclude(weighing, oscillation, with_cycles(fitness, oscillation), VerdictConfig(), fitted_model())
    codes = {reason.code for reason in said.reasons}
    assert said.verdict == "stiction"
    assert ("evidence_not_clear" in codes) is not reliable
    assert ("own_cycle" in codes) is reliable


def one_signal() -> list[Recording]:
    loop = shaken()
    return [
        Recording("copy", loop.time_s, loop.op, loop.op),
        Recording("scaled", loop.time_s, np.round(7.0 - 2.0 * loop.op, 6), loop.op),
    ]


@pytest.mark.parametrize("loop", one_signal(), ids=lambda loop: loop.name)
def test_one_signal_under_two_tags_is_never_judged_reliably(loop):
    said = verdict(loop)
    assert said.reliability == "not_reliable"
    assert "same_signal" in {reason.code for reason in said.reasons}


@pytest.mark.parametrize(("shapes", "cleared"), [(2.0, False), (-2.0, True)])
def test_a_rival_makes_stiction_less_likely_but_clears_no_valve_by_itself(shapes, cleared):
    fitness = assess(shaken())
    oscillation = detect(fitness.record)
    rival = Rival("saturated_op", 1.0, "OP was at its limit for half of the time", counts=4.0)
    weighing = replace(weigh(fitness.record, oscillation), log_odds=shapes - rival.counts, rivals=(rival,))
    said = conclude(weighing, oscillation, with_cycles(fitness, oscillation), VerdictConfig(), fitted_model())
    assert said.verdict == "no_stiction"
    assert ("not_cleared" in {reason.code for reason in said.reasons}) is not cleared


def test_a_rival_does_not_make_windows_agree():
    fitness = assess(shaken())
    oscillation = detect(fitness.record)
    rival = Rival("saturated_op", 1.0, "OP was at its limit for half of the time", counts=4.0)
    weighing = replace(
        weigh(fitness.record, oscillation), log_odds=-2.0 - rival.counts, window_spread=2.5, rivals=(rival,)
    )
    said = conclude(weighing, oscillation, with_cycles(fitness, oscillation), VerdictConfig(), fitted_model())
    assert "windows_disagree" in {reason.code for reason in said.reasons}


def noisy_wave(seed: int) -> Recording:
    """A healthy loop under a sine from outside, with a transmitter whose noise hides that PV is one."""
    rng = np.random.default_rng(seed)
    tau_s = float(rng.uniform(3.0, 10.0))
    period_s = tau_s * float(rng.uniform(6.0, 15.0))
    spec = LoopSpec(
        plant=first_order(1.0, tau_s, 0.3 * tau_s),
        controller=Pid(Kc=float(rng.uniform(0.02, 0.3)), Ti_s=tau_s * float(rng.uniform(0.2, 1.0))),
        upset=Signal(waves=(Wave(1.0, period_s),), noise_sd=0.05, noise_tau_s=tau_s),
        noise=Signal(noise_sd=0.2),
        settle_s=10.0 * period_s,
    )
    return simulate_loop(spec, 20.0 * period_s, period_s / 40.0, seed=seed).recording("wave")


def test_noise_does_not_make_a_sine_from_outside_sticky_and_reliable():
    said = [verdict(noisy_wave(seed)) for seed in (*range(20), 133, 249, 318, 334)]
    assert not [s for s in said if (s.verdict, s.reliability) == ("stiction", "reliable")]


def followed_level(seed: int) -> Recording:
    """A healthy level loop whose set point swings: PV is the set point's, OP its slope."""
    rng = np.random.default_rng(seed)
    period_s = float(rng.uniform(300.0, 1200.0))
    spec = LoopSpec(
        plant=integrator(0.05, 2.0),
        controller=Pid(Kc=2.0, Ti_s=60.0),
        sp=Signal(waves=(Wave(5.0, period_s, "triangle"),)),
        load=Signal(noise_sd=0.2, noise_tau_s=60.0),
        noise=Signal(noise_sd=float(rng.uniform(0.01, 0.2))),
        settle_s=period_s,
    )
    return simulate_loop(spec, 15.0 * period_s, period_s / 60.0, seed=seed).recording("level")


def test_a_level_that_follows_its_set_point_is_not_sticky_and_reliable():
    said = [verdict(followed_level(seed)) for seed in range(12)]
    assert not [s for s in said if (s.verdict, s.reliability) == ("stiction", "reliable")]


@pytest.mark.parametrize(
    "settings",
    [
        {"sure_stiction_from": 0.6},
        {"reliable_own_cycle_from": 0.7},
        {"reliable_own_cycle_from": 0.5},
        {"reliable_no_stiction_to": 0.7},
        {"reliable_no_stiction_to": -0.1},
        {"reliable_stiction_from": float("nan")},
    ],
)
def test_probabilities_of_a_reliable_verdict_that_are_out_of_order_are_refused(settings):
    with pytest.raises(ValueError, match="reliable_own_cycle_from <= reliable_stiction_from <= sure_stiction_from"):
        VerdictConfig(**settings)
    assert VerdictConfig(sure_stiction_from=0.65).reliable_stiction_from == 0.65


def test_no_two_features_have_one_sentence():
    for side in (True, False):
        told = [sentence_without_value(name, side) for name in sorted(WORDED) if is_spoken(name, side)]
        assert len(told) == len(set(told))


def vote(method: str, says: str | None, applies: bool = True) -> Corroboration:
    return Corroboration(method, applies, "", 1.0 if applies else None, 0.5, says, "", "", None)


@pytest.mark.parametrize(
    ("votes", "told"),
    [
        ([], "none of the published methods applies to this record"),
        ([vote("a", None, applies=False)], "none of the published methods applies to this record"),
        (
            [vote("area_ratio", "stiction"), vote("b", None, applies=False)],
            "the one published method that applies says stiction (area ratio); it does not affect the verdict",
        ),
        (
            [vote("cross_correlation", "no_stiction"), vote("b", "no_stiction")],
            "of 2 published methods that apply, none says stiction, 2 say no stiction (cross correlation, b); they do "
            "not affect the verdict",
        ),
        (
            [vote("a", "stiction"), vote("b", "no_stiction"), vote("c", None)],
            "of 3 published methods that apply, 1 says stiction (a), 1 says no stiction (b), 1 says neither (c); they "
            "do not affect the verdict",
        ),
    ],
)
def test_the_votes_of_the_published_methods_are_a_sentence(votes, told):
    assert methods_reason(tuple(votes)).text == told


def test_what_the_published_rule_reads_cannot_be_taken_for_the_verdict():
    for reading in READINGS.values():
        assert "the verdict is" not in reading
        assert "it would" in reading
