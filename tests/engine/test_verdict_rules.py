"""Each rule of the verdict by itself, on evidence that is given: on which side of its bound it doubts."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from app.engine.causality.outside_corners import OutsideCorners
from app.engine.evidence import Finding, Measured
from app.engine.fitness import Fitness, assess, with_cycles
from app.engine.judgement import Judgement
from app.engine.oscillation import Oscillation, detect
from app.engine.rivals import Rival
from app.engine.signals.surrogates import linear_surrogates
from app.engine.simulate import LoopSpec, Pid, Signal, TwoParameterValve, first_order, simulate_loop
from app.engine.verdict import judging
from app.engine.verdict.config import VerdictConfig
from app.engine.verdict.judging import conclude
from app.engine.verdict.look_alikes import LookAlikes
from app.engine.verdict.shape_model import fitted_model
from app.engine.verdict.weighing import Weighing, weigh

# Neither stems nor surrogates are asked from the lowest probability on that is reliable.
CONFIG = VerdictConfig(reliable_own_cycle_from=0.65, sure_stiction_from=0.65, unlike_linear_from=0.65)

DISTURBANCE = Rival("disturbance", 0.9, "the load")


@dataclass(frozen=True)
class Evidence:
    weighing: Weighing
    oscillation: Oscillation
    fitness: Fitness

    def judged(
        self,
        probability: float = 0.9,
        rivals: tuple[Rival, ...] = (),
        config: VerdictConfig = CONFIG,
        oscillation: dict | None = None,
        **fitness: object,
    ) -> Judgement:
        log_odds = float(np.log(probability / (1.0 - probability)))
        weighing = replace(self.weighing, log_odds=log_odds, window_spread=0.0, rivals=rivals)
        swing = replace(self.oscillation, **(oscillation or {}))
        return conclude(weighing, swing, replace(self.fitness, **fitness), config, fitted_model())


@pytest.fixture(scope="module")
def evidence() -> Evidence:
    """Of a flow in the limit cycle of its valve, of whose record nothing is to be said."""
    spec = LoopSpec(
        plant=first_order(1.0, 3.0, 1.0), controller=Pid(0.3, 6.0), noise=Signal(noise_sd=0.03),
        valve=TwoParameterValve(2.0, 2.0), upset=Signal(value=3.0), settle_s=300.0,
    )  # fmt: skip
    fitness = assess(simulate_loop(spec, 1200.0, 1.0, seed=1).recording("flow"))
    oscillation = detect(fitness.audited)
    weighing = weigh(fitness.audited, oscillation)
    assert weighing is not None
    return Evidence(weighing, oscillation, with_cycles(fitness, oscillation))


def doubts(said: Judgement) -> list[str]:
    return [reason.code for reason in said.reasons if not reason.code.startswith("shape_")]


@pytest.mark.parametrize(
    ("probability", "verdict"),
    [(0.475, "no_stiction"), (0.485, "inconclusive"), (0.515, "inconclusive"), (0.525, "stiction")],
)
def test_near_one_half_nothing_is_decided(evidence, probability, verdict):
    assert evidence.judged(probability).verdict == verdict


@pytest.mark.parametrize(("probability", "clear"), [(0.66, True), (0.64, False)])
def test_stiction_is_clear_by_its_probability(evidence, probability, clear):
    said = evidence.judged(probability)
    assert (said.verdict, said.reliability) == ("stiction", "reliable" if clear else "not_reliable")
    assert doubts(said) == ([] if clear else ["evidence_not_clear"])


def test_stiction_is_told_from_a_linear_loop_or_not_relied_on(evidence):
    config = VerdictConfig()
    assert evidence.judged(evidence.weighing.probability, config=config).reliability == "reliable"
    pv, op = next(linear_surrogates(evidence.fitness.audited.pv, evidence.fitness.audited.op))
    linear = replace(evidence.fitness.audited, pv=pv, op=op)
    said = evidence.judged(0.7, config=config, record=linear)
    assert (said.verdict, said.reliability) == ("stiction", "not_reliable")
    assert doubts(said) == ["linear_look_alikes"]
    (reason,) = (reason for reason in said.reasons if reason.code == "linear_look_alikes")
    assert reason.measured.statistic > reason.measured.threshold == 0.02


@pytest.mark.parametrize("probability", [0.7, 0.98, 1.0 - 1e-6])
@pytest.mark.parametrize(("chance", "doubted"), [(0.021, ["linear_look_alikes"]), (0.02, [])])
def test_shapes_however_sticky_are_compared_with_a_linear_loop(evidence, monkeypatch, probability, chance, doubted):
    monkeypatch.setattr(judging, "look_alikes", lambda *_: LookAlikes(chance, 5))
    config = VerdictConfig(reliable_own_cycle_from=0.65, sure_stiction_from=0.65)
    assert doubts(evidence.judged(probability, config=config)) == doubted


@pytest.mark.parametrize(("ratio", "doubted"), [(1.49, ["outside_corners"]), (1.5, [])])
def test_what_turns_by_itself_is_not_relied_on(evidence, monkeypatch, ratio, doubted):
    monkeypatch.setattr(judging, "outside_corners", lambda *_: OutsideCorners(ratio, 1.0))
    said = evidence.judged(0.7)
    assert said.verdict == "stiction"
    assert doubts(said) == doubted
    assert said.reliability == ("not_reliable" if doubted else "reliable")


def test_what_is_doubted_already_is_not_compared_with_a_linear_loop(evidence):
    pv, op = next(linear_surrogates(evidence.fitness.audited.pv, evidence.fitness.audited.op))
    linear = {"record": replace(evidence.fitness.audited, pv=pv, op=op)}
    few = evidence.judged(0.7, config=VerdictConfig(), oscillation={"cycles": 4.0}, **linear)
    assert doubts(few) == ["few_cycles"]


@pytest.mark.parametrize(
    ("record", "doubt"),
    [
        ({"oscillation": {"cycles": 5.0}}, []),
        ({"oscillation": {"cycles": 4.9}}, ["few_cycles"]),
        ({"record": 500}, []),
        ({"record": 499}, ["few_samples"]),
        ({"filled_share": 0.1}, []),
        ({"filled_share": 0.11}, ["filled_share"]),
        ({"automatic_share": None}, []),
        ({"automatic_share": 0.5}, []),
        ({"automatic_share": 0.49}, ["mode_share"]),
        ({"findings": (Finding("pv_quantised", "fail", "coarse"),)}, ["pv_quantised"]),
        ({"findings": (Finding("pv_quantised", "pass", "fine"),)}, []),
        ({"findings": (Finding("op_interpolated", "fail", "on lines"),)}, []),
        ({"findings": (Finding("op_flat", "pass", "stood", 0.6, 0.5),)}, ["op_flat"]),
        ({"findings": (Finding("pv_flat", "pass", "stood", 0.5, 0.5),)}, ["pv_flat"]),
        ({"findings": (Finding("pv_flat", "pass", "moved", 0.4, 0.5),)}, []),
        ({"findings": (Finding("pv_flat", "not_evaluated", "nothing was left"),)}, []),
    ],
)
def test_what_the_record_is_like_is_a_doubt_of_its_own(evidence, record, doubt):
    if "record" in record:
        record = {"record": evidence.fitness.audited.part(slice(0, record["record"]))}
    said = evidence.judged(**record)
    assert (said.verdict, said.reliability) == ("stiction", "not_reliable" if doubt else "reliable")
    assert doubts(said) == doubt


@pytest.mark.parametrize(
    ("rival", "doubt"),
    [
        (Rival("set_point_following", 0.86, "PV follows"), ["set_point_moves"]),
        (Rival("set_point_following", 0.84, "PV follows", explained=0.94), []),
        (Rival("set_point_following", 0.1, "PV follows", explained=0.96), ["set_point_moves"]),
        (Rival("disturbance", 0.1, "the load", explained=0.96), []),
        (Rival("external_oscillation", 0.6, "a sine", explained=0.95), []),
        (Rival("external_oscillation", 0.6, "a sine", explained=0.96), ["nearly_sinusoidal"]),
        (Rival("external_oscillation", 0.6, "no sine"), []),
        (Rival("disturbance", 0.5, "the load jumps", counts=1.0), ["disturbance"]),
        (Rival("disturbance", 0.49, "the load jumps", counts=1.0), []),
        (Rival("disturbance", 0.9, "the load jumps"), []),
    ],
)
def test_a_rival_that_may_have_made_the_shapes_is_a_doubt(evidence, rival, doubt):
    said = evidence.judged(0.9, (rival,))
    assert (said.verdict, said.likely_cause) == ("stiction", "stiction")
    assert (said.reliability, doubts(said)) == ("not_reliable" if doubt else "reliable", doubt)


def test_the_doubt_tells_what_it_was_found_by(evidence):
    follows = Rival("set_point_following", 0.1, "PV and OP follow", explained=0.96)
    (reason,) = (r for r in evidence.judged(0.9, (follows,)).reasons if r.code == "set_point_moves")
    assert (reason.measured, reason.measured.passed) == (Measured(0.96, "<", 0.95), False)
    assert reason.text == "the set point explains PV (96 % of its variance on unseen cycles)"


def test_of_a_record_too_short_to_tell_it_is_not_said_that_pv_and_op_are_strangers(evidence):
    said = evidence.judged(0.1, record=evidence.fitness.audited.part(slice(0, 119)))
    assert (said.verdict, said.reliability) == ("no_stiction", "not_reliable")
    assert "few_samples" in doubts(said)
    assert not {"uncoupled", "uncoupled_slowly"} & set(doubts(said))


def test_a_loop_that_cycles_on_its_sensors_resolution_is_not_doubted_for_it(evidence):
    coarse = {"findings": (Finding("pv_quantised", "fail", "coarse"), Finding("stored_points", "fail", "few"))}
    stands_out, does_not = (Rival("quantised_sensor", strength, "coarse") for strength in (0.6, 0.4))
    assert doubts(evidence.judged(0.9, (stands_out,), **coarse)) == ["stored_points"]
    assert doubts(evidence.judged(0.9, (does_not,), **coarse)) == ["pv_quantised", "stored_points"]


@pytest.mark.parametrize(
    ("lost", "code", "cause", "said"),
    [
        ({"pv_dead_s": 5400.0}, "pv_stands", "stuck_valve_or_dead_transmitter", "held one value for the last 1.5 h"),
        ({"wound_up_s": 7200.0}, "wound_up", "saturated_op", "at its limit for most of the last 2 h"),
        (
            {"pv_dead_s": 5400.0, "wound_up_s": 7200.0},
            "pv_stands",
            "stuck_valve_or_dead_transmitter",
            "held one value for the last 1.5 h",
        ),
    ],
)
def test_where_nothing_is_controlled_any_more_no_valve_is_cleared(evidence, lost, code, cause, said):
    cleared, accused = evidence.judged(0.1, **lost), evidence.judged(0.9, **lost)
    assert (cleared.verdict, cleared.reliability, cleared.likely_cause) == ("inconclusive", "not_reliable", cause)
    assert (accused.verdict, accused.reliability, accused.likely_cause) == ("stiction", "not_reliable", "stiction")
    for judgement in (cleared, accused):
        assert judgement.reasons[0].code == code
        assert said in judgement.reasons[0].text


@pytest.mark.parametrize(
    ("probability", "verdict", "cause"), [(0.9, "stiction", "stiction"), (0.1, "inconclusive", None)]
)
def test_of_strangers_nothing_is_cleared_and_no_cause_is_told_but_stiction(evidence, probability, verdict, cause):
    rng, here = np.random.default_rng(3), evidence.fitness.audited
    said = evidence.judged(probability, (DISTURBANCE,), record=replace(here, op=rng.normal(size=here.samples)))
    assert (said.verdict, said.reliability, said.likely_cause) == (verdict, "not_reliable", cause)
    assert said.reasons[0].code == "uncoupled"
    assert said.shows_no_valve is (verdict == "inconclusive")


@pytest.mark.parametrize(("strength", "cause"), [(0.5, "disturbance"), (0.49, None)])
def test_the_first_rival_that_stands_out_is_the_likely_cause_of_a_valve_that_is_cleared(evidence, strength, cause):
    rivals = (Rival("disturbance", strength, "the load"), Rival("saturated_op", 0.1, "OP at its limit"))
    said = evidence.judged(0.1, rivals)
    assert (said.verdict, said.likely_cause) == ("no_stiction", cause)
    assert ("disturbance" in doubts(said)) is (cause is not None)
