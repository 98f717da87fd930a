"""Units, offsets, signs and time units change no answer; methods are pure."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.engine.corroborate import METHODS, corroborate
from app.engine.oscillation import detect
from app.engine.recording import UniformRecord

SCALES = st.floats(1e-3, 1e3).flatmap(lambda s: st.sampled_from((s, -s)))
OFFSETS = st.floats(-1e3, 1e3)


def loop(kind: int, noise: float, seed: int, resolution: float = 0.0) -> UniformRecord:
    """A loop in one of three wave forms with noise and drift, PV in steps of `resolution`, 1200 samples at 1 s."""
    rng = np.random.default_rng(seed)
    t = np.arange(1200) / 37.7
    sine, cosine = np.sin(2 * np.pi * t), np.cos(2 * np.pi * t)
    pv, op = ((sine, -sine), (-np.sign(cosine), np.arcsin(sine)), (cosine, sine + 0.3 * sine**2))[kind]
    pv = pv + noise * rng.standard_normal(1200) + 0.02 * t
    op = op + noise * rng.standard_normal(1200)
    if resolution > 0.0:
        pv = np.round(pv / resolution) * resolution
    return UniformRecord(1.0, pv, op, np.full(1200, 0.5), np.zeros(1200, dtype=bool))


@settings(max_examples=40)
@given(
    kind=st.integers(0, 2),
    noise=st.floats(0.05, 0.5),
    resolution=st.sampled_from((0.0, 0.25)),
    seed=st.integers(0, 50),
    pv=st.tuples(SCALES, OFFSETS),
    op=st.tuples(SCALES, OFFSETS),
    time_scale=st.floats(1e-2, 1e4),
    integrating=st.sampled_from((True, False, None)),
)
def test_units_signs_and_time_units_change_no_answer(kind, noise, resolution, seed, pv, op, time_scale, integrating):
    r = loop(kind, noise, seed, resolution)
    changed = UniformRecord(
        r.sampling_interval_s * time_scale, r.pv * pv[0] + pv[1], r.op * op[0] + op[1], r.sp * pv[0] + pv[1], r.filled
    )
    first, second = (corroborate(x, detect(x), integrating) for x in (r, changed))
    for a, b in zip(first, second, strict=True):
        assert (a.applies, a.says, a.why_not) == (b.applies, b.says, b.why_not)
        assert (a.statistic is None) == (b.statistic is None)
        if a.statistic is not None:
            assert a.statistic == pytest.approx(b.statistic, abs=1e-6)


def test_nothing_is_mutated_and_the_same_record_gives_the_same_answer():
    r = loop(1, 0.1, 3)
    pv, op, sp = r.pv.copy(), r.op.copy(), r.sp.copy()
    o = detect(r)
    assert corroborate(r, o, False) == corroborate(r, o, False)
    assert len(corroborate(r, o, False)) == len(METHODS)
    for before, after in ((pv, r.pv), (op, r.op), (sp, r.sp)):
        np.testing.assert_array_equal(before, after)
