"""Long records are judged stretch by stretch: what loads and shutdowns do over days says nothing of a valve."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.audit import Audit
from app.engine.judged import identified_part
from app.engine.long_records.stretches import LONG_SAMPLES, newest, newest_moving, scale_of, speaking_stretch
from app.engine.oscillation import detect
from app.engine.preparation import prepare
from app.engine.recording import Recording, UniformRecord
from app.engine.simulate import Pid, Signal, TwoParameterValve
from tests.audited import audited
from tests.engine.wandering import FREE, STICKY, TS, recorded

N = 12_000


@pytest.fixture(scope="module")
def sticky() -> Recording:
    return recorded(STICKY, N)


def uniform(recording: Recording) -> UniformRecord:
    return UniformRecord(TS, recording.pv, recording.op, None, np.zeros(recording.samples, dtype=bool))


def said(found: Audit) -> tuple[str, str]:
    return found.judgement.verdict, found.judgement.reliability


def test_a_valve_that_sticks_under_a_load_that_wanders_for_a_day_is_found(sticky):
    whole = detect(uniform(sticky))
    scale = scale_of(uniform(sticky), whole)
    assert not scale.quiet
    assert 200.0 < scale.per_cycle * TS < 800.0
    assert whole.samples_per_cycle > 2.0 * scale.per_cycle  # not the valve's
    found = audited(sticky)
    assert said(found) == ("stiction", "reliable")
    assert "stretches" in {reason.code for reason in found.judgement.reasons}
    assert found.oscillation.period_s < 800.0


def test_a_healthy_valve_under_the_same_load_is_cleared():
    assert audited(recorded(FREE, N)).judgement.verdict == "no_stiction"


def test_all_that_was_looked_at_is_the_window(sticky):
    found = audited(sticky)
    assert found.window.samples == N
    assert found.identified.samples == found.fitness.audited.samples < N
    whole = found.fitness.speaks_for
    assert (whole.record.samples, whole.judged) == (N, 7)
    assert not whole.contested


@pytest.mark.parametrize("stands", [slice(5000, 8600), slice(4000, 9500), slice(0, 5500)])
def test_hours_of_a_shutdown_say_nothing(sticky, stands):
    op, pv = sticky.op.copy(), sticky.pv.copy()
    op[stands], pv[stands] = 0.0, 0.1
    shut = replace(sticky, op=op, pv=pv)
    assert said(audited(shut)) == ("stiction", "reliable")
    whole = prepare(shut).fitness.speaks_for
    assert whole.judged > 4
    assert whole.standing > 0


def test_a_valve_that_sticks_for_a_third_of_the_record_is_neither_cleared_nor_accused_reliably(sticky):
    free = recorded(FREE, N)
    part = slice(3000, 7000)
    op, pv = free.op.copy(), free.pv.copy()
    op[part], pv[part] = sticky.op[part], sticky.pv[part]
    found = audited(replace(free, op=op, pv=pv))
    assert found.judgement.reliability == "not_reliable"
    assert "short_lived_stiction" in {reason.code for reason in found.judgement.reasons}


@pytest.mark.parametrize("share", [0.2, 0.3])
def test_a_valve_that_sticks_up_to_the_end_is_not_cleared(sticky, share):
    free, since = recorded(FREE, N), round((1.0 - share) * N)
    op, pv = free.op.copy(), free.pv.copy()
    op[since:], pv[since:] = sticky.op[since:], sticky.pv[since:]
    found = audited(replace(free, op=op, pv=pv))
    assert said(found) == ("stiction", "not_reliable")
    codes = [reason.code for reason in found.judgement.reasons]
    assert codes[0] == "stiction_began"
    assert not {"stretches", "stretches_disagree", "disturbance"} & set(codes)
    assert found.stiction_size is None or not found.stiction_size.identifiable


def test_a_pv_that_died_lately_comes_before_what_the_valve_did(sticky):
    pv = sticky.pv.copy()
    pv[-5100:] = pv[-5100]
    dead = audited(replace(sticky, pv=pv))
    assert dead.judgement.verdict == "inconclusive"
    assert dead.judgement.likely_cause == "stuck_valve_or_dead_transmitter"
    assert [reason.code for reason in dead.judgement.reasons] == ["pv_stands", "prior_only", "pv_flat"]


@pytest.mark.parametrize("hours", [0.5, 2.0, 8.0, 25.0])
def test_a_healthy_loop_whose_pv_died_lately_is_not_cleared(hours):
    free = recorded(FREE, N)
    since = N - round(3600.0 * hours / TS)
    pv = free.pv.copy()
    pv[since:] = pv[since - 1]
    found = audited(replace(free, pv=pv))
    judgement = found.judgement
    assert (judgement.verdict, judgement.reliability) == ("inconclusive", "not_reliable")
    assert judgement.likely_cause == "stuck_valve_or_dead_transmitter"
    assert judgement.reasons[0].code == "pv_stands"
    assert f"for the last {hours:.2g} h" in judgement.reasons[0].text
    assert judgement.unanswered_since_s == pytest.approx((since - 1) * TS, abs=TS)


def test_of_a_pv_that_died_at_its_set_point_it_is_known_since_when():
    free = recorded(FREE, N)
    since, pv = N - round(8 * 3600.0 / TS), free.pv.copy()
    pv[since:] = pv[since - 1]
    sp = np.where(np.arange(N) < since, np.median(pv), pv[since])
    found = audited(replace(free, pv=pv, sp=sp))
    assert found.fitness.standstill is None
    assert found.judgement.likely_cause == "stuck_valve_or_dead_transmitter"
    assert found.judgement.unanswered_since_s == pytest.approx((since - 1) * TS, abs=TS)


def test_a_sticking_valve_whose_pv_died_lately_is_not_accused(sticky):
    pv = sticky.pv.copy()
    pv[-1500:] = pv[-1500]
    judgement = audited(replace(sticky, pv=pv)).judgement
    assert (judgement.verdict, judgement.likely_cause) == ("inconclusive", "stuck_valve_or_dead_transmitter")
    assert judgement.reasons[0].code == "pv_stands"


def test_a_pv_that_died_in_an_earlier_stretch_is_alive():
    free = recorded(FREE, N)
    pv, automatic = free.pv.copy(), np.ones(N, bool)
    pv[N - 3000 : N - 1000], automatic[N - 1000 : N - 600] = pv[N - 3000], False
    assert prepare(replace(free, pv=pv, automatic=automatic)).fitness.pv_dead_s is None


def test_where_all_is_calm_a_coarse_pv_may_stand():
    free = recorded(FREE, N)
    pv, op = free.pv.copy(), free.op.copy()
    pv[-1000:] = pv[-1000]
    op[-1000:] = op[-1000] + 0.02 * np.random.default_rng(1).normal(size=1000)
    assert prepare(replace(free, pv=pv, op=op)).fitness.pv_dead_s is None


@pytest.mark.parametrize("moves", ["OP stands", "a step by hand", "PV stood before", "PV moves again"])
def test_a_pv_that_stands_at_the_end_may_have_its_reason(moves):
    free = recorded(FREE, N)
    pv, op = free.pv.copy(), free.op.copy()
    pv[-1000:] = pv[-1000]
    if moves == "OP stands":
        op[-1000:] = op[-1000]
    if moves == "a step by hand":
        op[-1000:], op[-500:] = op[-1000], 0.0
    if moves == "PV stood before":
        pv[3000:3400] = pv[3000]
    if moves == "PV moves again":
        pv[-1] += 0.5
    assert prepare(replace(free, pv=pv, op=op)).fitness.pv_dead_s is None


def test_a_unit_that_stands_still_at_the_end_is_judged_by_what_was_before(sticky):
    op, pv = sticky.op.copy(), sticky.pv.copy()
    op[-3000:], pv[-3000:] = 0.0, 0.1
    found = audited(replace(sticky, op=op, pv=pv))
    assert said(found) == ("stiction", "reliable")
    (text,) = [reason.text for reason in found.judgement.reasons if reason.code == "stretches"]
    assert text.endswith("more were left out, because PV or OP stood still")


def test_records_that_are_not_long_are_judged_whole(sticky):
    short = sticky.part(slice(0, LONG_SAMPLES))
    assert prepare(short).fitness.speaks_for is None
    assert prepare(short).fitness.audited.samples == LONG_SAMPLES


def test_noise_has_no_scale_and_is_judged_whole():
    rng = np.random.default_rng(3)
    record = UniformRecord(1.0, rng.standard_normal(N), np.cumsum(rng.standard_normal(N)), None, np.zeros(N, bool))
    irregular = replace(detect(record), regularity=0.5)
    assert scale_of(record, irregular) is None
    assert speaking_stretch(record, irregular) is None


@pytest.mark.parametrize("change", ["scale", "sign of PV", "sign of OP", "time"])
def test_units_change_nothing(sticky, change):
    other = {
        "scale": lambda: replace(sticky, pv=1e3 * sticky.pv + 7.0, op=0.01 * sticky.op - 3.0),
        "sign of PV": lambda: replace(sticky, pv=-sticky.pv),
        "sign of OP": lambda: replace(sticky, op=-sticky.op),
        "time": lambda: replace(sticky, time_s=sticky.time_s / 60.0),
    }[change]()
    one, two = audited(sticky).judgement, audited(other).judgement
    assert (one.verdict, one.reliability) == (two.verdict, two.reliability)
    assert one.stiction_probability == pytest.approx(two.stiction_probability, abs=1e-6)


def test_newest():
    record = UniformRecord(2.0, np.arange(5.0), np.arange(5.0), None, np.zeros(5, dtype=bool), start_s=10.0)
    assert newest(record, 5) is record
    cut = newest(record, 2)
    assert (cut.pv.tolist(), cut.start_s, cut.sp) == ([3.0, 4.0], 16.0, None)


def standing(*moves: tuple[int, bool]) -> UniformRecord:
    """OP moves, or stands still, for so many samples each in turn."""
    rng = np.random.default_rng(3)
    op = np.concatenate([rng.normal(size=n) if moving else np.zeros(n) for n, moving in moves])
    return UniformRecord(1.0, rng.normal(size=len(op)), op, None, np.zeros(len(op), dtype=bool))


@pytest.mark.parametrize(
    ("moves", "taken"),
    [
        (((9000, True),), (4000, 9000)),
        (((9000, True), (700, False)), (4000, 9000)),  # shut down up to now
        (((9000, True), (700, False), (1000, True)), (4000, 9000)),  # too little since
        (((9000, True), (700, False), (2600, True)), (9700, 12300)),
        (((2000, True), (700, False), (1500, True), (3000, False)), (0, 2000)),  # the longest
        (((500, True), (6000, False), (500, True)), (2000, 7000)),  # hardly moves at all
        (((500, True), (6000, False)), (0, 1500)),  # the newest in which it moves
        (((6000, False),), (1000, 6000)),
        (((900, True), (700, False)), (0, 1600)),  # no more than asked for
    ],
)
def test_a_model_is_identified_where_the_loop_was_last_at_work(moves, taken):
    part = newest_moving(standing(*moves), 5000)
    assert (part.start_s, part.start_s + part.samples) == taken


def test_of_a_long_record_the_stretch_that_speaks_is_identified(sticky):
    part, found = identified_part(sticky), audited(sticky)
    assert (part.start_s, part.samples) == (found.identified.start_s, found.identified.samples)
    assert part.samples < LONG_SAMPLES
    assert identified_part(replace(sticky, pv=np.full(sticky.samples, np.nan))) is None


@pytest.fixture(scope="module")
def quiet() -> Recording:
    """A healthy flow that swings on no scale: what it does in the whole is the few cycles of its load."""
    return recorded(replace(FREE, controller=Pid(0.3, 60.0)), 9000, seed=10)


def test_a_healthy_loop_that_hardly_swings_is_cleared_on_the_scale_of_what_swings_faintly(quiet):
    whole = detect(uniform(quiet))
    assert scale_of(uniform(quiet), whole).quiet
    assert whole.cycles < 5.0
    found = audited(quiet)
    assert said(found) == ("no_stiction", "reliable")
    assert found.fitness.speaks_for.oscillation == whole
    assert found.oscillation.cycles >= 5.0


def test_without_a_set_point_a_loop_that_hardly_swings_is_judged_on_the_same_scale(quiet):
    bare = replace(quiet, sp=None)
    assert prepare(bare).fitness.speaks_for is not None
    assert said(audited(bare)) == ("no_stiction", "reliable")


def test_units_change_nothing_where_it_hardly_swings(quiet):
    other = replace(quiet, pv=-1e3 * quiet.pv + 7.0, op=0.01 * quiet.op, sp=5.0 * quiet.sp, time_s=quiet.time_s / 60.0)
    probabilities = [audited(one).judgement.stiction_probability for one in (quiet, other)]
    assert probabilities[0] == pytest.approx(probabilities[1], abs=1e-6)


@pytest.mark.parametrize("controller", [Pid(0.1, 3000.0), Pid(0.2, 2500.0)])
@pytest.mark.parametrize("valve", [FREE.valve, TwoParameterValve(30.0, 5.0)], ids=["healthy", "stands fast"])
def test_where_pv_goes_with_the_load_the_valve_is_not_cleared_on_a_faster_scale(controller, valve):
    """Under slow control a valve that stands fast and one that is free look alike: OP goes, and PV is not held."""
    record = recorded(replace(FREE, controller=controller, valve=valve), 9000, seed=10)
    assert scale_of(uniform(record), detect(uniform(record))).quiet
    assert prepare(record).fitness.speaks_for is None


def test_where_op_goes_nowhere_the_valve_is_not_cleared_on_a_faster_scale():
    load = Signal(noise_sd=0.02, noise_tau_s=6000.0)
    record = recorded(replace(FREE, controller=Pid(0.3, 60.0), load=load), 9000, seed=10)
    assert scale_of(uniform(record), detect(uniform(record))).quiet
    assert prepare(record).fitness.speaks_for is None
