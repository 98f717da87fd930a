"""The whole way of a recording: the same answer every time, whatever the units, and an answer for whatever is sent."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from app.engine import ENGINE_VERSION
from app.engine import audit as audit_module
from app.engine.audit import Audit, AuditConfig, audit
from app.engine.fitness import FitnessConfig
from app.engine.recording import Recording
from app.engine.reference.reliability import LadderConfig
from app.engine.simulate import LoopSpec, Pid, Signal, TwoParameterValve, first_order, keep, rebuild, simulate_loop
from app.errors import DataError

N = 500


def sticky_loop(n: int = N) -> Recording:
    """An integrating level under a valve that sticks: OP a triangle, PV driven by the square wave of the stem."""
    t = np.arange(n, dtype=float)
    stem = np.sign(np.sin(2 * np.pi * t / 50))
    rng = np.random.default_rng(5)
    pv = 40.0 + np.cumsum(stem) * 0.1 + 0.02 * rng.normal(size=n)
    op = 55.0 + 2.0 / np.pi * np.arcsin(np.sin(2 * np.pi * (t - 12.5) / 50)) + 0.005 * rng.normal(size=n)
    return Recording("level", t, pv, op, sp=np.full(n, 41.0))


@pytest.fixture(scope="module")
def answer() -> Audit:
    return audit(sticky_loop())


def said(result: Audit) -> tuple:
    """What must not depend on units."""
    judgement = result.judgement
    codes = tuple(reason.code for reason in judgement.reasons)
    return (judgement.verdict, judgement.reliability, codes, judgement.likely_cause, result.window)


def test_an_audit_has_an_answer_and_what_makes_it_again(answer):
    assert answer.judgement.verdict in ("stiction", "no_stiction")
    assert 0.0 < answer.judgement.stiction_probability < 1.0
    assert (answer.recording, answer.samples, answer.sampling_interval_s) == ("level", N, 1.0)
    assert (answer.window.start_s, answer.window.end_s, answer.window.samples) == (0.0, N - 1.0, N)
    assert answer.input_fingerprint == sticky_loop().fingerprint()
    assert answer.config_fingerprint == AuditConfig().fingerprint()
    assert answer.engine_version == ENGINE_VERSION


def test_probability_stands_on_the_side_of_the_verdict(answer):
    assert (answer.judgement.stiction_probability > 0.5) == (answer.judgement.verdict == "stiction")


def test_reasons_name_table_2_and_the_published_rule(answer):
    codes = [reason.code for reason in answer.judgement.reasons]
    published = [r for r in answer.judgement.reasons if r.code == f"yper_{answer.reference.reading}"]
    assert len(published) == 1
    assert published[0].text.startswith("published rule: ")
    assert len(codes) == len(set(codes))


def test_the_same_recording_gives_the_same_answer(answer):
    again = audit(sticky_loop())
    assert said(again) == said(answer)
    assert again.judgement == answer.judgement
    np.testing.assert_array_equal(again.reference.last.one.rmse, answer.reference.last.one.rmse)


@pytest.mark.parametrize(
    ("pv_scale", "pv_offset", "op_scale", "op_offset"),
    [
        (1.0, 0.0, -1.0, 0.0),
        (-1.0, 0.0, 1.0, 0.0),
        (1.8, 32.0, 0.16, 4.0),
        (1e-5, 0.0, 1e5, 1e5),
        (-3e6, 1e6, -0.01, 7.0),
    ],
)
def test_sign_scale_and_offset_change_no_verdict(answer, pv_scale, pv_offset, op_scale, op_offset):
    loop = sticky_loop()
    other = Recording("level", loop.time_s, loop.pv * pv_scale + pv_offset, loop.op * op_scale + op_offset)
    result = audit(other)
    assert said(result) == said(answer)
    assert result.judgement.stiction_probability == pytest.approx(answer.judgement.stiction_probability, abs=1e-6)
    assert result.stiction_band_pct_of_op_range == pytest.approx(answer.stiction_band_pct_of_op_range, rel=1e-6)
    assert result.reference.last.one.d_best == pytest.approx(answer.reference.last.one.d_best * abs(op_scale), rel=1e-6)


def test_the_start_of_time_changes_nothing(answer):
    loop = sticky_loop()
    later = audit(Recording("level", loop.time_s + 86400.0, loop.pv, loop.op, sp=loop.sp))
    assert later.judgement == answer.judgement
    assert later.window == answer.window


def test_inputs_are_not_changed():
    loop = sticky_loop()
    for signal in (loop.time_s, loop.pv, loop.op, loop.sp):
        signal.flags.writeable = False
    audit(loop)
    assert loop.fingerprint() == sticky_loop().fingerprint()


def test_an_audit_travels_between_processes(answer):
    copy = pickle.loads(pickle.dumps(answer))  # noqa: S301
    assert copy.judgement == answer.judgement


HOSTILE = {
    "empty": (np.zeros(0), np.zeros(0)),
    "one sample": (np.ones(1), np.ones(1)),
    "three samples": (np.arange(3.0), np.arange(3.0)),
    "all missing": (np.full(N, np.nan), np.full(N, np.nan)),
    "all infinite": (np.full(N, np.inf), np.arange(N, dtype=float)),
    "all huge": (np.linspace(1e300, 1e308, N), np.sin(np.arange(N))),
    "constant": (np.full(N, 3.3), np.full(N, 50.0)),
    "manual": (np.sin(np.arange(N) / 9), np.full(N, 50.0)),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_what_cannot_be_audited_is_answered_with_the_reason(name):
    pv, op = HOSTILE[name]
    result = audit(Recording(name, np.arange(len(pv), dtype=float), pv, op))
    assert result.judgement.verdict == "not_auditable"
    assert result.judgement.stiction_probability is None
    assert result.judgement.reliability == "not_reliable"
    assert result.judgement.reasons
    assert result.reference is None


@pytest.mark.parametrize(
    ("pv", "op", "codes", "cause"),
    [
        (
            np.full(N, 3.3),
            np.sin(np.arange(N) / 9),
            ["pv_does_not_answer", "pv_flat"],
            "stuck_valve_or_dead_transmitter",
        ),
        (np.sin(np.arange(N) / 9), np.full(N, 50.0), ["op_flat"], "controller_not_acting"),
    ],
)
def test_what_spoiled_the_record_is_the_likely_cause(pv, op, codes, cause):
    judgement = audit(Recording("x", np.arange(N, dtype=float), pv, op)).judgement
    assert judgement.verdict == "not_auditable"
    assert ([reason.code for reason in judgement.reasons], judgement.likely_cause) == (codes, cause)


ODD = {
    "spike": lambda pv, op: (np.where(np.arange(N) == 77, 1e9, pv), op),
    "two levels": (lambda pv, op: (np.where(pv > pv.mean(), 1.0, 0.0), op)),
    "PV is OP": lambda pv, op: (op, op),
    "PV on a line with OP": lambda pv, op: (7.0 - 3.0 * op, op),
    "white noise": lambda pv, op: (np.random.default_rng(1).normal(size=N), np.random.default_rng(2).normal(size=N)),
    "ramp": lambda pv, op: (np.linspace(0.0, 1.0, N), np.linspace(0.0, 1.0, N) ** 2),
    "pure sine": lambda pv, op: (np.sin(np.arange(N) / 8), np.cos(np.arange(N) / 8)),
    "tiny": lambda pv, op: (pv * 1e-80, op * 1e-80),
    "large": lambda pv, op: (pv * 1e80, op * 1e80),
    "far from zero": lambda pv, op: (pv * 1e-6 + 1e6, op),
    "every third missing": lambda pv, op: (np.where(np.arange(N) % 3 == 1, np.nan, pv), op),
    "on and off": lambda pv, op: (pv, np.where(op > op.mean(), 100.0, 0.0)),
}


@pytest.mark.parametrize("name", ODD)
def test_odd_records_are_answered(name):
    loop = sticky_loop()
    pv, op = ODD[name](loop.pv, loop.op)
    judgement = audit(Recording(name, loop.time_s, pv, op)).judgement
    assert judgement.reliability == "not_reliable"
    assert judgement.reasons
    assert all(reason.text for reason in judgement.reasons)
    assert (judgement.stiction_probability is None) == (judgement.verdict == "not_auditable")


@pytest.mark.parametrize("n", [100, 131, 180])
def test_short_records_are_answered(n):
    judgement = audit(sticky_loop(n)).judgement
    assert judgement.verdict != "not_auditable"


@pytest.mark.parametrize(
    ("span", "width"), [((0.0, 80.0), 80.0), ((80.0, 0.0), 80.0), ((-np.inf, 100.0), None), ((0.0, np.nan), None)]
)
def test_the_span_of_op_is_told_where_it_is_one(span, width):
    assert audit(replace(sticky_loop(90), op_range=span)).op_instrument_span == width


def test_sampling_at_random_times_is_answered():
    loop = sticky_loop()
    t = np.cumsum(np.random.default_rng(4).exponential(size=N))
    judgement = audit(Recording("x", t, loop.pv, loop.op)).judgement
    assert (judgement.verdict, judgement.reliability) == ("stiction", "not_reliable")
    assert {"irregular_sampling", "filled_share"} <= {reason.code for reason in judgement.reasons}


def test_an_engine_that_cannot_use_the_record_is_an_answer(monkeypatch):
    def refuse(*_):
        raise DataError("too_few_samples", "12 samples, 200 are needed")

    monkeypatch.setattr(audit_module, "climb", refuse)
    judgement = audit(sticky_loop()).judgement
    assert (judgement.verdict, [r.code for r in judgement.reasons]) == ("not_auditable", ["too_few_samples"])


def test_a_fault_of_ours_is_not_hidden(monkeypatch):
    def fail(*_):
        raise ZeroDivisionError

    monkeypatch.setattr(audit_module, "climb", fail)
    with pytest.raises(ZeroDivisionError):
        audit(sticky_loop())


def test_doubts_about_the_record_are_among_the_reasons():
    loop = sticky_loop()
    coarse = Recording("level", loop.time_s, np.round(loop.pv), loop.op)
    assert "pv_quantised" in [reason.code for reason in audit(coarse).judgement.reasons]


def test_a_valve_is_not_cleared_reliably_by_the_way_that_op_runs_to_its_end():
    """Behind a valve that does not move at all OP winds up, and stands at its limit for the rest of the record."""
    t, noise = np.arange(2400.0), np.random.default_rng(4)
    op = np.maximum(50.0 - 0.05 * t, 0.0) + np.where(t < 1000, 0.05 * noise.standard_normal(2400), 0.0)
    found = audit(Recording("stuck", t, 49.0 + 0.05 * noise.standard_normal(2400), op))
    assert (found.judgement.verdict, found.judgement.reliability) == ("inconclusive", "not_reliable")
    assert {"uncoupled", "op_flat"} <= {reason.code for reason in found.judgement.reasons}
    assert found.judgement.reasons[0].code == "uncoupled"
    assert found.judgement.likely_cause is None


def test_a_loop_that_is_shut_for_most_of_the_time_is_judged_by_what_it_does_in_the_rest():
    """As above OP stands still for most of the record, but where it moves PV owes its movement to it."""
    n, noise = 3000, np.random.default_rng(5)
    op = np.zeros(n)
    op[:1200] = 40.0 + np.cumsum(noise.standard_normal(1200))
    pv = lfilter([0.0, 0.3], [1.0, -0.7], op) + 0.2 * noise.standard_normal(n)
    found = audit(Recording("batch", np.arange(float(n)), pv, op))
    assert (found.judgement.verdict, found.judgement.reliability) == ("no_stiction", "not_reliable")
    assert "op_flat" in {reason.code for reason in found.judgement.reasons}


def test_long_records_are_judged_whole_and_identified_on_their_newest_samples():
    loop = sticky_loop(900)
    result = audit(loop, AuditConfig(max_samples=400))
    assert (result.samples, result.fitness.record.samples) == (900, 900)
    assert (result.window.start_s, result.window.end_s, result.window.samples) == (0.0, 899.0, 900)
    assert (result.identified.start_s, result.identified.end_s, result.identified.samples) == (500.0, 899.0, 400)


def test_an_audit_calls_yper_high_above_the_calibrated_threshold():
    assert AuditConfig().ladder.yper_threshold_pct == 10.0
    assert LadderConfig().yper_threshold_pct == 0.5


def test_the_reference_is_run_whole_also_where_the_shapes_clear_the_valve():
    load, noise = Signal(noise_sd=2.0, noise_tau_s=400.0), Signal(noise_sd=0.2)
    spec = LoopSpec(first_order(1.0, 20.0, 5.0), Pid(0.8, 25.0), load=load, noise=noise, pv_start=50.0, op_start=50.0)
    cleared = audit(simulate_loop(spec, 4000.0, 4.0, 1).recording("healthy"))
    assert cleared.judgement.stiction_probability < 0.25
    assert cleared.reference.last.two is not None
    assert cleared.reference.ending != "not_widened"


def test_the_dear_part_of_the_reference_may_be_left_out_where_the_shapes_leave_no_doubt(answer):
    p = answer.judgement.stiction_probability
    wide = audit(sticky_loop(), AuditConfig(doubt_above=p / 2))
    narrow = audit(sticky_loop(), AuditConfig(doubt_above=p))
    assert wide.reference.last.two is not None
    assert narrow.reference.last.two is None
    assert narrow.reference.widenings == 0
    assert narrow.reference.ending in ("agreement", "not_widened")
    assert narrow.judgement.verdict == wide.judgement.verdict
    assert narrow.judgement.stiction_probability == p


def test_the_grid_of_an_audit_covers_all_of_the_range_of_op(answer):
    first = answer.reference.rungs[0].one
    assert first.d[-1] == pytest.approx(answer.op_span)


def test_configurations_are_told_apart():
    base = AuditConfig()
    other = AuditConfig(fitness=FitnessConfig(min_samples=101))
    assert base.fingerprint() == AuditConfig().fingerprint()
    assert base.fingerprint() != other.fingerprint()


def test_a_configuration_can_be_read_back():
    config = AuditConfig(max_samples=700, fitness=FitnessConfig(flat_share=0.4))
    assert AuditConfig.from_json(config.canonical_json()) == config
    assert AuditConfig.from_json('{"max_samples": 700}') == AuditConfig(max_samples=700)
    of_another = AuditConfig.from_json('{"judgement": {"parameters_version": "0123456789ab"}}')
    assert of_another == AuditConfig()  # the numbers that judge are those of this version


def test_an_unknown_setting_is_refused():
    with pytest.raises(DataError, match=r"no setting fitness\.colour"):
        AuditConfig.from_json('{"fitness": {"colour": 1}}')


def sticking() -> Recording:
    spec = LoopSpec(
        plant=first_order(1.0, 30.0, 5.0), controller=Pid(0.6, 40.0), valve=TwoParameterValve(6.0, 5.0),
        load=Signal(value=2.0, noise_sd=0.1, noise_tau_s=300.0), noise=Signal(noise_sd=0.1),
        pv_start=50.0, op_start=50.0, step_s=2.0,
    )  # fmt: skip
    return simulate_loop(spec, 20_000.0, 10.0, seed=0).recording("sticking")


def rebuilt(made: Recording, *signals: str) -> Recording:
    """As a historian gives back what it kept on straight lines to half a standard deviation."""

    def on_lines(x: np.ndarray) -> np.ndarray:
        kept = keep(made.time_s, x, 0.5 * float(np.std(x)), "swinging_door")
        return rebuild(made.time_s, x, kept, "swinging_door")

    return replace(made, **{name: on_lines(getattr(made, name)) for name in signals})


@pytest.mark.parametrize(
    ("signals", "failed"), [((), set()), (("pv",), {"size_as_sampled"}), (("op",), {"size_as_sampled"})]
)
def test_the_size_is_relied_on_where_pv_and_op_are_as_they_were_sampled(signals, failed):
    size = audit(rebuilt(sticking(), *signals)).stiction_size
    assert {finding.code for finding in size.findings if finding.outcome == "fail"} == failed
    assert size.identifiable == (not failed)
