"""Long records are judged stretch by stretch: what loads and shutdowns do over days says nothing of a valve."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.audit import Audit, audit
from app.engine.oscillation import detect
from app.engine.preparation import prepare
from app.engine.recording import Recording, UniformRecord
from app.engine.simulate import LoopSpec, Pid, Signal, TwoParameterValve, first_order, simulate_loop
from app.engine.stretches import LONG_SAMPLES, cycle_of_parts, speaking_stretch

N, TS = 12_000, 10.0
FREE = LoopSpec(
    plant=first_order(1.0, 25.0, 8.0),
    controller=Pid(1.2, 25.0),
    load=Signal(value=2.0, noise_sd=2.5, noise_tau_s=6000.0),
    noise=Signal(noise_sd=0.1),
    pv_start=50.0,
    op_start=50.0,
    op_limits=(0.0, 100.0),
    step_s=2.0,
    settle_s=3600.0,
)
STICKY = replace(FREE, valve=TwoParameterValve(8.0, 2.0))


def recorded(spec: LoopSpec, samples: int = N) -> Recording:
    made = simulate_loop(spec, samples * TS, TS, 7).recording("loop")
    return replace(made, pv=np.round(made.pv, 2), op=np.round(made.op, 2), op_range=None)


@pytest.fixture(scope="module")
def sticky() -> Recording:
    return recorded(STICKY)


def uniform(recording: Recording) -> UniformRecord:
    return UniformRecord(TS, recording.pv, recording.op, None, np.zeros(recording.samples, dtype=bool))


def said(found: Audit) -> tuple[str, str]:
    return found.judgement.verdict, found.judgement.reliability


def test_a_valve_that_sticks_under_a_load_that_wanders_for_a_day_is_found(sticky):
    whole, per_cycle = detect(uniform(sticky)), cycle_of_parts(uniform(sticky))
    assert 200.0 < per_cycle * TS < 800.0
    assert whole.samples_per_cycle > 2.0 * per_cycle  # not the valve's
    found = audit(sticky)
    assert said(found) == ("stiction", "reliable")
    assert "stretches" in {reason.code for reason in found.judgement.reasons}
    assert found.oscillation.period_s < 800.0


def test_a_healthy_valve_under_the_same_load_is_cleared():
    assert audit(recorded(FREE)).judgement.verdict == "no_stiction"


def test_all_that_was_looked_at_is_the_window(sticky):
    found = audit(sticky)
    assert found.window.samples == N
    assert found.identified.samples == found.fitness.audited.samples < N
    whole = found.fitness.speaks_for
    assert (whole.record.samples, whole.judged) == (N, 7)
    assert not whole.contested


def test_hours_of_a_shutdown_say_nothing(sticky):
    stands = slice(5000, 8600)
    op, pv = sticky.op.copy(), sticky.pv.copy()
    op[stands], pv[stands] = 0.0, 0.1
    shut = replace(sticky, op=op, pv=pv)
    assert said(audit(shut)) == ("stiction", "reliable")
    assert prepare(shut).fitness.speaks_for.judged < 7


def test_a_valve_that_sticks_for_a_third_of_the_record_is_neither_cleared_nor_accused_reliably(sticky):
    free = recorded(FREE)
    part = slice(3000, 7000)
    op, pv = free.op.copy(), free.pv.copy()
    op[part], pv[part] = sticky.op[part], sticky.pv[part]
    found = audit(replace(free, op=op, pv=pv))
    assert found.judgement.reliability == "not_reliable"
    assert "short_lived_stiction" in {reason.code for reason in found.judgement.reasons}


@pytest.mark.parametrize("share", [0.2, 0.3])
def test_a_valve_that_sticks_up_to_the_end_is_not_cleared(sticky, share):
    free, since = recorded(FREE), round((1.0 - share) * N)
    op, pv = free.op.copy(), free.pv.copy()
    op[since:], pv[since:] = sticky.op[since:], sticky.pv[since:]
    found = audit(replace(free, op=op, pv=pv))
    assert said(found) == ("stiction", "not_reliable")
    codes = [reason.code for reason in found.judgement.reasons]
    assert codes[0] == "stiction_began"
    assert not {"stretches", "stretches_disagree", "disturbance"} & set(codes)
    assert found.stiction_size is None or not found.stiction_size.identifiable


def test_a_pv_that_died_lately_comes_before_what_the_valve_did(sticky):
    pv = sticky.pv.copy()
    pv[-5100:] = pv[-5100]
    dead = audit(replace(sticky, pv=pv))
    assert dead.judgement.verdict == "not_auditable"
    assert dead.judgement.likely_cause == "stuck_valve_or_dead_transmitter"
    assert [reason.code for reason in dead.judgement.reasons] == ["pv_flat"]


def test_a_unit_that_stands_still_at_the_end_is_judged_by_what_was_before(sticky):
    op, pv = sticky.op.copy(), sticky.pv.copy()
    op[-3000:], pv[-3000:] = 0.0, 0.1
    found = audit(replace(sticky, op=op, pv=pv))
    assert said(found) == ("stiction", "reliable")
    (text,) = [reason.text for reason in found.judgement.reasons if reason.code == "stretches"]
    assert text.endswith("more are left out, because PV or OP stood still")


def test_records_that_are_not_long_are_judged_whole(sticky):
    short = sticky.part(slice(0, LONG_SAMPLES))
    assert prepare(short).fitness.speaks_for is None
    assert prepare(short).fitness.audited.samples == LONG_SAMPLES


def test_noise_has_no_scale_and_is_judged_whole():
    rng = np.random.default_rng(3)
    record = UniformRecord(1.0, rng.standard_normal(N), np.cumsum(rng.standard_normal(N)), None, np.zeros(N, bool))
    assert cycle_of_parts(record) is None
    assert speaking_stretch(record, replace(detect(record), regularity=0.5)) is None


@pytest.mark.parametrize("change", ["scale", "sign of PV", "sign of OP", "time"])
def test_units_change_nothing(sticky, change):
    other = {
        "scale": lambda: replace(sticky, pv=1e3 * sticky.pv + 7.0, op=0.01 * sticky.op - 3.0),
        "sign of PV": lambda: replace(sticky, pv=-sticky.pv),
        "sign of OP": lambda: replace(sticky, op=-sticky.op),
        "time": lambda: replace(sticky, time_s=sticky.time_s / 60.0),
    }[change]()
    one, two = audit(sticky).judgement, audit(other).judgement
    assert (one.verdict, one.reliability) == (two.verdict, two.reliability)
    assert one.stiction_probability == pytest.approx(two.stiction_probability, abs=1e-6)
