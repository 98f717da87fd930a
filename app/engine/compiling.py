"""Short made-up recordings that run every kernel of an audit once, so that the first real one compiles nothing."""

from collections.abc import Iterator

import numpy as np

from app.engine.audit import audit
from app.engine.audit_config import AuditConfig
from app.engine.causality.outside_corners import outside_corners
from app.engine.causality.own_cycle import own_cycle
from app.engine.long_records.stretches import newest_moving
from app.engine.preparation import prepare
from app.engine.recording import FloatArray, Recording, UniformRecord
from app.engine.reference.reliability import climb

SAMPLES = 300
SEARCHED_SAMPLES = 1000


def audits() -> None:
    """Whole audits: all kernels that an audit has."""
    for recording in recordings():
        audit(recording)
    search_for_stems()


def identifications() -> None:
    """The reference alone: half of the work of compiling."""
    config = AuditConfig()
    for recording in recordings():
        part = newest_moving(prepare(recording).fitness.audited, config.max_samples)  # which takes no verdict
        climb(part, config.ladder, config.hammerstein)


def verdicts() -> None:
    """All but the reference: the other half."""
    for recording in recordings():
        audit(recording, with_reference=False)
    search_for_stems()


def search_for_stems() -> None:
    """Of a record with noise, as its own cycle and corners from outside are: those below foretell themselves so well
    that no stem is sought in them.
    """
    steps = np.arange(SEARCHED_SAMPLES)
    noise = np.random.default_rng(0).normal(size=(2, len(steps)))
    pv, op = np.sin(steps / 6.0) + noise
    record = UniformRecord(1.0, pv, op, None, np.zeros(len(steps), dtype=np.bool_))
    own_cycle(record, 38.0)
    outside_corners(record, 38.0)


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
