"""Contenders in the order of what they are worth, each as near to PV as its likelihood allows."""

from app.engine.mismatch.compete.competition import Contender, Scanned, contenders
from app.engine.mismatch.compete.kindred import with_kindred
from app.engine.mismatch.compete.worth import no_worse, worth
from app.engine.mismatch.fit.fitting import Fit
from app.engine.mismatch.fit.free_run import by_free_run
from app.engine.mismatch.loop.block import Block, Part


def ranked(
    found: Fit,
    blocks: tuple[Block, ...],
    carried: tuple[Part, ...] = (),
    surveyed: tuple[Scanned, ...] | None = None,
) -> tuple[Contender, ...]:
    competed = tuple(reconciled(contender) for contender in contenders(found, blocks, carried, surveyed))
    if not competed:
        return ()
    every = with_kindred(competed, max(competed, key=worth), blocks)
    return by_worth(every)


def by_worth(contenders_: tuple[Contender, ...]) -> tuple[Contender, ...]:
    return tuple(sorted(contenders_, key=lambda contender: -worth(contender)))


def reconciled(contender: Contender) -> Contender:
    """A contender whose likelihood had gone with a worse free run, fitted again by its free run; as it was where that
    loses what it gained.
    """
    if no_worse(contender.fit, contender.over) or contender.score <= 0.0:
        return contender
    other = Contender(by_free_run(contender.fit), contender.over)
    better = no_worse(other.fit, other.over) and other.gain > contender.block.penalty
    return other if better else contender


def best_of_each_code(ranking: tuple[Contender, ...]) -> tuple[Contender, ...]:
    first: dict[str, Contender] = {}
    for contender in ranking:
        first.setdefault(contender.block.code, contender)
    return tuple(first.values())
