"""Tables for people: the worst first, in words that an operator understands."""

from collections.abc import Iterable, Mapping
from typing import IO, Any

from rich import box
from rich.table import Table
from rich.text import Text

from app.cli.messages import console_for
from app.counting import counted
from app.services.telling.wording import (
    POSSIBLY,
    VERDICT_RANK,
    VERDICT_WORDS,
    measured_probability,
    probability,
    rely,
    weakly,
    worst_first,
)

VERDICT_STYLE = {"stiction": "bold red", "inconclusive": "yellow", "not_auditable": "dim", "no_stiction": "green"}
WIDTH_FOR_REASONS = 130


def print_verdicts(lines: Iterable[Mapping[str, Any]], stream: IO[str]) -> None:
    """One line a recording, then how many of each verdict. A narrow terminal goes without the reasons."""
    ordered = worst_first(lines)
    console = console_for(stream)
    with_reasons = console.width >= WIDTH_FOR_REASONS
    table = Table(box=box.SIMPLE_HEAD, header_style="bold", pad_edge=False)
    table.add_column("recording", overflow="fold", min_width=12)
    table.add_column("verdict", no_wrap=True)
    table.add_column("P(stiction)", justify="right", no_wrap=True)
    table.add_column("rely on it?", no_wrap=True)
    table.add_column("S", justify="right", no_wrap=True)
    table.add_column("Yper %", justify="right", no_wrap=True)
    if with_reasons:
        table.add_column("why", overflow="fold", ratio=1)
    for line in ordered:
        table.add_row(*verdict_cells(line)[: len(table.columns)])
    console.print(table)
    console.print(totals(ordered))
    console.print(Text("S: size of the stiction, in the unit of OP; Yper: harmonics of PV that OP does not explain"))


def verdict_cells(line: Mapping[str, Any]) -> list[Text]:
    verdict = line["verdict"]
    return [
        Text(named(line)),
        Text(VERDICT_WORDS[verdict] + (POSSIBLY if weakly(line) else ""), style=VERDICT_STYLE[verdict]),
        Text(chance(line)),
        Text(rely(line)),
        Text(size(line["stiction_size"])),
        Text(number(line["yper_pct"], 1)),
        Text(line["reasons"][0]["text"] if line["reasons"] else ""),
    ]


def named(line: Mapping[str, Any]) -> str:
    """The recording, and the loop where its name does not tell: of a file's loops one alone may have been audited."""
    recording, loop = line["recording"], line["loop"]
    return recording if loop.casefold() in recording.casefold() else f"{recording}:{loop}"


def size(told: Mapping[str, Any]) -> str:
    return "-" if told["S"] is None else f"{told['S']:.3g}"


def chance(line: Mapping[str, Any]) -> str:
    """The probability of stiction as everywhere, with the hyphen of terminals where there is none."""
    value = measured_probability(line)
    return "-" if value is None else probability(value)


def number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def totals(lines: list[Mapping[str, Any]]) -> Text:
    counts = {verdict: sum(line["verdict"] == verdict for line in lines) for verdict in VERDICT_RANK}
    parts = [f"{count:,} {VERDICT_WORDS[verdict]}" for verdict, count in counts.items() if count]
    return Text(f"{counted(len(lines), 'recording')}: " + ", ".join(parts))
