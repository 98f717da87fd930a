"""Runs sections, keeps what they found in a JSON file, and lets the page be written from it."""

import json
import tempfile
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.kernel_cache import choose
from app.lab.bench import api, audit, files, ingest, machine, plant, search
from app.lab.bench.bench import FULL, QUICK, Bench, Figures, SkippedError

SECTIONS: dict[str, Callable[[Bench], Figures]] = {
    "search": search.run,
    "audit": audit.run,
    "files": files.run,
    "ingest": ingest.run,
    "plant": plant.run,
    "api": api.run,
}
FORMAT = 1


@dataclass(frozen=True)
class Wanted:
    """Which sections at which size, on which servers; `recordings`: a folder of them (CHEM1.csv is FC145), or None."""

    sections: Sequence[str]
    quick: bool
    postgres: str
    redis: str
    recordings: Path | None


def run(wanted: Wanted, known: Figures, keep: Callable[[str], None], tell: Callable[[str], None]) -> Figures:
    """The figures that are known, with those of the wanted sections made anew; kept, as JSON, after each section."""
    choose()
    figures = known
    with tempfile.TemporaryDirectory(prefix="loopaudit-bench-") as folder:
        sizes = QUICK if wanted.quick else FULL
        bench = Bench(sizes, wanted.postgres, wanted.redis, Path(folder), wanted.recordings, tell)
        for name in wanted.sections:
            found = _measured(bench, name) | {"quick": wanted.quick, "machine": machine.describe()}
            made = {"format": FORMAT, "sections": {**figures.get("sections", {}), name: found}}
            text = json.dumps(_rounded(made), indent=1, sort_keys=True)
            keep(text + "\n")
            figures = json.loads(text)
    return figures


def _measured(bench: Bench, name: str) -> Figures:
    started = time.perf_counter()
    try:
        found = SECTIONS[name](bench)
    except SkippedError as error:
        bench.tell(f"{name}: skipped, {error}")
        found = {"skipped": str(error)}
    except Exception as error:  # noqa: BLE001 - a section that breaks is told on the page; the others are still measured
        bench.tell(f"{name}: broke off\n{traceback.format_exc()}")
        found = {"skipped": f"broke off: {type(error).__name__}: {str(error)[:300]}"}
    return found | {"took_s": time.perf_counter() - started}


def read(path: Path) -> Figures:
    """What an earlier run left, nothing where it left nothing."""
    if not path.is_file():
        return {}
    known = json.loads(path.read_text(encoding="utf-8"))
    return known if known.get("format") == FORMAT else {}


def _rounded(value: Any) -> Any:
    """Four digits: more is noise."""
    if isinstance(value, dict):
        return {name: _rounded(part) for name, part in value.items()}
    if isinstance(value, list):
        return [_rounded(part) for part in value]
    return float(f"{value:.4g}") if isinstance(value, float) else value
