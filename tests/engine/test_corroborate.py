"""The published methods on wave forms whose answer is known, on simulated loops, and where they must not apply."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from app.engine.corroborate import METHODS, Corroboration, corroborate
from app.engine.corroborate.bicoherence import nonlinearity_indices
from app.engine.corroborate.chance_coupling import FIRST, _noise, chance_limit
from app.engine.corroborate.half_cycles import SINE, half_cycles, misfit, triangles
from app.engine.corroborate.movement_patterns import rho_3
from app.engine.corroborate.sigmoid import fitted_correlation
from app.engine.oscillation import Oscillation, detect
from app.engine.recording import UniformRecord
from app.engine.simulate import LoopSpec, Pid, Signal, TwoParameterValve, integrator, simulate_loop
from tests.golden.systems import figure_ten

T = np.arange(1600) / 41.3
SIN, COS = np.sin(2 * np.pi * T), np.cos(2 * np.pi * T)
TRIANGLE, SQUARE = 2 / np.pi * np.arcsin(SIN), np.sign(COS)
SHAPE_METHODS = {method.__name__ for method in METHODS} - {"bicoherence"}
SELF_REGULATING_ONLY = SHAPE_METHODS - {"curve_fitting", "relay", "histogram"}


def record(pv, op, sp=None, noise=0.0, seed=1) -> UniformRecord:
    rng = np.random.default_rng(seed)
    pv, op = (x + noise * rng.standard_normal(len(x)) for x in (pv, op))
    return UniformRecord(1.0, pv, op, sp, np.zeros(len(pv), dtype=bool))


def answers(r: UniformRecord, integrating: bool | None = False) -> dict[str, Corroboration]:
    return {c.method: c for c in corroborate(r, detect(r), integrating)}


def says(r: UniformRecord, integrating: bool | None = False) -> dict[str, str | None]:
    return {name: c.says for name, c in answers(r, integrating).items()}


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_sine_in_line_with_op_is_no_stiction_for_any_method(noise):
    """An outer sine, which the controller passes on: even cross-correlation, sines everywhere, area ratio 1."""
    assert set(says(record(SIN, -SIN, noise=noise)).values()) == {"no_stiction"}


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_square_pv_under_triangular_op_is_stiction_in_a_fast_process(noise):
    """A stuck valve in a flow under integral action. Symmetric waves have no bispectrum and no slow flank."""
    found = says(record(-SQUARE, TRIANGLE, noise=noise))
    blind = {"bicoherence", "area_ratio"}
    assert {name: what for name, what in found.items() if name not in blind} == dict.fromkeys(
        SHAPE_METHODS - blind, "stiction"
    )


def test_triangular_pv_is_stiction_where_the_process_integrates():
    found = says(record(TRIANGLE, -np.cumsum(TRIANGLE) / 40), integrating=True)
    assert (found["curve_fitting"], found["relay"]) == ("stiction", "stiction")


def test_a_slow_rise_and_a_quick_fall_have_more_area_before_the_peak():
    rise = (2 * T) % 1.0
    assert answers(record(np.where(SIN >= 0, rise, -rise), TRIANGLE))["area_ratio"].statistic > 1.5
    assert answers(record(SIN, TRIANGLE))["area_ratio"].statistic == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize(
    ("phase_deg", "expected"), [(0, "no_stiction"), (20, "no_stiction"), (45, None), (90, "stiction")]
)
def test_cross_correlation_decides_by_the_phase(phase_deg, expected):
    """The bands of the source are phases: within 30 degrees of even, within 30 degrees of odd, undecided between."""
    pv = np.sin(2 * np.pi * T + np.radians(phase_deg))
    answer = answers(record(pv, SIN))["cross_correlation"]
    assert answer.says == expected
    assert answer.statistic == pytest.approx(phase_deg / 90, abs=0.03)


def test_curve_fitting_looks_at_op_or_at_pv():
    r = record(SIN, TRIANGLE)
    assert says(r, integrating=False)["curve_fitting"] == "stiction"
    assert says(r, integrating=True)["curve_fitting"] == "no_stiction"


def test_rho_3_counts_what_pv_follows():
    """PV does what OP did a step before: of the steps in which one of them moves, half find PV sticking."""
    op = np.repeat([0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0], 4)
    assert rho_3(op, np.roll(op, 1)) == pytest.approx(0.5, abs=0.1)
    assert rho_3(op, op) == 0.0


def test_the_sigmoid_is_found_again():
    x = np.random.default_rng(3).standard_normal(400)
    assert fitted_correlation(x, 1 / (1 + np.exp(-(2.5 * x - 0.7)))) == pytest.approx(1.0, abs=1e-9)
    assert fitted_correlation(x, 1 / (1 + np.exp(2.5 * x))) == pytest.approx(1.0, abs=1e-9)


def test_half_cycles_are_cut_at_zero_crossings_and_turned_upwards():
    x = np.sin(2 * np.pi * np.arange(400) / 40 + 0.2)
    halves = half_cycles(x, x)
    assert halves.shape == (19, SINE.shape[1])
    assert np.abs(halves - SINE).max() < 0.01
    assert misfit(halves, SINE) < 1e-3 * misfit(halves, triangles(np.array([0.5])))


def test_bicoherence_tells_coupled_lines_from_independent_ones():
    rng = np.random.default_rng(5)
    noise = rng.standard_normal(4096)
    smooth = np.convolve(noise, np.ones(6) / 6, mode="same")
    linear, squared = nonlinearity_indices(smooth), nonlinearity_indices(smooth + smooth**2)
    assert linear.ngi < 1e-3
    assert squared.ngi > 0.05
    assert squared.nli > 0.01


@pytest.mark.parametrize(("turns", "hop"), [(None, 20), (None, 32), (None, 44), (8.0, 29), (40.0, 25), (64.0, 40)])
def test_one_record_of_gaussian_noise_in_twenty_exceeds_its_bicoherence_by_chance(turns, hop):
    """White, or swinging with a period of so many samples, with a hop as the method has it. By pairs that are taken as
    independent 83 of 300 white records do with a hop of half a segment."""
    rng, n = np.random.default_rng(12), 300
    feedback = [1.0] if turns is None else [1.0, -1.8 * np.cos(2 * np.pi / turns), 0.81]
    noise = lfilter([1.0], feedback, rng.standard_normal((n, 1300)), axis=1)[:, 300:]
    assert sum(nonlinearity_indices(x, hop).ngi > 0.0 for x in noise) <= 24


def test_bicoherence_of_white_noise_is_expected_where_it_lies():
    """The mean over all pairs of 400 records of 61 segments, and how it varies from one to the next."""
    noise = np.random.default_rng(4).standard_normal((400, 1984))
    every = np.ones(len(FIRST), dtype=bool)
    limit = chance_limit(every, 61, 32)
    means = [limit + nonlinearity_indices(x).ngi for x in noise]
    assert 61 * np.mean(means) == pytest.approx(1.04, abs=0.02)
    assert np.quantile(means, 0.95) == pytest.approx(limit, rel=0.02)


@pytest.mark.parametrize("kept", ["expected", "together"])
def test_what_is_kept_of_chance_cannot_be_written_over(kept):
    with pytest.raises(ValueError, match="read-only"):
        getattr(_noise(32), kept)[...] = 0.0


@pytest.mark.parametrize("period", [32.0, 40.0, 64.0])
def test_bicoherence_is_not_taken_in_by_a_sine_in_step_with_its_segments(period):
    pv = np.sin(2 * np.pi * np.arange(2000) / period) + 0.01 * np.random.default_rng(1).standard_normal(2000)
    assert says(record(pv, pv))["bicoherence"] == "no_stiction"


def test_figure_ten_of_simulated_loops():
    """The sticky loop is called sticky by most that decide; the outer sine by few."""
    _, sticky, disturbed = (scenario.simulate().uniform() for scenario in figure_ten())
    votes = [[what for what in says(r).values() if what is not None] for r in (sticky, disturbed)]
    share = [v.count("stiction") / len(v) for v in votes]
    assert share[0] >= 0.6
    assert share[1] <= 0.35


def test_a_sticky_level_loop_is_found_by_curve_fitting():
    valve, push = TwoParameterValve(4.0, 2.0), Signal(value=3.0)
    spec = LoopSpec(integrator(0.02), Pid(2.0, 60.0), valve, load=push, settle_s=4000.0)
    r = simulate_loop(spec, 2000.0, 1.0, 1).uniform()
    assert says(r, integrating=True)["curve_fitting"] == "stiction"


def test_without_oscillation_no_shape_is_looked_at():
    rng = np.random.default_rng(2)
    r = record(np.cumsum(rng.standard_normal(1500)), rng.standard_normal(1500))
    none = Oscillation(None, 0.0, 0.0, None, 0.0, "pv", 0.0)
    irregular = Oscillation(40.0, 0.6, 0.5, 40.0, 37.5, "pv", 0.0)
    assert_refused({c.method: c for c in corroborate(r, none, False)}, "does not oscillate")
    assert_refused({c.method: c for c in corroborate(r, irregular, False)}, "not regular")


def assert_refused(found: dict[str, Corroboration], why: str) -> None:
    for name in SHAPE_METHODS:
        assert not found[name].applies
        assert found[name].statistic is None
        assert found[name].says is None
        assert why in found[name].why_not


def test_a_moving_set_point_excludes_all_methods_on_shapes():
    found = answers(record(SIN, SQUARE, sp=0.9 * SIN))
    assert all("set point moves" in found[name].why_not for name in SHAPE_METHODS)
    still = answers(record(SIN, SQUARE, sp=np.full(len(SIN), 3.0)))
    assert all(still[name].applies for name in SHAPE_METHODS)


def test_too_few_samples_a_cycle_are_refused():
    t = np.arange(900) / 6.3
    found = answers(record(np.sin(2 * np.pi * t), np.cos(2 * np.pi * t)))
    assert all("samples a cycle" in found[name].why_not for name in SHAPE_METHODS)


def test_an_integrating_process_excludes_the_methods_for_self_regulating_ones():
    found = answers(record(TRIANGLE, COS), integrating=True)
    assert {name for name, c in found.items() if c.why_not == "the process integrates"} == SELF_REGULATING_ONLY


def test_an_unknown_process_is_taken_as_self_regulating_and_said():
    found, known = answers(record(SIN, COS), integrating=None), answers(record(SIN, COS), integrating=False)
    assert [c.statistic for c in found.values()] == [c.statistic for c in known.values()]
    assert all("taken as self-regulating" in found[name].text for name in SELF_REGULATING_ONLY)


def test_a_short_record_is_refused_with_what_is_missing():
    r = record(SIN[:150], COS[:150])
    assert answers(r)["bicoherence"].why_not == "3 segments of 64 samples, needed 8"


@pytest.mark.parametrize("which", ["pv", "op"])
def test_a_signal_that_stands_still_is_refused(which):
    r = replace(record(SIN, COS), **{which: np.full(len(SIN), 5.0)})
    assert not any(c.applies for c in corroborate(r, detect(r), False) if c.method in SHAPE_METHODS)


def test_every_answer_carries_its_source():
    found = corroborate(record(SIN, COS), detect(record(SIN, COS)), False)
    assert {c.method for c in found} >= set(SHAPE_METHODS)
    for c in found:
        assert c.source
        assert c.text
        assert c.doi is None or c.doi.startswith("10.")


def test_a_sigmoid_is_never_left_worse_than_it_was_found():
    """A few far values make the first steps go too far."""
    rng = np.random.default_rng(2)
    for _ in range(40):
        x = np.append(rng.normal(size=60), rng.choice([-40.0, 40.0], 3))
        y = 1.0 / (1.0 + np.exp(-3.0 * x)) + 0.02 * rng.normal(size=63)
        y = (y - y.min()) / np.ptp(y)
        assert fitted_correlation(x, y) > 0.95
