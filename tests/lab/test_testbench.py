"""The simulated bench: what it builds is what it says, and the same design gives the same tables."""

import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

from app.engine.causality.stem_search import Asked
from app.engine.simulate import first_order, integrator
from app.lab.testbench import __main__ as command
from app.lab.testbench import neighbours, plots, tables
from app.lab.testbench.building import build
from app.lab.testbench.case import HEALTHY, PLANTS, ordinary, wide
from app.lab.testbench.ladders import LADDERS, WIDE, Design, plan
from app.lab.testbench.running import Outcome, run
from app.lab.testbench.tuning import tuned


def sticky_case(**changes):
    return replace(ordinary(np.random.default_rng(11), "stiction"), **changes)


def outcome(level="1", sticky=True, verdict="stiction", probability=0.9, reliable=True, exercised=True):
    return Outcome("S", level, sticky, exercised, verdict, probability, reliable)


def test_ultimate_gain_of_a_first_order_lag_with_dead_time():
    # P control of e^(-s)/(10 s + 1): phase -180 degrees where w + atan(10 w) = pi, w = 1.63 rad/s, gain 16.35.
    assert tuned(first_order(1.0, 10.0, 1.0), "P", 11.0, 1.0).Kc == pytest.approx(16.35, rel=0.01)


def test_ultimate_gain_of_an_integrator_with_dead_time():
    # P control of e^(-2 s)/s: phase -180 degrees at w = pi/4, gain w.
    assert tuned(integrator(1.0, 2.0), "P", 2.0, 0.5).Kc == pytest.approx(0.5 * np.pi / 4, rel=0.01)


def test_a_sticky_case_has_the_stiction_that_it_says():
    built = build(sticky_case(size_pct=5.0, J_ratio=0.6, plant="first_order", tightness=0.3))
    assert built.exercised
    assert built.loop.spec.valve.S == 5.0
    assert abs(built.loop.spec.valve.J - 3.0) < 1e-12


def test_a_sticky_valve_that_comes_to_rest_is_not_exercised():
    # Without integral, disturbance and noise nothing keeps a self-regulating loop moving.
    assert not build(sticky_case(controller="P", plant="first_order", load_share=0.0, noise_share=0.0)).exercised


@pytest.mark.parametrize("points", [8.0, 40.0, 200.0])
def test_the_record_has_the_samples_a_cycle_that_were_asked_for(points):
    built = build(sticky_case(points_per_cycle=points, cycles=20.0, load_share=0.0, noise_share=0.0, J_ratio=0.5))
    v = built.loop.v - built.loop.v.mean()
    spectrum = np.abs(np.fft.rfft(v))
    assert len(v) / (1 + np.argmax(spectrum[1:])) == pytest.approx(points, rel=0.25)


def test_noise_is_measured_against_the_movement_of_pv():
    built = build(sticky_case(noise_share=1.0))
    added = built.loop.pv - built.loop.true_pv
    assert np.std(added) == pytest.approx(np.std(build(sticky_case(noise_share=0.0)).loop.true_pv), rel=0.35)


def test_a_healthy_valve_is_where_op_is():
    built = build(ordinary(np.random.default_rng(4), "coloured"))
    np.testing.assert_allclose(built.loop.v, built.loop.op)
    assert built.exercised


@pytest.mark.parametrize("recorder", ["exception", "swinging_door"])
def test_the_historian_moves_no_sample_by_more_than_its_band(recorder):
    case = sticky_case(recorder=recorder, recorder_share=0.3)
    built = build(case)
    assert not np.array_equal(built.recording.pv, built.loop.pv)
    assert np.max(np.abs(built.recording.pv - built.loop.pv)) <= 0.3 * np.std(built.loop.pv) * (1 + 1e-9)


@pytest.mark.parametrize("kind", PLANTS)
def test_every_plant_can_be_built(kind):
    assert build(sticky_case(plant=kind)).recording.samples >= 200


@pytest.mark.parametrize("cause", HEALTHY)
def test_every_healthy_cause_moves_the_loop(cause):
    assert np.ptp(build(ordinary(np.random.default_rng(6), cause)).recording.pv) > 0.0


def test_wide_cases_can_be_built():
    for seed in range(12):
        cause = "stiction" if seed % 2 else HEALTHY[seed // 2]
        assert np.all(np.isfinite(build(wide(np.random.default_rng(seed), cause)).recording.pv))


def test_the_loops_of_a_ladder_differ_in_their_factor_only():
    planned = [p.case for p in plan(Design(1, 0, 0)) if p.factor.startswith("noise")]
    assert len({case.noise_share for case in planned}) == len(planned)
    assert len({replace(case, noise_share=0.0) for case in planned}) == 1


def test_the_same_design_gives_the_same_plan():
    assert list(plan(Design(1, 1, 2, 5))) == list(plan(Design(1, 1, 2, 5)))
    assert list(plan(Design(1, 1, 2, 5))) != list(plan(Design(1, 1, 2, 6)))


def test_the_plan_holds_every_factor_level():
    planned = {(p.factor, p.level) for p in plan(Design(1, 0, 1))}
    assert {(ladder.name, level.label) for ladder in LADDERS for level in ladder.levels} <= planned
    assert (WIDE, "sticky") in planned


def test_shares_are_of_exercised_loops():
    found = tables.group(
        [
            outcome(),
            outcome(verdict="no_stiction", probability=0.1),
            outcome(verdict="inconclusive", probability=None, reliable=False),
            outcome(verdict="no_stiction", exercised=False),
        ]
    )
    assert (found.loops, found.rested) == (3, 1)
    assert found.called == found.abstained == found.wrong_reliable == found.right_reliable == pytest.approx(1 / 3)
    assert found.probability == pytest.approx(0.5)


def test_levels_that_fail_are_named():
    table = tables.rows(
        [outcome("1"), outcome("2", verdict="no_stiction"), outcome("1", sticky=False), outcome("2", sticky=False)]
    )
    assert tables.failing(table).splitlines()[-1] == "| S | 2 (0 % found) | 1 (100 %), 2 (100 %) |"


def test_plots_are_one_well_formed_page_with_nothing_from_outside():
    drawing = plots.page(tables.rows([outcome(level) for level in "<123"]))
    root = ET.fromstring(drawing)  # noqa: S314  (our own drawing)
    assert root.tag.endswith("svg")
    assert drawing.count("http") == 1  # the name space


def test_whole_audits_end_in_the_page(tmp_path):
    picked = [p for p in plan(Design(1, 0, 0)) if p.factor == "valve model"][:2]
    outcomes = run(picked)
    assert [(o.factor, o.sticky) for o in outcomes] == [("valve model", True)] * 2
    assert all(o.probability is not None for o in outcomes)
    page = tmp_path / "TESTBENCH.md"
    page.write_text("before\n<!-- tables: begin -->\nold\n<!-- tables: end -->\nafter\n")
    command.write(tmp_path, command.document(outcomes), "<svg/>")
    text = page.read_text()
    assert text.startswith("before")
    assert text.endswith("after\n")
    assert "old" not in text
    assert "### Valve model" in text


def test_what_pv_tells_by_its_turns_is_not_held_for_the_valves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three healthy loops of this plant are accused reliably by their own records where it is not asked."""
    assert not neighbours.hear(neighbours.audited(1350)).accused
    monkeypatch.setattr(Asked, "beside", lambda self, _: self)
    assert len(neighbours.hear(neighbours.audited(1350)).accused) == 3


def test_plants_are_ten_seeds_apart_and_heard_each_and_all_together(monkeypatch, capsys):
    monkeypatch.setattr(neighbours, "audited", lambda seed: {f"{seed} a": seed, f"{seed} b": seed})
    monkeypatch.setattr(neighbours, "hear", sorted)
    monkeypatch.setattr(neighbours, "report", lambda heard, sources: f"{sources}: {heard}")
    assert neighbours.main(["--plants", "2", "--seed", "1000"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "2: [['1000 a', '1000 b'], ['1010 a', '1010 b']]",
        "as one plant of 4 loops: 2: [['1000 a', '1000 b', '1010 a', '1010 b']]",
    ]


def test_a_plant_heard_together_accuses_fewer_healthy_neighbours():
    heard = [neighbours.hear(neighbours.audited(seed)) for seed in (1010, 1110)]
    assert all(one.accused and not one.left for one in heard)
    assert all(one.named == one.kept == one.relied_on for one in heard)
    told = neighbours.report(heard, 2)
    assert "; sticking valves relied on 2, 2 beside their neighbours; named as the source 2" in told
