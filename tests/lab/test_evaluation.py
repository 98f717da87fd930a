"""Training and measuring: weights by valve, signs that hold, calibration, figures worked out by hand."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from app.engine.features import NAMES
from app.engine.fitness import assess
from app.engine.judgement import Judgement
from app.engine.recording import Recording
from app.engine.verdict import parameters as shipped_parameters
from app.engine.verdict.shape_model import fitted_model
from app.errors import DataError
from app.ingest import read_recordings
from app.lab.evaluation import fitting, parameters, recordings, report, scoring
from app.lab.evaluation.fitting import FitConfig, Samples, class_weights, fit, platt, valve_weights
from app.lab.evaluation.leave_group_out import groups_of, models_without
from app.lab.evaluation.leave_one_out import Table, by_valve
from app.lab.evaluation.leave_pair_out import area_by_pairs
from app.lab.evaluation.strangers import judged, strangers
from app.lab.testbench.known_loops import known_loops


def samples(n: int, seed: int) -> Samples:
    """Two classes that the first odd feature separates, all other features noise."""
    rng = np.random.default_rng(seed)
    sticky = np.arange(n) % 2
    values = rng.normal(size=(n, len(NAMES)))
    values[:, NAMES.index("ccf_odd")] += 2.0 * sticky
    return Samples(values, sticky, class_weights(np.ones(n), sticky))


def judgement(verdict: str, probability: float, reliable: bool) -> Judgement:
    return Judgement(verdict, probability, "reliable" if reliable else "not_reliable", (), None)


def test_a_valve_counts_once_and_both_classes_alike():
    weight = valve_weights(np.array(["a", "a", "b", "c"]), np.array([1, 1, 1, 0]))
    np.testing.assert_allclose(weight, [0.25, 0.25, 0.5, 1.0])


def test_a_label_that_is_not_sure_counts_less_within_its_class():
    weight = valve_weights(np.array(["a", "b", "c"]), np.array([1, 1, 0]), np.array([1.0, 0.25, 0.25]))
    np.testing.assert_allclose(weight, [0.8, 0.2, 1.0])


def test_a_sure_label_outweighs_two_doubtful_ones_that_say_the_opposite():
    clear, doubted = samples(400, 0), samples(400, 1)
    labels = np.concatenate((clear.sticky, 1 - doubted.sticky, 1 - doubted.sticky))
    valves = np.array([str(k) for k in range(1200)])
    values = np.concatenate((clear.values, doubted.values, doubted.values))

    def right(trust: np.ndarray) -> float:
        real = Samples(values, labels, valve_weights(valves, labels, trust))
        model = fit(real, samples(40, 2), FitConfig(networks=1, steps=60, real_share=0.98))
        test = samples(400, 3)
        return float(((model.raw_log_odds(test.values) > 0) == (test.sticky == 1)).mean())

    assert right(np.repeat([1.0, 0.25], [400, 800])) > right(np.ones(1200)) + 0.1


def test_fit_separates_and_keeps_the_signs_of_physics():
    model = fit(samples(80, 0), samples(400, 1), FitConfig(networks=1, steps=60))
    test = samples(200, 2)
    right = (model.raw_log_odds(test.values) > 0) == (test.sticky == 1)
    assert right.mean() > 0.7
    for name, weight in zip(NAMES, model.slope, strict=True):
        assert weight * fitting.SIGNS.get(name, 0) >= 0
        assert name in fitting.SIGNS or weight == 0


def test_the_same_seed_fits_the_same_model():
    one, two = (fit(samples(40, 0), samples(100, 1), FitConfig(networks=1, steps=20)) for _ in range(2))
    np.testing.assert_array_equal(one.hidden, two.hidden)


def test_platt_finds_the_slope_that_was_taken_out():
    rng = np.random.default_rng(0)
    log_odds = rng.normal(scale=2.0, size=4000)
    sticky = (rng.random(4000) < 1 / (1 + np.exp(-log_odds))).astype(int)
    slope, intercept = platt(log_odds / 0.5, sticky, np.ones(4000), np.zeros(4000))
    assert slope == pytest.approx(0.5, rel=0.15)
    assert intercept == pytest.approx(0.0, abs=0.15)


def test_platt_makes_up_for_what_rivals_take():
    rng = np.random.default_rng(1)
    log_odds = rng.normal(scale=2.0, size=4000)
    sticky = (rng.random(4000) < 1 / (1 + np.exp(-log_odds))).astype(int)
    against = np.where(rng.random(4000) < 0.3, 2.0, 0.0)
    slope, intercept = platt(log_odds, sticky, np.ones(4000), against)
    stated = 1 / (1 + np.exp(-(slope * log_odds + intercept - against)))
    assert intercept > 0.3
    assert stated.mean() == pytest.approx(sticky.mean(), abs=0.01)


def test_figures_by_hand():
    valves = np.array(["a", "a", "b", "c", "d"])
    sticky = np.array([1, 1, 1, 0, 0])
    said = [
        judgement("stiction", 0.9, True),
        judgement("no_stiction", 0.4, False),
        judgement("inconclusive", 0.5, False),
        judgement("stiction", 0.8, True),
        judgement("no_stiction", 0.1, True),
    ]
    found = scoring.figures(valves, sticky, said)
    assert found.auc == pytest.approx(0.5)
    assert found.forced == pytest.approx(0.5)
    assert found.decided == pytest.approx(0.5 * (0.25 + 0.5))
    assert found.coverage == pytest.approx(0.75)
    assert found.reliable_share == pytest.approx(2.5 / 4)
    assert found.reliable_right == pytest.approx(1.5 / 2.5)
    assert found.false_alarms == pytest.approx(0.5)


def test_area_by_pairs_asks_for_every_sticky_and_healthy_pair_once():
    scores = {"a": 0.9, "b": 0.4, "x": 0.4, "y": 0.1}
    asked = []

    def compared(positive: str, negative: str) -> tuple[float, float]:
        asked.append((positive, negative))
        return scores[positive], scores[negative]

    area = area_by_pairs(np.array(["a", "b", "x", "y"]), np.array([1, 1, 0, 0]), compared)
    assert asked == [("a", "x"), ("a", "y"), ("b", "x"), ("b", "y")]
    assert area == pytest.approx(3.5 / 4)


def test_pairs_are_compared_within_a_model_whatever_level_it_has():
    def compared(positive: str, negative: str) -> tuple[float, float]:
        level = -10.0 if positive == "a" else 10.0
        return level + 1.0, level

    assert area_by_pairs(np.array(["a", "b", "x", "y"]), np.array([1, 1, 0, 0]), compared) == 1.0


def test_intervals_hold_the_estimate():
    label = np.array([1] * 20 + [0] * 20)
    probability = np.concatenate((np.linspace(0.3, 1.0, 20), np.linspace(0.0, 0.7, 20)))
    auc, forced = scoring.bootstrap(label, probability, draws=200)
    assert auc.low < scoring.area_under_curve(probability, label) < auc.high
    assert forced.low < scoring.balanced((probability > 0.5) == label, label) < forced.high


@pytest.mark.parametrize(
    ("share", "of", "low", "high"),
    [(41 / 42, 42, 0.874, 0.9994), (1 / 40, 40, 0.0006, 0.132), (1.0, 42, 0.916, 1.0), (0.0, 0.0, 0.0, 1.0)],
)
def test_a_share_with_one_exception_or_none_has_an_interval_all_the_same(share, of, low, high):
    """By Clopper and Pearson's tables; valves drawn again would leave the third a point."""
    found = scoring.exact(share, of)
    assert (found.low, found.high) == pytest.approx((low, high), abs=6e-4)


def test_the_headline_says_how_far_each_share_can_be_trusted():
    found = scoring.Figures(0.95, 0.94, 0.91, 0.97, 0.5, 0.95, 0.0, valves=40, healthy=20)
    told = report.headline(found, scoring.Interval(0.9, 1.0), scoring.Interval(0.9, 1.0))
    assert "| right of those called reliable | 95.0 % | 75.1 to 99.9 % |" in told
    assert "| healthy valves called sticky and reliable | 0.0 % | 0.0 to 16.8 % |" in told


def test_by_valve_takes_means():
    names, means = by_valve(np.array(["b", "a", "b"]), np.array([1.0, 5.0, 3.0]))
    assert (names.tolist(), means.tolist()) == (["a", "b"], [5.0, 2.0])


def test_the_report_names_who_is_on_the_wrong_side():
    said = [judgement("stiction", 0.9, True), judgement("no_stiction", 0.1, True)]
    text = report.failures(["x", "y"], ["tuning", ""], np.array([0, 1]), said)
    assert "| x | no stiction (tuning) | 0.90 | reliable |" in text
    assert "| y | sticky | 0.10 | reliable |" in text


def test_the_report_tells_sure_labels_from_others():
    valves, sticky = np.array(["a", "b", "b", "c", "d"]), np.array([1, 0, 0, 1, 1])
    tiers, probability = np.array(["stated"] * 4 + ["likely"]), np.array([0.9, 0.6, 0.6, 0.3, 0.8])
    text = report.by_tier(valves, sticky, tiers, probability)
    assert "| stated | 3 | 2 | 0.500 | 0.250 |" in text
    assert "| likely | 1 | 1 | - | - |" in text


def test_simulated_loops_are_the_same_for_the_same_seed_and_hold_both_classes():
    one, two = list(known_loops(12, 5)), list(known_loops(12, 5))
    assert {loop.cause == "stiction" for loop in one} == {True, False}
    for a, b in zip(one, two, strict=True):
        np.testing.assert_array_equal(a.record.pv, b.record.pv)


def test_written_parameters_are_a_module_that_gives_the_model_back(tmp_path):
    model = fit(samples(40, 0), samples(100, 1), FitConfig(networks=2, steps=20))
    version = parameters.write(model, tmp_path / "written.py")
    space: dict = {}
    exec((tmp_path / "written.py").read_text(), space)  # noqa: S102
    assert (space["VERSION"], space["FEATURES"], space["NETWORKS"]) == (version, NAMES, 2)
    np.testing.assert_allclose(np.array(space["SLOPE"]), model.slope, rtol=1e-3, atol=1e-5)
    np.testing.assert_allclose(np.array(space["HIDDEN"]), model.hidden.ravel(), rtol=1e-3, atol=1e-5)


def test_the_numbers_that_are_shipped_are_those_of_their_version(tmp_path):
    """A number that is changed by hand, under the version of the others, would make no stored verdict again."""
    parameters.write(fitted_model(), tmp_path / "again.py")
    assert (tmp_path / "again.py").read_text() == Path(shipped_parameters.__file__).read_text()


def test_the_report_says_whether_the_shipped_numbers_are_those_of_the_fit():
    shipped = fitted_model()
    values = np.array([shipped.centre, shipped.centre + shipped.scale])
    same = report.shipped_beside(shipped, shipped, values)
    assert same == f"The parameters that are shipped, {shipped_parameters.VERSION}, are what this fit gives"
    slope, intercept = shipped.calibration
    other = report.shipped_beside(replace(shipped, calibration=(slope, intercept + 0.5)), shipped, values)
    before, after = 1 / (1 + np.exp(-shipped.log_odds(values))), 1 / (1 + np.exp(-shipped.log_odds(values) - 0.5))
    assert f"up to {np.abs(after - before).max():.3f}" in other


def test_a_group_that_is_left_out_has_no_part_in_fit_and_calibration():
    """What is written of its recordings, labels and rivals may be anything: the model without it stays what it was."""
    real, simulated = samples(24, 0), samples(60, 1)
    valves = np.array([f"v{k // 2}" for k in range(24)])
    groups = {f"v{k}": "west" if k < 4 else "east" if k < 8 else "north" for k in range(12)} | {"unusable": "east"}
    small = FitConfig(networks=1, steps=5)

    def models(sticky: np.ndarray, values: np.ndarray, against: np.ndarray) -> dict:
        return models_without(groups, Table(values, valves, sticky, np.ones(24)), against, simulated, small)

    sticky = np.repeat(real.sticky[:12], 2)
    before = models(sticky, real.values, np.zeros(24))
    west = np.arange(24) < 8
    turned = np.where(west, 1 - sticky, sticky)
    after = models(turned, np.where(west[:, None], 9.0, real.values), np.where(west, 3.0, 0.0))
    assert set(before) == set(groups)
    assert (before["v0"] is before["v3"], before["unusable"] is before["v4"]) == (True, True)
    probe = samples(10, 2).values
    np.testing.assert_array_equal(after["v0"].log_odds(probe), before["v0"].log_odds(probe))
    assert not np.allclose(after["v4"].log_odds(probe), before["v4"].log_odds(probe))


def test_valves_are_grouped_by_source_and_by_what_their_names_begin_with():
    loops = [
        SimpleNamespace(valve="a", source="ISDB", recording=SimpleNamespace(name="CHEM12")),
        SimpleNamespace(valve="b", source="ISDB", recording=SimpleNamespace(name="PAP1")),
        SimpleNamespace(valve="c", source="", recording=SimpleNamespace(name="12")),
    ]
    assert groups_of(loops) == {
        "whole sources": {"a": "ISDB", "b": "ISDB", "c": ""},
        "whole industries, as names begin": {"a": "CHEM", "b": "PAP", "c": ""},
    }


def test_a_labelled_recording_is_read_as_audit_reads_it(tmp_path):
    rng = np.random.default_rng(3)
    lines = [f"{60 * k + (30 if k == 7 else 0)},{50},{rng.normal():.4f},{rng.normal():.4f}" for k in range(200)]
    path = tmp_path / "FIC7.csv"
    path.write_text("time,SP,PV,OP\n" + "\n".join(lines) + "\n")
    mine, audited = recordings.read(path), read_recordings(path).recordings[0]
    assert mine.fingerprint() == audited.fingerprint()


def test_a_labelled_file_of_two_loops_is_refused(tmp_path):
    rows = [f"2026-01-01T00:{k:02d}:00Z,1,{k},3,{k}" for k in range(30)]
    (tmp_path / "two.csv").write_text("time,A.PV,A.OP,B.PV,B.OP\n" + "\n".join(rows) + "\n")
    with pytest.raises(DataError, match="2 loops"):
        recordings.read(tmp_path / "two.csv")


def test_a_label_without_a_tier_is_a_sure_one(tmp_path):
    rng = np.random.default_rng(4)
    rows = [f"{k},50,{rng.normal():.4f},{rng.normal():.4f}" for k in range(200)]
    for name in ("one", "two"):
        (tmp_path / f"{name}.csv").write_text("time,SP,PV,OP\n" + "\n".join(rows) + "\n")
    head = "recording,valve,source,label,cause"
    (tmp_path / "labels.csv").write_text(f"{head}\none,V1,ours,stiction,\n")
    assert [loop.trust for loop in recordings.labelled(tmp_path)] == [1.0]
    (tmp_path / "labels.csv").write_text(f"{head},tier\none,V1,ours,stiction,,stated\ntwo,V2,ours,stiction,,likely\n")
    sure, likely = recordings.labelled(tmp_path)
    assert 0.0 < likely.trust < sure.trust == 1.0


def of_valve(valve: str, seed: int, samples: int = 600) -> recordings.Labelled:
    """A recording of the valve with a constant in PV and in OP that tells where they came from."""
    rng = np.random.default_rng(seed)
    pv, op = np.cumsum(rng.normal(size=samples)) + 1000.0 * seed, rng.normal(size=samples) + 1000.0 * seed
    recording = Recording(valve, np.arange(float(samples)), pv, op)
    return recordings.Labelled(recording, valve, "", "stated", "", True, assess(recording), None, None)


def test_strangers_are_pv_and_op_of_different_valves():
    loops = [of_valve("a", 1), of_valve("a", 2), of_valve("b", 3), of_valve("c", 4, samples=250)]
    drawn = list(strangers(loops, 60, seed=1))
    sources = {(round(pair.pv.mean() / 1000.0), round(pair.op.mean() / 1000.0)) for pair in drawn}
    assert sources == {(1, 3), (2, 3), (3, 1), (3, 2)}
    again = list(strangers(loops, 60, seed=1))
    assert [pair.fingerprint() for pair in again] == [pair.fingerprint() for pair in drawn]


def test_nothing_is_said_reliably_of_strangers():
    said = [judged(pair) for pair in strangers([of_valve("a", 1), of_valve("b", 3)], 4, seed=1)]
    assert said
    assert all(judgement is not None and judgement.reliability == "not_reliable" for judgement in said)
