"""`python -m app.lab.testbench.sizing`: error of S and coverage of its intervals on loops whose S is known.

Two kinds of loops: `fitted`, from the generator on which the numbers of the quantification were chosen, and `verify`,
from the test bench: other plants, controllers, valves (physical and one-parameter among them), loads, noises, sampling.
"""

import argparse
import itertools
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from app.engine.oscillation import detect
from app.engine.quantification import StictionSize, quantify
from app.engine.recording import FloatArray, UniformRecord
from app.errors import DataError
from app.lab.testbench.building import build
from app.lab.testbench.case import PLANTS, Case, log_uniform, ordinary
from app.lab.testbench.known_loops import known_loops

_VERIFY_VALVES = ("he", "choudhury", "kano", "one_parameter", "physical")


@dataclass(frozen=True, eq=False)
class Known:
    """A record with its true S in the unit of OP and the kind of its valve."""

    record: UniformRecord
    S: float
    valve: str


@dataclass(frozen=True)
class Sized:
    """What was said of one loop. covered: whether the 50, 80 and 95 % intervals hold S."""

    valve: str
    identifiable: bool
    error: float
    covered: tuple[bool, ...]


def fitted(count: int, seed: int) -> Iterator[Known]:
    """Sticky loops of the generator that the verdict's networks learn from: He's valve, flows to levels."""
    loops = (loop for loop in known_loops(3 * count + 20, seed) if loop.cause == "stiction")
    return (Known(loop.record, loop.S, "he") for loop, _ in zip(loops, range(count), strict=False))


def verify(count: int, seed: int) -> Iterator[Known]:
    """Sticky loops of the test bench with every factor drawn over a wide, not the widest, range."""
    rng = np.random.default_rng(seed)
    drawn = (known(_drawn(rng)) for _ in itertools.count())
    return itertools.islice(filter(None, drawn), count)


def known(case: Case) -> Known | None:
    """None where the loop runs away or its valve hardly moves."""
    try:
        built = build(case)
    except DataError:
        return None
    if not built.exercised:
        return None
    r = built.recording
    record = UniformRecord(r.time_s[1] - r.time_s[0], r.pv, r.op, r.sp, np.zeros(r.samples, dtype=np.bool_))
    return Known(record, case.size_pct / (2.0 if case.valve == "one_parameter" else 1.0), case.valve)


def _drawn(rng: np.random.Generator) -> Case:
    return replace(
        ordinary(rng, "stiction"),
        plant=PLANTS[rng.integers(len(PLANTS))],
        controller=("PI", "PI", "PID", "P")[rng.integers(4)],
        tightness=float(rng.uniform(0.08, 0.75)),
        size_pct=log_uniform(rng, 1.0, 20.0),
        J_ratio=(0.0, 0.1, 0.3, 0.6, 1.0)[rng.integers(5)],
        valve=_VERIFY_VALVES[rng.integers(len(_VERIFY_VALVES))],  # type: ignore[arg-type]
        noise_share=(0.0, 0.03, 0.1, 0.25)[rng.integers(4)],
        points_per_cycle=log_uniform(rng, 8.0, 250.0),
        cycles=float(rng.uniform(6.0, 40.0)),
        load=("coloured", "sine", "steps")[rng.integers(3)],
        load_share=log_uniform(rng, 0.02, 0.4),
        set_point=("constant", "constant", "few_steps")[rng.integers(3)],
        resolution_share=(0.0, 0.0, 0.05)[rng.integers(3)],
    )


def sized(loop: Known) -> Sized | None:
    """None where nothing is said."""
    size = quantify(loop.record, detect(loop.record))
    return None if size is None else _sized(loop, size)


def _sized(loop: Known, size: StictionSize) -> Sized:
    covered = tuple(interval.low <= loop.S <= interval.high for interval in size.S_intervals)
    return Sized(loop.valve, size.identifiable, size.S / loop.S - 1.0, covered)


def table(answers: list[Sized], of: int) -> str:
    """One row for what is identifiable, one a valve in it, one for the rest; behind ± one standard error."""
    told = [answer for answer in answers if answer.identifiable]
    groups = {"identifiable": told}
    groups |= {valve: [a for a in told if a.valve == valve] for valve in sorted({a.valve for a in told})}
    groups["not identifiable"] = [answer for answer in answers if not answer.identifiable]
    lines = [
        f"| of {of} loops | loops | median abs. error | median error | nine in ten below | 50 % | 80 % | 95 % |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    return "\n".join([*lines, *(_row(name, group) for name, group in groups.items() if group)])


def _row(name: str, group: list[Sized]) -> str:
    error = np.array([answer.error for answer in group])
    held = np.mean([answer.covered for answer in group], axis=0)
    medians = [f"{_pct(np.median(x))} ± {_pct(_of_median(x))} %" for x in (np.abs(error), error)]
    shares = [f"{100.0 * share:.0f} ± {100.0 * _of_share(share, len(group)):.0f} %" for share in held]
    cells = [name, str(len(group)), *medians, f"{_pct(np.quantile(np.abs(error), 0.9))} %", *shares]
    return f"| {' | '.join(cells)} |"


def _pct(share: float) -> str:
    return f"{100.0 * share:.1f}"


def _of_median(x: FloatArray) -> float:
    """Standard error of the median of x (n,): of how many lie below it, the deviation is the root of n over two."""
    reach = 0.5 / np.sqrt(len(x))
    low, high = np.quantile(x, (max(0.5 - reach, 0.0), min(0.5 + reach, 1.0)))
    return float(high - low) / 2.0


def _of_share(share: float, count: int) -> float:
    return float(np.sqrt(share * (1.0 - share) / count))


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m app.lab.testbench.sizing", description=__doc__)
    parser.add_argument("--count", type=int, default=400, help="loops of each kind and seed")
    parser.add_argument("--seed", type=int, nargs="+", default=[77], help="one draw each, counted together")
    options = parser.parse_args(arguments)
    kinds: dict[str, Callable[[int, int], Iterator[Known]]] = {"fitted": fitted, "verify": verify}
    for name, loops in kinds.items():
        drawn = itertools.chain.from_iterable(loops(options.count, seed) for seed in options.seed)
        said = [answer for answer in map(sized, drawn) if answer is not None]
        sys.stdout.write(f"## {name}\n\n{table(said, options.count * len(options.seed))}\n\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
