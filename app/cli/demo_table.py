"""The demo plant's reliability table beside what is true about each loop."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import IO, TYPE_CHECKING, Any

from rich import box
from rich.table import Table
from rich.text import Text

from app.cli.messages import console_for
from app.cli.tables import VERDICT_STYLE, chance, number
from app.counting import counted
from app.services.telling.wording import VERDICT_RANK, VERDICT_WORDS, rely

if TYPE_CHECKING:
    from app.services.demo import DemoLoop

HIT, MISS, ABSTAINED = "right", "WRONG", "no verdict"
STYLE = {HIT: "green", MISS: "bold red", ABSTAINED: "yellow"}


@dataclass(frozen=True)
class Judged:
    """A row of the reliability table and the loop that it speaks of."""

    loop: "DemoLoop"
    row: Mapping[str, Any]

    @property
    def outcome(self) -> str:
        if self.row["verdict"] == self.loop.right_verdict:
            return HIT
        return ABSTAINED if self.row["verdict"] in ("inconclusive", "not_auditable") else MISS


@dataclass(frozen=True)
class Column:
    """A column of the table; `narrow`: on a narrow terminal too."""

    header: str
    narrow: bool = True


COLUMNS = (
    *(Column("loop"), Column("unit", narrow=False), Column("verdict"), Column("P(stiction)", narrow=False)),
    *(Column("rely on it?"), Column("health", narrow=False), Column("S (95 %)"), Column("truth"), Column("")),
)
FIGURES = ("P(stiction)", "health", "S (95 %)")
WIDE = 120
LEGEND = (
    "S: how much OP must travel after a reversal before the valve moves, in units of OP, with its 95 % interval "
    "where there is room; -: the record cannot tell. Health: 100 is best."
)


def print_demo(loops: Sequence["DemoLoop"], rows: Sequence[Mapping[str, Any]], stream: IO[str]) -> None:
    """Prints the table, worst first, and how often each condition was judged rightly."""
    by_tag = {loop.tag: loop for loop in loops}
    judged = [Judged(by_tag[row["loop"]], row) for row in sorted(rows, key=_sticky_first) if row["loop"] in by_tag]
    console = console_for(stream)
    console.print(_table(judged, wide=console.width >= WIDE))
    console.print(Text(LEGEND))
    console.print(_summary(judged))
    console.print(Text(_sentence(judged, len(loops))))


def _sticky_first(row: Mapping[str, Any]) -> tuple[int, float, str]:
    """Sticky valves first, and among them what has the worst health."""
    health = row["health"]
    return VERDICT_RANK.index(row["verdict"]), 100.0 if health is None else health, row["loop"]


def _size(row: Mapping[str, Any]) -> str:
    if row["stiction_S"] is None:
        return "-"
    return f"{row['stiction_S']:.1f} ({row['stiction_S_low']:.1f} to {row['stiction_S_high']:.1f})"


def _table(judged: Sequence[Judged], wide: bool) -> Table:
    """A line a loop. A narrow terminal goes without unit, probability, health and the interval of S."""
    table = Table(title="Reliability table of the demo plant, beside the truth", box=box.SIMPLE_HEAD, pad_edge=False)
    shown = COLUMNS if wide else tuple(column for column in COLUMNS if column.narrow)
    for column in shown:
        right = column.header in FIGURES
        table.add_column(column.header, justify="right" if right else "left", no_wrap=column.header != "truth")
    for item in judged:
        cells = _cells(item, wide)
        table.add_row(*(cells[column.header] for column in shown))
    return table


def _cells(item: Judged, wide: bool) -> dict[str, Text | str]:
    row = item.row
    return {
        "loop": Text(row["loop"]),
        "unit": Text(row["unit"] or ""),
        "verdict": Text(VERDICT_WORDS[row["verdict"]], style=VERDICT_STYLE[row["verdict"]]),
        "P(stiction)": chance(row),
        "rely on it?": rely(row),
        "health": number(row["health"], 0),
        "S (95 %)": _size(row) if wide else number(row["stiction_S"], 1),
        "truth": Text(item.loop.truth),
        "": Text(item.outcome, style=STYLE[item.outcome]),
    }


def _summary(judged: Sequence[Judged]) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for header in ("truth", "loops", HIT, MISS, ABSTAINED):
        table.add_column(header, justify="left" if header == "truth" else "right")
    conditions = dict.fromkeys(item.loop.condition for item in judged)
    for condition in sorted(conditions):
        outcomes = [item.outcome for item in judged if item.loop.condition == condition]
        counts = (str(outcomes.count(outcome)) for outcome in (HIT, MISS, ABSTAINED))
        table.add_row(condition, str(len(outcomes)), *counts)
    return table


def _sentence(judged: Sequence[Judged], loops: int) -> str:
    right = sum(item.outcome == HIT for item in judged)
    relied = [item for item in judged if item.row["reliability"] == "reliable"]
    relied_right = sum(item.outcome == HIT for item in relied)
    called = f"of {counted(len(relied), 'verdict')} called reliable, {counted(relied_right, 'is', 'are')} right"
    return f"{right} of {counted(loops, 'loop')} judged correctly; {called}."
