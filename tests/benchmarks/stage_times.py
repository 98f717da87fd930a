"""What an audit costs, stage by stage, in processor time of one thread after warm-up."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.engine.audit import Audit, AuditConfig, audit, ladder_for
from app.engine.corroborate import corroborate
from app.engine.features import extract
from app.engine.fitness import assess
from app.engine.key_figures import compute as key_figures_of
from app.engine.long_records.episodes import find
from app.engine.long_records.stretches import newest_moving
from app.engine.oscillation import detect
from app.engine.preparation import prepare
from app.engine.quantification import quantify
from app.engine.recording import Recording
from app.engine.reference import hammerstein
from app.engine.reference.reliability import Reference, climb
from app.engine.rivals import compete
from app.engine.verdict import judging

WHOLE = "whole audit"


@dataclass(frozen=True)
class StageTime:
    """One stage. inside: the stage that it is part of, or None. run: whether the audit of this recording runs it."""

    stage: str
    inside: str | None
    milliseconds: float
    run: bool


def stage_times(recording: Recording, config: AuditConfig | None = None, repeats: int = 5) -> list[StageTime]:
    """Medians over `repeats` calls, the whole audit first; only that where the recording is not auditable."""
    config = config or AuditConfig()
    answer = audit(recording, config)
    times = [StageTime(WHOLE, None, median_ms(lambda: audit(recording, config), repeats), True)]
    if answer.reference is None:
        return times
    for stage, inside, run, work in _stages(recording, config, answer, answer.reference):
        times.append(StageTime(stage, inside, median_ms(work, repeats), run))
    return times


def median_ms(work: Callable[[], object], repeats: int) -> float:
    """Median processor time of this thread in ms, after one call to warm up."""
    work()
    spent = []
    for _ in range(repeats):
        start = time.thread_time()
        work()
        spent.append(time.thread_time() - start)
    return 1000.0 * float(np.median(spent))


def _stages(
    recording: Recording, config: AuditConfig, answer: Audit, reference: Reference
) -> list[tuple[str, str | None, bool, Callable[[], object]]]:
    prepared = prepare(recording, config.fitness)
    fitness, oscillation = prepared.fitness, prepared.oscillation
    assert oscillation is not None
    record, audited = newest_moving(fitness.audited, config.max_samples), fitness.audited
    features = extract(audited, oscillation)
    assert features is not None
    last = reference.last
    space = last.space if last.two is None else last.two.space
    return [
        ("fitness", None, True, lambda: assess(recording, config.fitness)),
        ("oscillation", None, True, lambda: detect(audited)),
        ("verdict", None, True, lambda: judging.judge(audited, oscillation, fitness, config.judgement)),
        ("features", "verdict", True, lambda: extract(audited, oscillation)),
        ("rivals", "verdict", True, lambda: compete(audited, oscillation, features)),
        ("corroboration", "verdict", True, lambda: corroborate(audited, oscillation)),
        ("reference", None, True, lambda: climb(record, ladder_for(answer.judgement, config), config.hammerstein)),
        (
            "one-parameter, last space",
            "reference",
            True,
            lambda: hammerstein.identify_one_parameter(record, last.space, config.hammerstein),
        ),
        (
            "two-parameter",
            "reference",
            last.two is not None,
            lambda: hammerstein.Identification(record, config.hammerstein).two_parameter(space),
        ),
        ("size", None, answer.stiction_size is not None, lambda: quantify(record, oscillation)),
        ("episodes", None, True, lambda: find(audited, oscillation, config.episodes)),
        ("key figures", None, True, lambda: key_figures_of(recording)),
        ("fingerprint", None, True, recording.fingerprint),
    ]
