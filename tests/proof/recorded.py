"""What explain finds in recorded loops without a simulation: `python tests/proof/recorded.py FOLDER`, the folder of the
recordings and their labels.

First what noise does without any physics: the loops that obey a PID law, closed again by their linear model, clean and
with its noise. Then, of all recordings, in which a stem that sticks or a deadband is named, and what their labels say.
"""

import csv
import sys
from collections.abc import Iterator
from pathlib import Path

from app.engine.mismatch import Comparison, compile_kernels, explain
from app.engine.mismatch.compare.preparing import prepare
from app.engine.mismatch.fit.closed_loop import LoopFigures, close_again
from app.engine.mismatch.judge.result import Effect
from app.errors import DataError
from app.services.explaining.comparisons import Columns, read_comparison

OF_A_STEM = {"valve.stiction", "valve.deadband"}
CLOSED = ("CHEM1", "CHEM2", "CHEM3", "CHEM14", "CHEM21", "CHEM27", "MET1", "PAP2", "PAP4", "PAP7")


def cell(figures: LoopFigures | None) -> str:
    if figures is None:
        return "not settled"
    period = "-" if figures.period_s is None else f"{figures.period_s:.3g}"
    return f"{period}, {figures.amplitude:.3g}, {figures.yper_pct:.3g}, {figures.shape:.2f}"


def noise_alone(comparison: Comparison) -> str:
    """A loop closed by its linear model, to which nothing is added but the noise."""
    prepared = prepare(comparison)
    closed = close_again(prepared.base, prepared.base, acted=prepared.acted)
    if closed is None:
        return f"| {comparison.name} | no PID law found | | | | |"
    cells = map(cell, (closed.recorded, closed.refitted, closed.with_noise))
    lacked = ", ".join(closed.lacked) or "nothing that helps"
    return f"| {comparison.name} | {closed.law.explained:.1%} | {' | '.join(cells)} | {lacked} |"


def stems(effects: tuple[Effect, ...]) -> Iterator[str]:
    """The effects that are a stem's, or may be."""
    for effect in effects:
        if OF_A_STEM.intersection((effect.code, *effect.alternatives)):
            yield f"{' or '.join((effect.code, *effect.alternatives))} ({effect.probability:.2f})"


def main(folder: Path) -> None:
    compile_kernels()
    for name in CLOSED:
        print(noise_alone(read_comparison(folder / f"{name}.csv", Columns(), None)), flush=True)
    with (folder / "labels.csv").open(encoding="utf-8") as table:
        labelled = list(csv.DictReader(table))
    named, refused = [], []
    for row in labelled:
        try:
            said = explain(read_comparison(folder / f"{row['recording']}.csv", Columns(), None))
        except DataError as error:
            refused.append(f"{row['recording']}: {error.code}")
            continue
        if found := list(stems(said.effects)):
            named.append(row["label"])
            print(f"| {row['recording']} | {row['label']} | {row['cause']} | {'; '.join(found)} |", flush=True)
    sticking = named.count("stiction")
    print(f"{len(labelled)} recordings, {len(refused)} not explained ({', '.join(refused)})")
    print(f"a stem or a deadband in {len(named)}, of which {sticking} are labelled as sticking")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
