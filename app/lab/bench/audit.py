"""What one loop's audit costs: against its samples, its valve grid and its search space, and by stage."""

import cProfile
import pstats
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from app.engine import audit as engine
from app.engine.armax import SearchSpace
from app.engine.audit import AuditConfig, audit
from app.engine.recording import Recording, UniformRecord
from app.engine.reference.hammerstein import HammersteinConfig, identify_one_parameter
from app.errors import DataError
from app.lab.bench.bench import Bench, Figures
from app.lab.bench.loops import records
from app.lab.bench.measure import median_s, times_s, yardstick_s
from app.lab.evaluation.recordings import read

KINDS = 60  # the conditions of the simulated plant
REPEATS = 5
SPACES = ((2, 2, 2), (5, 5, 5), (5, 5, 10), (5, 5, 25), (10, 10, 25), (25, 25, 25))
GRIDS = (15, 30, 60, 120)
SHOWN_STAGES = 16


def run(bench: Bench) -> Figures:
    bench.tell("audit: by condition and stage")
    kinds = min(KINDS, bench.sizes.loops)
    plant = _recordings(kinds, 1440)
    sticky = _longest(bench)
    recorded = {} if bench.recordings is None else _recorded(bench.recordings, 2000)
    return {
        **_spread(plant, 1440),
        "longer": _spread(_recordings(kinds, 2000), 2000),
        **({"recorded": _spread(recorded, 2000)} if recorded else {}),
        "stages": _stages(list(plant.values())),
        "samples_growth": _growth(bench, sticky),
        "grid": _against(bench, "grid", GRIDS, lambda n: lambda: _identify(sticky, points=n)),
        "search_space": _against(bench, "search space", SPACES, lambda s: lambda: _identify(sticky, SearchSpace(*s))),
    }


def _spread(plant: dict[str, Recording], samples: int) -> Figures:
    """What the audits of a plant's kinds of loop cost, each a median of its own; and the greatest of what each costs at
    the least, to which other work on the machine adds."""
    config = AuditConfig()
    pieces, yardsticks = [], []
    for recording in plant.values():
        pieces.append(times_s(partial(audit, recording, config), REPEATS))
        yardsticks.append(yardstick_s())
    times = np.array(pieces)
    ms = 1e3 * np.median(times, axis=1)
    return {
        "samples": samples,
        "loops": len(ms),
        "ms_mean": float(np.mean(ms)),
        "ms_median": float(np.median(ms)),
        "ms_p95": float(np.percentile(ms, 95)),
        "ms_max": float(np.max(ms)),
        "ms_max_least": 1e3 * float(np.max(np.min(times, axis=1))),
        "yardstick_ms": 1e3 * float(np.median(yardsticks)),
    }


def _recordings(count: int, samples: int) -> dict[str, Recording]:
    steps = 60.0 * np.arange(samples, dtype=np.float64)
    return {loop.tag: Recording(loop.tag, steps, loop.pv, loop.op, loop.sp) for loop in records(count, samples)}


def _recorded(folder: Path, most: int) -> dict[str, Recording]:
    """The first samples, `most` of each, of the recordings of one loop in a folder."""
    found = {}
    for path in sorted(path for path in folder.glob("*.csv") if path.is_file()):
        try:
            found[path.stem] = read(path).part(slice(most))
        except DataError:
            continue  # a list of labels, or several loops
    return found


def _longest(bench: Bench) -> Recording:
    """A sticking loop of the greatest length."""
    samples = bench.sizes.lengths[-1]
    loop = list(records(22, samples))[-1]
    return Recording(loop.tag, 60.0 * np.arange(samples, dtype=np.float64), loop.pv, loop.op, loop.sp)


def _growth(bench: Bench, whole: Recording) -> list[Figures]:
    """The whole audit against N, as configured (identification takes the newest samples) and with no such limit."""
    rows: list[Figures] = []
    unlimited = replace(AuditConfig(), max_samples=10**9)
    for samples in bench.sizes.lengths:
        bench.tell(f"audit: {samples} samples")
        recording = whole.part(slice(samples))
        row: Figures = {"samples": samples}
        for name, config in (("ms", AuditConfig()), ("ms_all_samples", unlimited)):
            if name == "ms_all_samples" and samples > 20_000 and rows[-1][name] > 4000:
                continue
            row[name] = 1e3 * median_s(partial(audit, recording, config), 3 if samples < 20_000 else 1)
        rows.append(row)
    return rows


def _identify(recording: Recording, space: SearchSpace | None = None, points: int = 30) -> object:
    record = UniformRecord(60.0, recording.pv[:1440], recording.op[:1440], None, np.zeros(1440, dtype=bool))
    space = space or SearchSpace(5, 5, 10, nc_min=0)
    return identify_one_parameter(record, space, replace(HammersteinConfig(), points_d=points))


def _against(
    bench: Bench, what: str, values: tuple[Any, ...], work: Callable[[Any], Callable[[], object]]
) -> list[Figures]:
    bench.tell(f"audit: against the {what}")
    return [{"value": str(value), "ms": 1e3 * median_s(work(value), 3)} for value in values]


def _stages(recordings: list[Recording]) -> list[Figures]:
    """What the functions that the audit calls take of its time: those of its own module and the rooms it walks."""
    profile = cProfile.Profile()
    profile.enable()
    for recording in recordings:
        audit(recording)
    profile.disable()
    calls = pstats.Stats(profile).get_stats_profile().func_profiles
    stats = pstats.Stats(profile).stats  # type: ignore[attr-defined]
    total = calls["audit"].cumtime
    rows = []
    for (file, _, function), (_, count, _, cumulative, callers) in stats.items():
        from_audit = any(caller[0] == engine.__file__ for caller in callers)
        if "/app/engine/" in file and from_audit and file != engine.__file__:
            name = f"{file.split('/app/engine/')[1].removesuffix('.py').removesuffix('/__init__')}.{function}"
            rows.append({"stage": name, "ms": 1e3 * cumulative / len(recordings), "share": cumulative / total})
            rows[-1]["calls_a_loop"] = count / len(recordings)
    return sorted(rows, key=lambda row: -row["ms"])[:SHOWN_STAGES]
