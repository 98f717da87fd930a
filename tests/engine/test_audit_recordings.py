"""The audit on real recordings: what plants send is answered in any unit, and refused only where nothing moves."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from app.engine.recording import Recording
from tests.audited import audited

pytestmark = pytest.mark.shared

DEAD = {"PLANT-RHT-7050-342_FIC10112_0630_0002", "PLANT-RHT-7050-342_FIC10112_0702_0009"}
OF_ALL_KINDS = (
    "CHEM1",  # flow, textbook
    "CHEM8",  # OP on eight levels
    "CHEM44",  # OP at its minimum for a third of the record
    "CHEM28",  # irregular sampling
    "PAP3",  # integrating level
    "PLANT-2CDU-7040-311_FIC31102_0628_0002",  # OP and PV hold still most of the time
    "SACAC-saturation-T-oilgas-2002",
)


def recording(file: Path) -> Recording:
    """The columns as they are; stamps that do not increase are left out."""
    table = pl.read_csv(file, infer_schema_length=None)
    stamps = table["time"]
    if stamps.dtype == pl.String:
        stamps = stamps.str.to_datetime().dt.epoch("ms") / 1000.0
    time_s = stamps.cast(pl.Float64).to_numpy()
    kept = np.concatenate(([True], np.diff(time_s) > 0))
    pv, op = (table[name].cast(pl.Float64).to_numpy()[kept] for name in ("PV", "OP"))
    automatic = (table["MODE"] == "AUTO").to_numpy()[kept] if "MODE" in table.columns else None
    return Recording(file.stem, time_s[kept] - time_s[0], pv, op, automatic=automatic)


def test_only_dead_recordings_are_refused(shared_dir):
    files = sorted((shared_dir / "recordings").glob("*.csv"))
    audits = [audited(recording(file)) for file in files if file.stem != "labels"]
    assert len(audits) == 78
    refused = {a.recording: [r.code for r in a.judgement.reasons] for a in audits if a.reference is None}
    assert refused == {name: ["pv_does_not_answer", "pv_flat"] for name in DEAD}


@pytest.mark.parametrize("name", OF_ALL_KINDS)
@pytest.mark.parametrize(("pv_unit", "op_unit"), [((-1.8, 32.0), (1.0, 0.0)), ((1e-3, 273.15), (-0.16, 20.0))])
def test_units_change_no_verdict_of_a_real_recording(shared_dir, name, pv_unit, op_unit):
    original = recording(shared_dir / "recordings" / f"{name}.csv")
    changed = replace(original, pv=original.pv * pv_unit[0] + pv_unit[1], op=original.op * op_unit[0] + op_unit[1])
    first, second = audited(original).judgement, audited(changed).judgement
    assert (first.verdict, first.reliability) == (second.verdict, second.reliability)
    assert first.stiction_probability == pytest.approx(second.stiction_probability, abs=1e-6)


def test_a_record_of_three_nights_is_audited_within_one(shared_dir):
    """BAS1 holds four stretches a day apart, its scans up to a tenth of a second late."""
    fitness = audited(recording(shared_dir / "recordings" / "BAS1.csv")).fitness
    assert (fitness.gaps, fitness.record.samples, fitness.filled_share) == (3, 10000, 0.0)
    assert fitness.record.sampling_interval_s == pytest.approx(1.0, abs=0.01)


def test_irregular_scans_are_put_on_a_grid_and_said(shared_dir):
    fitness = audited(recording(shared_dir / "recordings" / "CHEM28.csv")).fitness
    assert 0.0 < fitness.filled_share < 0.1
    assert "irregular_sampling" in [f.code for f in fitness.findings if f.outcome == "fail"]
