"""Rivals in the order of what they are worth, each as near to PV as its likelihood allows."""

from dataclasses import replace

from app.engine.mismatch.block import Block, Part
from app.engine.mismatch.compete import Rival, Scanned, rivals
from app.engine.mismatch.fitting import Fit
from app.engine.mismatch.free_run import by_free_run
from app.engine.mismatch.kindred import with_kindred
from app.engine.mismatch.worth import no_worse, worth


def ranked(
    found: Fit,
    blocks: tuple[Block, ...],
    carried: tuple[Part, ...] = (),
    surveyed: tuple[Scanned, ...] | None = None,
) -> tuple[Rival, ...]:
    competed = tuple(reconciled(rival) for rival in rivals(found, blocks, carried, surveyed))
    if not competed:
        return ()
    every = with_kindred(competed, max(competed, key=worth), blocks)
    return by_worth(every)


def by_worth(rivals_: tuple[Rival, ...]) -> tuple[Rival, ...]:
    return tuple(sorted(rivals_, key=lambda rival: -worth(rival)))


def reconciled(rival: Rival) -> Rival:
    """A rival whose likelihood had gone with a worse free run, fitted again by its free run; as it was where that
    loses what it gained.
    """
    if no_worse(rival.fit, rival.over) or rival.score <= 0.0:
        return rival
    other = by_free_run(rival.fit)
    gain = other.likelihood - rival.over.likelihood
    better = no_worse(other, rival.over) and gain > rival.block.penalty
    return replace(rival, fit=other, gain=gain) if better else rival


def best_of_each_code(ranking: tuple[Rival, ...]) -> tuple[Rival, ...]:
    first: dict[str, Rival] = {}
    for rival in ranking:
        first.setdefault(rival.block.code, rival)
    return tuple(first.values())
