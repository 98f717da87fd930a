"""Compiles the kernels of an audit, or loads them: a first audit otherwise pays for it out of its loop's time limit."""

from collections.abc import Callable, Iterator

import numpy as np

from app import kernel_cache
from app.engine import key_figures
from app.engine.audit import audit
from app.engine.audit_config import AuditConfig
from app.engine.long_records.episodes import find
from app.engine.preparation import prepare
from app.engine.quantification import quantify
from app.engine.recording import FloatArray, Recording
from app.engine.reference.reliability import climb
from app.engine.verdict import judging

SAMPLES = 300


def warm_up(deadline_s: float | None = None, waits: Callable[[], None] | None = None) -> None:
    """Of several processes that would compile for one cache, the first does; deadline_s, waits: of who waits for it, as
    in `kernel_cache.one_at_a_time`."""
    with kernel_cache.one_at_a_time(deadline_s, waits):
        audits()


def audits() -> None:
    """Whole audits: all kernels that an audit has."""
    for recording in recordings():
        audit(recording)


def identifications() -> None:
    """The reference alone: half of the work of compiling."""
    config = AuditConfig()
    for recording in recordings():
        climb(prepare(recording, config.fitness).fitness.audited, config.ladder, config.hammerstein)


def verdicts() -> None:
    """All but the reference: the other half."""
    config = AuditConfig()
    for recording in recordings():
        prepared = prepare(recording, config.fitness)
        fitness, oscillation = prepared.fitness, prepared.oscillation
        assert oscillation is not None  # noqa: S101 - both of them swing
        judging.judge(fitness.audited, oscillation, fitness, config.judgement)
        find(fitness.audited, oscillation, config.episodes)
        quantify(fitness.audited, oscillation, True, config.quantification)
        key_figures.compute(recording)


def recordings() -> Iterator[Recording]:
    """Two loops under a set point that moves, for some kernels run for no other."""
    steps = np.arange(SAMPLES)
    sp = 20.0 + 0.5 * np.sign(np.sin(steps / 50.0))
    op = 50.0 + 5.0 * np.sin(steps / 6.0) + np.sin(steps * 1.7)
    pv = 20.0 + 2.0 * np.sin(steps / 6.0 - 0.8) + 0.1 * np.cos(steps * 2.3)
    yield _made_up(pv, op, sp)
    # A stem that sticks and jumps under a controller that integrates: what leaves doubt goes through the whole search.
    sawtooth = np.abs(steps % 40 - 20.0) / 2.0
    jumps = np.convolve(np.where((steps + 4) % 40 < 20, 2.0, -2.0), np.full(4, 0.25), "same")
    noise = 0.05 * np.sin(steps * 1.7) + 0.03 * np.cos(steps * 2.3)
    yield _made_up(20.0 + jumps + noise, 50.0 + sawtooth, sp)


def _made_up(pv: FloatArray, op: FloatArray, sp: FloatArray) -> Recording:
    return Recording("warm-up", np.arange(SAMPLES, dtype=np.float64), pv, op, sp)
