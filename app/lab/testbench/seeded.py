"""Commands that print a report on some loops of each kind, one a seed."""

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Iterable


def print_report(
    name: str,
    description: str | None,
    report: Callable[[range], Iterable[str]],
    arguments: list[str] | None,
    loops: int,
    seed: int = 1,
) -> int:
    """Writes the lines of `report(seeds)` as `python -m app.lab.testbench.NAME`; the exit code. loops, seed: how many
    of each kind and the first seed, where `arguments` (None: of the process) say nothing else.
    """
    parser = argparse.ArgumentParser(prog=f"python -m app.lab.testbench.{name}", description=description)
    parser.add_argument("--loops", type=int, default=loops, help="of each kind")
    parser.add_argument("--seed", type=int, default=seed)
    options = parser.parse_args(arguments)
    sys.stdout.writelines(f"{line}\n" for line in report(range(options.seed, options.seed + options.loops)))
    return 0


def accused_and_cleared(said: Counter[tuple[str, str]]) -> str:
    """Of verdicts and reliabilities, as cells: how many accused, of them reliably, and reliably cleared."""
    accused = sum(count for (verdict, _), count in said.items() if verdict == "stiction")
    return f"{accused} | {said['stiction', 'reliable']} | {said['no_stiction', 'reliable']}"
