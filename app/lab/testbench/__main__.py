"""`python -m app.lab.testbench`: whole audits of simulated loops, one factor at a time; see docs/TESTBENCH.md.

--write FOLDER puts the tables between the marks of FOLDER/TESTBENCH.md and the plots beside it. The same design gives
the same tables.
"""

import argparse
import sys
from pathlib import Path

from app.lab.testbench import plots, tables
from app.lab.testbench.ladders import WIDE, Design, plan
from app.lab.testbench.running import Outcome, run

_BEGIN, _END = "<!-- tables: begin -->", "<!-- tables: end -->"


def main(arguments: list[str] | None = None) -> int:
    options = _options().parse_args(arguments)
    design = Design(options.sticky, options.healthy, options.wide, options.seed)
    outcomes = run(plan(design), options.jobs)
    text = document(outcomes)
    sys.stdout.write(text + "\n")
    if options.write:
        write(options.write, text, plots.page(tables.rows(outcomes)))
    return 0


def _options() -> argparse.ArgumentParser:
    design = Design()
    parser = argparse.ArgumentParser(prog="python -m app.lab.testbench", description="where the detector fails")
    parser.add_argument("--sticky", type=int, default=design.sticky, help="sticky loops on each level of a factor")
    parser.add_argument("--healthy", type=int, default=design.healthy, help="healthy loops on each level of a factor")
    parser.add_argument("--wide", type=int, default=design.wide, help="loops of each kind, all factors drawn at once")
    parser.add_argument("--seed", type=int, default=design.seed)
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--write", type=Path, metavar="FOLDER", help="write TESTBENCH.md and testbench.svg there")
    return parser


def document(outcomes: list[Outcome]) -> str:
    """All tables, the most telling first."""
    table = tables.rows(outcomes)
    everything = [o for o in outcomes if o.factor == WIDE]
    told = [o for o in outcomes if o.exercised]
    sure = [o for o in told if o.reliable and not o.abstained]
    wrong = sum(o.wrong for o in sure)
    parts = [
        f"{len(outcomes)} loops, of which {len(told)} are healthy or exercised. Of the verdicts on these, {len(sure)} "
        f"are called reliable; {wrong} of those are wrong.",
        "## Where it starts to fail\n\n"
        f"Levels on which fewer than {100 * tables.FEWEST_FOUND:.0f} % of the exercised sticky valves, or more than "
        f"{100 * tables.MOST_ACCUSED:.0f} % of the healthy valves, are called sticky.\n\n" + tables.failing(table),
        "## Level by level\n\n" + tables.markdown(table),
    ]
    if everything:
        parts.append("## Stated probability, everything at once\n\n" + tables.calibration(everything))
    return "\n\n".join(parts)


def write(folder: Path, text: str, drawing: str) -> None:
    """Puts the tables between the marks of the page, which keeps the rest of its text, and the plots beside it."""
    target = folder / "TESTBENCH.md"
    page = target.read_text(encoding="utf-8")
    before, _, rest = page.partition(_BEGIN)
    after = rest.partition(_END)[2]
    target.write_text(f"{before}{_BEGIN}\n{text}\n{_END}{after}", encoding="utf-8")
    (folder / "testbench.svg").write_text(drawing, encoding="utf-8")


if __name__ == "__main__":
    raise SystemExit(main())
