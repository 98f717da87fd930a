"""Commands that print a report on some loops or plants of each kind, one a seed."""

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Iterable

from app.engine.audit import audit
from app.engine.recording import Recording


def print_report(
    name: str,
    description: str | None,
    report: Callable[[range], Iterable[str]],
    arguments: list[str] | None,
    many: int,
    seed: int = 1,
    of: str = "loops",
    kinds: str | None = "of each kind",
) -> int:
    """Writes the lines of `report(seeds)` as they come, as `python -m app.lab.testbench.NAME`; the exit code. many,
    seed: how many of each kind and the first seed, where `arguments` (None: of the process) say nothing else. of,
    kinds: what they are, as the option for how many is named, and what its help says.
    """
    parser = argparse.ArgumentParser(prog=f"python -m app.lab.testbench.{name}", description=description)
    parser.add_argument(f"--{of}", type=int, default=many, help=kinds, dest="many", metavar=of.upper())
    parser.add_argument("--seed", type=int, default=seed)
    options = parser.parse_args(arguments)
    write_lines(report(range(options.seed, options.seed + options.many)))
    return 0


def write_lines(lines: Iterable[str]) -> None:
    """Each as soon as it is known: some take minutes."""
    for line in lines:
        sys.stdout.write(f"{line}\n")
        sys.stdout.flush()


def tallied(recordings: Iterable[Recording]) -> Counter[tuple[str, str]]:
    """Of how many recordings an audit says which verdict with which reliability."""
    judgements = (audit(recording).judgement for recording in recordings)
    return Counter((judgement.verdict, judgement.reliability) for judgement in judgements)


def accused_and_cleared(said: Counter[tuple[str, str]]) -> str:
    """Of verdicts and reliabilities, as cells: how many accused, of them reliably, and reliably cleared."""
    accused = sum(count for (verdict, _), count in said.items() if verdict == "stiction")
    return f"{accused} | {said['stiction', 'reliable']} | {said['no_stiction', 'reliable']}"
