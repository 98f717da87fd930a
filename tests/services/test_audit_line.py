"""The audit line in the form that scripts and dashboards rely on."""

import json
from dataclasses import replace
from datetime import datetime, timedelta, timezone

import numpy as np
import pytest

from app.engine.audit import audit
from app.engine.audit_config import AuditConfig
from app.engine.recording import Recording
from app.services.audit_json.detail import detail
from app.services.audit_json.line import KNOWN_TO_A_SERVICE, audit_line, reliability_row
from app.services.audit_json.models import AuditLine, ReliabilityRow
from app.services.moments import iso_utc
from app.services.telling.reasons import reasons_of

CONTRACT = [
    "recording", "loop", "samples", "sampling_interval_s", "verdict", "stiction_probability", "reliability", "reasons",
    "yper_pct", "yper_raw_pct", "table2_reading", "hammerstein", "stiction_band_pct_of_op_range", "likely_cause",
    "engine_version", "elapsed_s",
]  # fmt: skip
HAMMERSTEIN = ["d", "S", "J", "na", "nb", "nc", "rmse", "rmse_without_stiction", "search_space", "widenings"]


def recording(n: int = 400, pv_scale: float = 1.0) -> Recording:
    t = np.arange(n, dtype=float)
    noise = np.random.default_rng(1).normal(size=(2, n))
    pv = 20.0 + np.sin(2 * np.pi * t / 40) + 0.05 * noise[0]
    op = 50.0 + 5.0 * np.cos(2 * np.pi * t / 40) + 0.05 * noise[1]
    return Recording("FC101", t, pv * pv_scale, op)


@pytest.fixture(scope="module")
def audited():
    return audit(recording(), AuditConfig(doubt_above=0.0))  # with the two-parameter model, which few loops need


@pytest.fixture(scope="module")
def refused():
    return audit(replace(recording(), op=np.full(400, 50.0)))


def test_line_has_the_fields_of_the_contract_in_their_order(audited):
    line = audit_line(audited, 0.05)
    assert list(line)[: len(CONTRACT)] == CONTRACT
    assert list(line["hammerstein"])[: len(HAMMERSTEIN)] == HAMMERSTEIN
    assert (line["recording"], line["loop"]) == ("FC101", "FC101")
    assert (line["samples"], line["sampling_interval_s"]) == (400, 1.0)
    assert line["elapsed_s"] == 0.05


def test_a_record_of_three_samples_has_no_health_and_the_line_says_why():
    line = audit_line(audit(recording(3)), 0.05)
    assert (line["verdict"], line["health"]) == ("not_auditable", None)
    told = "not evaluated, because too little was measured: 3 samples; at least 100 are needed"
    row = reliability_row(line)
    assert (line["health_not_evaluated"], row["health_not_evaluated"]) == (told, told)
    assert (row["health"], row["health_parts"]) == (None, "")


def test_reasons_tell_what_they_rest_on_as_data(audited):
    shape = next(one for one in audit_line(audited, 0.05)["reasons"] if one["code"].startswith("shape_"))
    assert list(shape) == ["code", "text", "statistic", "operator", "threshold", "passed"]
    holds = {">": shape["statistic"] > shape["threshold"], "<": shape["statistic"] < shape["threshold"]}
    assert shape["passed"] is holds[shape["operator"]]
    methods = detail(audited)["methods"]
    assert {tuple(method) for method in methods} == {("method", "applies", "why_not", "statistic", "threshold", "says")}
    (sticky,) = (rival for rival in detail(audited)["rivals"] if rival["code"] == "stiction")
    assert None not in (sticky["explained"], sticky["explained_without_stiction"])


def test_line_of_an_audited_recording_leaves_no_key_figure_out(audited):
    line = audit_line(audited, 0.05, loop="FC-101")
    assert line["loop"] == "FC-101"
    assert line["table2_reading"] == audited.reference.reading
    one = audited.reference.last.one
    hammerstein = line["hammerstein"]
    assert hammerstein["d"] == one.d_best
    assert hammerstein["na"] == one.na[one.best]
    assert hammerstein["nc"] == one.nc[one.best]
    assert len(hammerstein["search_space"]) == 3
    assert hammerstein["S"] is not None
    assert line["stiction_band_pct_of_op_range"] == pytest.approx(100 * one.d_best / np.ptp(recording().op))


def test_line_of_a_refused_recording_is_null_where_nothing_is_known(refused):
    line = audit_line(refused, 0.001)
    assert (line["verdict"], line["reliability"]) == ("not_auditable", "not_reliable")
    assert line["stiction_probability"] is None
    assert set(line["hammerstein"].values()) == {None}
    assert [reason["code"] for reason in line["reasons"]] == ["op_flat"]
    assert line["likely_cause"] == "controller_not_acting"


@pytest.mark.parametrize("which", ["audited", "refused"])
def test_everything_is_json_without_nan(which, request):
    answer = request.getfixturevalue(which)
    for part in (audit_line(answer, 0.1), reliability_row(audit_line(answer, 0.1)), detail(answer)):
        assert json.loads(json.dumps(part, allow_nan=False)) == part


def test_infinite_figures_become_null():
    empty = audit(Recording("x", np.zeros(0), np.zeros(0), np.zeros(0)))
    line = audit_line(empty, 0.0)
    assert (line["samples"], line["sampling_interval_s"]) == (0, None)
    assert json.dumps(line, allow_nan=False)


@pytest.mark.parametrize("which", ["audited", "refused"])
def test_row_is_flat(which, request):
    line = audit_line(request.getfixturevalue(which), 0.1)
    row = reliability_row(line)
    assert all(value is None or isinstance(value, (str, int, float)) for value in row.values())
    assert {f"hammerstein_{name}" for name in HAMMERSTEIN} <= set(row)
    assert set(CONTRACT) - {"hammerstein"} <= set(row)
    assert row["hammerstein_d"] == line["hammerstein"]["d"]
    assert [row[name] for name in KNOWN_TO_A_SERVICE] == [None] * 10
    assert row["reasons"].split(";") == [reason["code"] for reason in line["reasons"]]
    assert reasons_of(row) == [reason["text"] for reason in line["reasons"]]


def test_search_space_in_a_row_is_one_word(audited):
    line = audit_line(audited, 0.1)
    assert reliability_row(line)["hammerstein_search_space"] == "x".join(map(str, line["hammerstein"]["search_space"]))


def test_every_field_says_what_it_is():
    for model in (AuditLine, ReliabilityRow):
        for name, schema in model.model_json_schema()["properties"].items():
            assert schema.get("description"), f"{model.__name__}.{name}"


def test_line_fits_its_own_model(audited):
    line = audit_line(audited, 0.1)
    assert AuditLine.model_validate(line).model_dump(mode="json") == line
    assert set(line) == set(AuditLine.model_fields)


def test_times_are_told_in_utc():
    vienna = timezone(timedelta(hours=1))
    assert iso_utc(datetime(2026, 1, 31, 4, 0, 0, 250000, tzinfo=vienna)) == "2026-01-31T03:00:00.250Z"
    assert iso_utc(None) is None
    with pytest.raises(ValueError, match="without a zone"):
        iso_utc(datetime(2026, 1, 31))


def test_detail_keeps_curves_surface_spectra_and_findings(audited):
    stored = detail(audited)
    rung = stored["rungs"][-1]
    one, two = audited.reference.last.one, audited.reference.last.two
    np.testing.assert_allclose(rung["one_parameter"]["rmse"], one.rmse, rtol=1e-4)
    np.testing.assert_allclose(rung["two_parameter"]["rmse"], two.rmse, rtol=1e-4)
    assert len(rung["search_space"]) == 3
    assert len(stored["spectra"]["frequency_hz"]) == 200
    assert {finding["code"] for finding in stored["findings"]} >= {"pv_flat", "op_flat", "gaps", "few_cycles"}


def test_spectra_are_thinned_to_what_a_chart_shows():
    spectra = detail(audit(recording(3000)))["spectra"]
    assert {len(values) for values in spectra.values()} == {256}


def test_a_new_field_needs_no_second_place(audited, monkeypatch):
    monkeypatch.setattr("app.services.audit_json.line.LINE_ORDER", ("recording", "loop"))
    line = audit_line(audited, 0.1)
    assert list(line)[:2] == ["recording", "loop"]
    assert set(line) == set(AuditLine.model_fields)


def test_both_valve_models_answer_in_line_and_row(audited):
    last = audited.reference.last
    hammerstein = audit_line(audited, 0.1)["hammerstein"]
    assert hammerstein["one_stiction"] == last.one.stiction
    assert (hammerstein["two_stiction"], hammerstein["two_rmse"]) == (last.two.stiction, last.two.rmse_best)
    row = reliability_row(audit_line(audited, 0.1))
    assert row["hammerstein_two_rmse"] == last.two.rmse_best


def test_a_two_parameter_model_that_did_not_run_has_no_answer(audited):
    last = replace(audited.reference.rungs[-1], two=None)
    without = replace(audited, reference=replace(audited.reference, rungs=(last,)))
    hammerstein = audit_line(without, 0.1)["hammerstein"]
    assert (hammerstein["S"], hammerstein["two_stiction"], hammerstein["two_rmse"]) == (None, None, None)
    assert hammerstein["one_stiction"] is not None


def test_winner_and_runner_up_lead_the_rivals_of_the_line(audited):
    line = audit_line(audited, 0.1)
    assert {rival["code"] for rival in line["rivals"]} >= {"stiction", "set_point_following", "saturated_op"}
    assert line["rival_winner"] == line["rivals"][0]["code"]
    assert line["rivals"][0]["score"] >= 0.5
    assert detail(audited)["rivals"] == line["rivals"]


def test_a_refused_recording_has_no_rivals(refused):
    line = audit_line(refused, 0.1)
    assert (line["rival_winner"], line["rival_runner_up"], line["rivals"], line["episodes"]) == (None, None, [], [])


def test_fitness_of_the_data_is_told_in_shares(audited):
    row = reliability_row(audit_line(audited, 0.1))
    assert row["samples_per_cycle"] == pytest.approx(40, rel=0.05)
    assert row["cycles"] == pytest.approx(10, rel=0.05)
    assert (row["filled_share"], row["missing_share"]) == (0.0, 0.0)
    assert row["set_point_activity"] is None
    with_sp = audit(replace(recording(), sp=np.full(400, 20.0)))
    assert audit_line(with_sp, 0.1)["set_point_activity"] == 0.0
