"""`python tests/proof/tables.py ROWS...`: the tables of PROOF.md, from the rows that `prove.py --out` wrote."""

import json
import sys
from collections import Counter
from pathlib import Path

from tests.proof.generator import LEAST_ENERGY, SAME

HOW_MANY = ("none", "one", "both")


def rows_of(paths: list[Path]) -> list[dict]:
    """The cases whose effects can be seen."""
    lines = [json.loads(line) for path in paths for line in path.read_text(encoding="utf-8").splitlines()]
    return [line for line in lines if line["true"] and line["energy"] >= LEAST_ENERGY]


def of_single(lines: list[dict]) -> list[str]:
    """A row for each effect that was concealed alone: how often it was named, and what came first."""
    single = [line for line in lines if len(line["true"]) == 1]
    said = ["| concealed | named right | first names given |", "|---|---|---|"]
    for effect in sorted({line["true"][0] for line in single}):
        own = [line for line in single if line["true"][0] == effect]
        first = Counter(line["said"][0][0] if line["said"] else "nothing" for line in own)
        names = ", ".join(f"{name} ({n})" if n > 1 else name for name, n in first.most_common())
        said.append(f"| {effect} | {sum(line['first_right'] for line in own)}/{len(own)} | {names} |")
    return said


def of_pairs(lines: list[dict]) -> list[str]:
    """A row for each pair: how many of it were named, and what was said."""
    said = ["| two concealed | named | said |", "|---|---|---|"]
    for line in sorted((line for line in lines if len(line["true"]) == 2), key=lambda line: line["true"]):
        named = [set(names) for names in line["said"]]
        right = sum(any(set(SAME.get(effect, (effect,))) & names for names in named) for effect in line["true"])
        names = "; ".join(" or ".join(names) for names in line["said"]) or "nothing"
        said.append(f"| {', '.join(line['true'])} | {HOW_MANY[right]} | {names} |")
    return said


if __name__ == "__main__":
    rows = rows_of([Path(path) for path in sys.argv[1:]])
    print("\n".join([*of_single(rows), "", *of_pairs(rows)]))
