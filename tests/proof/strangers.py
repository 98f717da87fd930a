"""PV of one loop beside OP of another: records that tell nothing of any physics."""

from dataclasses import replace

from tests.proof.cases import make_case
from tests.proof.generator import Case, Truth

APART = 100_000  # seeds between the two loops


def mixed_up(seed: int, foreign: bool, samples: int | None = None) -> Case:
    """OP, set point and simulation of a clean loop, as long as both are, and PV of another one."""
    own, other = (make_case(at, (), foreign, samples=samples) for at in (seed, seed + APART))
    n = min(len(own.pv), len(other.pv))
    taken = {column: getattr(own, column)[:n] for column in ("sp", "op", "trace")}
    return replace(own, **taken, pv=other.pv[:n], measured=(), truth=Truth(()))
