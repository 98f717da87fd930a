"""PV of one valve beside OP of another: signals of real loops of which nothing must be said reliably."""

from collections.abc import Iterator

import numpy as np

from app.engine.judgement import Judgement
from app.engine.preparation import prepare
from app.engine.recording import Recording
from app.engine.verdict.judging import judge
from app.lab.evaluation.recordings import Labelled

_FEWEST_SAMPLES = 300


def strangers(loops: list[Labelled], count: int, seed: int) -> Iterator[Recording]:
    """`count` draws of two recordings, without those of one valve and those with fewer than 300 samples in common."""
    rng = np.random.default_rng(seed)
    records = [(loop.valve, loop.fitness.record) for loop in loops if loop.fitness.record is not None]
    for _ in range(count):
        first, second = rng.choice(len(records), 2, replace=False)
        (valve, one), (other_valve, other) = records[first], records[second]
        samples = min(one.samples, other.samples)
        if valve != other_valve and samples >= _FEWEST_SAMPLES:
            yield Recording("strangers", np.arange(float(samples)), one.pv[:samples], other.op[:samples])


def judged(pair: Recording) -> Judgement | None:
    """What the engine says of such a pair, None where it takes it for no record that could be audited."""
    prepared = prepare(pair)
    if prepared.oscillation is None or not prepared.fitness.auditable:
        return None
    return judge(prepared.fitness.audited, prepared.oscillation, prepared.fitness)
