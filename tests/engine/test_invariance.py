"""What must not change a verdict: units, offsets and signs of PV and OP, units of time, columns of other things."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from app.engine.audit import Audit, audit
from app.engine.recording import Recording
from app.engine.simulate import LinearValve, LoopSpec, Pid, Signal, TwoParameterValve, Wave, first_order, simulate_loop
from app.ingest import read_recordings
from app.lab.evaluation.recordings import read

_STICKY = LoopSpec(
    plant=first_order(1.0, 10.0, 3.0),
    controller=Pid(0.8, 10.0),
    valve=TwoParameterValve(5.0, 2.0),
    noise=Signal(noise_sd=0.05),
    load=Signal(value=5.0, noise_sd=0.1, noise_tau_s=60.0),
    settle_s=500.0,
)
_SIMULATED = {
    "sticky": _STICKY,
    "wave": replace(_STICKY, valve=LinearValve(), load=Signal(noise_sd=0.2, waves=(Wave(2.0, 70.0),))),
    "wandering": replace(_STICKY, valve=LinearValve(), load=Signal(noise_sd=3.0, noise_tau_s=60.0)),
}
_RECORDED = ("CHEM1", "CHEM3", "CHEM21", "CHEM35", "PAP2", "PAP3", "CHEM28")
CHANGES = {
    "PV in other units": lambda r: replace(r, pv=1.8 * r.pv + 32.0, sp=None if r.sp is None else 1.8 * r.sp + 32.0),
    "PV alone in other units": lambda r: replace(r, pv=1.8 * r.pv + 32.0),
    "PV alone tiny": lambda r: replace(r, pv=1e-9 * r.pv),
    "PV alone reversed": lambda r: replace(r, pv=7.0 - r.pv),
    "PV tiny": lambda r: replace(r, pv=1e-6 * r.pv, sp=None if r.sp is None else 1e-6 * r.sp),
    "PV reversed": lambda r: replace(r, pv=7.0 - r.pv, sp=None if r.sp is None else 7.0 - r.sp),
    "OP in milliamperes": lambda r: replace(r, op=0.16 * r.op + 4.0),
    "OP large": lambda r: replace(r, op=3e4 * r.op),
    "OP reversed": lambda r: replace(r, op=100.0 - r.op),
    "all at once": lambda r: replace(
        r, pv=-250.0 * r.pv, op=-0.01 * r.op + 3.0, sp=None if r.sp is None else -250.0 * r.sp
    ),
    "minutes": lambda r: replace(r, time_s=60.0 * r.time_s),
    "milliseconds": lambda r: replace(r, time_s=1e-3 * r.time_s),
    "another day": lambda r: replace(r, time_s=r.time_s + 86_400.0),
    "other signals": lambda r: replace(r, others={"TI-99": np.cos(np.arange(r.samples)), "flow": np.ones(r.samples)}),
}


def recording(name: str, shared_dir: Path) -> Recording:
    if name in _SIMULATED:
        return simulate_loop(_SIMULATED[name], 1200.0, 1.0, seed=3).recording(name)
    path = shared_dir / "recordings" / f"{name}.csv"
    if not path.exists():
        pytest.skip(f"{path.name} is not there")
    return read(path)


@cache
def plain(name: str, shared_dir: Path) -> Audit:
    return audit(recording(name, shared_dir))


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("name", [*_SIMULATED, *_RECORDED])
def test_verdict_reliability_and_probability_stay(name, change, shared_dir):
    before = plain(name, shared_dir)
    after = audit(CHANGES[change](recording(name, shared_dir)))
    for field in ("verdict", "reliability", "likely_cause"):
        assert getattr(after.judgement, field) == getattr(before.judgement, field), field
    assert [r.code for r in after.judgement.reasons] == [r.code for r in before.judgement.reasons]
    assert after.judgement.stiction_probability == pytest.approx(before.judgement.stiction_probability, abs=1e-5)
    assert (after.stiction_size is None) == (before.stiction_size is None)
    if before.stiction_size is not None:
        assert after.stiction_size.identifiable == before.stiction_size.identifiable
        ratio = after.stiction_size.S / after.op_span / (before.stiction_size.S / before.op_span)
        assert ratio == pytest.approx(1.0, rel=1e-5)


def written(path: Path, loop: Recording, other_columns: bool) -> Path:
    """The recording as a file, with columns of other things between and after its own where asked for."""
    head, rows = "time,PV,OP", [loop.time_s, loop.pv, loop.op]
    if other_columns:
        rng = np.random.default_rng(0)
        head = "time,TI-4711,PV,OP,Remark,XI-3"
        rows = [loop.time_s, 20.0 + rng.normal(size=loop.samples), loop.pv, loop.op, loop.time_s % 7, loop.pv[::-1]]
    np.savetxt(path, np.column_stack(rows), delimiter=",", header=head, comments="", fmt="%.12g")
    return path


@pytest.mark.parametrize("name", ["sticky", "wandering"])
def test_columns_of_other_things_in_the_file_change_nothing(name, tmp_path, shared_dir):
    loop = recording(name, shared_dir)
    answers = []
    for other_columns in (False, True):
        path = written(tmp_path / f"{name}_{other_columns}.csv", loop, other_columns)
        answers.append(audit(read_recordings(path).recordings[0]).judgement)
    assert answers[0] == answers[1]
