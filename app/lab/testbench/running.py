"""Runs a design: simulate, audit, note; one process unless more are asked for."""

import multiprocessing
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

from app.engine.audit import audit
from app.errors import DataError
from app.lab.testbench.building import build
from app.lab.testbench.ladders import Planned


@dataclass(frozen=True)
class Outcome:
    """What the audit said of one loop. probability: None where the audit gave none.

    exercised: False for a sticky valve that hardly changed its direction: nothing can be told from its record.
    """

    factor: str
    level: str
    sticky: bool
    exercised: bool
    verdict: str
    probability: float | None
    reliable: bool

    @property
    def abstained(self) -> bool:
        return self.verdict in ("inconclusive", "not_auditable")

    @property
    def wrong(self) -> bool:
        return not self.abstained and (self.verdict == "stiction") != self.sticky


def run(planned: Iterable[Planned], jobs: int = 1) -> list[Outcome]:
    """The outcomes in the order of the plan, without the loops that ran away."""
    if jobs == 1:
        return [outcome for outcome in map(_one, planned) if outcome is not None]
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
        return [outcome for outcome in pool.map(_one, planned, chunksize=16) if outcome is not None]


def _one(planned: Planned) -> Outcome | None:
    try:
        built = build(planned.case)
    except DataError as error:
        if error.code != "simulation_unstable":
            raise
        return None
    judgement = audit(built.recording).judgement
    return Outcome(
        factor=planned.factor,
        level=planned.level,
        sticky=planned.case.sticky,
        exercised=built.exercised,
        verdict=judgement.verdict,
        probability=judgement.stiction_probability,
        reliable=judgement.reliability == "reliable",
    )
