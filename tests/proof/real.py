"""Explains the laboratory records and the real loops whose cause is known, and writes plots and tables for the pages:
`PYTHONPATH=. python tests/proof/real.py FOLDER docs`. FOLDER holds the folders `recordings` and `nonlinear`.
"""

import json
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from app.engine.mismatch import Comparison, explain
from app.engine.mismatch.fit.closed_loop import ClosedLoop
from app.services.explaining.comparisons import Columns, read_comparison
from app.services.explaining.line import explanation_line
from app.services.explaining.svg import explanation_svg
from tests.proof.recorded import cell

LOOPS = {
    "CHEM3": "quantisation",
    "CHEM14": "faulty steam sensor",
    "MET1": "external disturbance",
    "PAP7": "external disturbance",
    "CHEM21": "external disturbance (likely)",
    "CHEM27": "external disturbance (likely)",
    "PAP4": "dead zone, tight tuning",
    "CHEM1": "stiction",
    "CHEM2": "stiction",
    "PAP2": "stiction",
    "CHEM10": "stiction",
    "CHEM23": "stiction",
    "CHEM29": "stiction",
}


def laboratory(shared: Path) -> Iterator[tuple[str, str, Comparison, Comparison]]:
    """Name, what is known, the half to fit, the half to simulate."""
    path = shared / "nonlinear" / "cascaded_tanks.csv"
    fitted, unseen = (read_comparison(path, Columns(f"u{part}", f"y{part}"), None) for part in ("Est", "Val"))
    yield "tanks", "outflow law, overflow", fitted, unseen
    rows = np.loadtxt(shared / "nonlinear" / "steam_heat_exchanger.csv", delimiter=",", skiprows=1)
    half = len(rows) // 2
    parts = (Comparison("exchanger", 1.0, part[:, 1], part[:, 2]) for part in (rows[:half], rows[half:]))
    yield "exchanger", "gain that depends on the operating point", *parts


def row(name: str, known: str, line: dict[str, Any]) -> str:
    named = [" or ".join((e["effect"], *e["alternatives"])) + f" ({e['probability']})" for e in line["effects"]]
    fit, unseen = line["fit"], line["validation"]
    told = "; ".join(named) or line["verdict"]
    figures = f"{fit['rmse_refitted']:.3g} -> {fit['rmse_explained']:.3g}"
    if unseen is not None:
        figures += f"; unseen {unseen['rmse_refitted']:.3g} -> {unseen['rmse_explained']:.3g}"
    return f"| {name} | {known} | {told} | {figures} | {line['elapsed_s']} |"


def loop_row(name: str, closed: ClosedLoop | None) -> str:
    if closed is None:
        return f"| {name} | no PID law found | | | | | |"
    shown = (closed.recorded, closed.refitted, closed.explained, closed.with_noise, closed.as_recorded)
    return f"| {name} | {' | '.join(map(cell, shown))} | {', '.join(closed.lacked) or 'nothing that helps'} |"


def main(shared: Path, docs: Path, names: list[str]) -> None:
    plots = docs / "explained"
    plots.mkdir(parents=True, exist_ok=True)
    cases = list(laboratory(shared))
    for loop, known in LOOPS.items():
        cases.append((loop, known, read_comparison(shared / "recordings" / f"{loop}.csv", Columns(), None), None))
    for name, known, comparison, unseen in cases:
        if names and name not in names:
            continue
        started = time.process_time()
        said = explain(comparison, unseen)
        line = explanation_line(said, time.process_time() - started)
        (plots / f"{name}.svg").write_text(explanation_svg(said, comparison.op), encoding="utf-8")
        print(row(name, known, line), flush=True)
        print(loop_row(name, said.closed_loop), flush=True)
        print(json.dumps([line["effects"], line["refit"], line["evidence"]])[:3000], file=sys.stderr, flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:])
