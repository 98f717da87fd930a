"""docs/PERFORMANCE.md out of the figures: what was measured, beside what was promised, also where it misses."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from app.lab.bench.bench import Figures
from app.lab.bench.growth import growth
from app.lab.bench.plant import SCALING

TITLE = """# Performance

What loopaudit takes, beside what was promised. `make bench` measured the figures on the machine described below and
wrote this page from `docs/performance.json`; what was timed only once says so, with its date. Times hold for that
machine only; ratios to comparable software carry over to others. Missed targets are shown as missed.
"""

REPEAT = """## How to repeat it

```
make bench                                  # all sections, about twenty minutes, rewrites this page
make bench SECTIONS="search audit"          # some; the others keep their figures
.venv/bin/loopaudit bench --quick           # small sizes, to see that it runs
```

Ingest, plant and API need PostgreSQL and Redis (`POSTGRES=` and `REDIS=` name them; the Redis database must be empty).
The benchmark creates a database and drops it at the end. Let the machine do nothing else meanwhile. `sippy-unipi` comes
from `requirements-bench.lock`; the product does not depend on it.
"""


LONGEST = """The tables below are from one long record, one value per minute, of
a pressure loop of the simulated plant whose valve sticks (S 2 %, J 0.5 %). The first table uses as many of its first
samples as each row says, the others its first 1,440. Audits of such loops are expensive.

"""

SLOWEST = """

On the slowest machine tried, the additions took 66 to 69 ms (engine 0.1.10, three runs on 2026-11-29). There, simulated
audits of 2,000 samples took 42 ms on average, and the most expensive 72, 80 and 75 ms; recordings took 45 ms on
average, and the most expensive 148, 183 and 190 ms. So the target of 60 ms holds only on a faster machine.

"""


def performance_page(figures: Figures) -> str:
    sections = figures.get("sections", {})
    parts = [TITLE, _machine(sections), _targets(sections)]
    writers: dict[str, Callable[[Figures], str]] = {
        "search": _search,
        "audit": _audit,
        "files": _files,
        "ingest": _ingest,
        "plant": _plant,
        "api": _api,
    }
    for name, write in writers.items():
        found = sections.get(name)
        if found is None:
            parts.append(f"## {name.capitalize()}\n\nNot measured yet.\n")
        elif "skipped" in found:
            parts.append(f"## {name.capitalize()}\n\nSkipped: {found['skipped']}\n")
        else:
            parts.append(_dated(found) + write(found))
    return "\n".join([*parts, growth(sections), REPEAT])


def summary(figures: Figures) -> str:
    """The targets and what was measured, for the terminal."""
    rows = _target_rows(figures.get("sections", {}))
    width = max((len(row[0]) for row in rows), default=0)
    return "\n".join(f"{row[0]:{width}s}  {row[2]:>24s}  target {row[1]:24s} {row[3]}" for row in rows)


def table(head: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(map(str, row)) + " |" for row in rows)]) + "\n"


def number(value: float | None, digits: int = 3) -> str:
    """Three significant digits, thousands parted; a dash where there is none."""
    if value is None:
        return "–"
    if value == 0 or abs(value) >= 10 ** (digits - 1):
        return f"{float(f'{value:.{digits}g}'):,.0f}"
    return f"{value:.{digits}g}"


def _machine(sections: Figures) -> str:
    """The machine of the newest figures, and any others with the sections that were measured there."""
    told = {name: section["machine"] for name, section in sections.items() if "machine" in section}
    if not told:
        return ""
    newest = max(told.values(), key=lambda machine: machine["date"])
    measured_on: dict[str, list[str]] = {}
    for name, machine in told.items():
        measured_on.setdefault(_described(machine), []).append(name)
    lines = [f"{_described(newest)}. Newest figures of {newest['date']}.\n"]
    for machine, names in measured_on.items():
        if machine != _described(newest):
            lines.append(f"**Except {', '.join(names)}**, measured with: {machine}.\n")
    return "## The machine\n\n" + "\n".join(lines)


def _described(it: Figures) -> str:
    versions = ", ".join(f"{name} {version}" for name, version in it["versions"].items())
    return (
        f"{it['processor']}, {it['cores']} cores, {it['memory_gb']} GB, {it['system']}, Python {it['python']}, engine "
        f"{it['engine']}. {versions}"
    )


def _dated(found: Figures) -> str:
    machine = found["machine"]
    size = " with small sizes (`--quick`)" if found.get("quick") else ""
    return f"<!-- measured {machine['date']}{size}, load before it {machine['load_before']} -->\n"


def _targets(sections: Figures) -> str:
    rows = _target_rows(sections)
    small = [name for name, found in sections.items() if found.get("quick")]
    warning = f"\nMeasured with small sizes: {', '.join(small)}.\n" if small else ""
    return "## Targets\n\n" + table(("what", "target", "measured", ""), rows) + warning


def _target_rows(sections: Figures) -> list[tuple[str, str, str, str]]:
    rows = []
    for section, what, target, path, good in TARGETS:
        found = sections.get(section, {})
        value = _at(found, path)
        shown = "not measured" if value is None else number(value)
        met = "" if value is None else ("met" if good(value) else "**missed**")
        if value is not None and found.get("quick"):
            met = "small sizes"  # neither met nor missed: the target is the whole plant's
        rows.append((what, target, shown, met))
    return rows


def _at(found: Any, path: str) -> float | None:
    for name in path.split("."):
        if not isinstance(found, dict) or name not in found:
            return None
        found = found[name]
    return found if isinstance(found, int | float) else None


def _most(limit: float) -> Callable[[float], bool]:
    return lambda value: value <= limit


def _least(limit: float) -> Callable[[float], bool]:
    return lambda value: value >= limit


TARGETS: tuple[tuple[str, str, str, str, Callable[[float], bool]], ...] = (
    ("search", "one-parameter order search, ms", "at most 5", "one_parameter.ms", _most(5)),
    ("search", "two-parameter order search, ms", "at most 25", "two_parameter.ms", _most(25)),
    ("search", "a fit against statsmodels", "300,000 times as fast", "statsmodels.ratio_to_the_search", _least(3e5)),
    ("search", "a fit against SIPPY", "10,000 times as fast", "sippy.ratio_to_the_search", _least(1e4)),
    ("audit", "an audit of 2,000 samples, the most expensive of 60, ms", "at most 60", "longer.ms_max", _most(60)),
    ("audit", "the same, the most expensive recording, ms", "at most 60", "recorded.ms_max", _most(60)),
    ("plant", "the plant's night, min", "at most 8", "whole.wall_min", _most(8)),
    ("plant", "engine's share of that time", "at least 0.8", "whole.engine_share", _least(0.8)),
    ("plant", "two workers against one, times the speed", "at least 1.85", "scaling", _least(1.85)),
    ("plant", "a worker's memory, MB", "at most 400", "whole.peak_mb", _most(400)),
    (
        "ingest",
        "long CSV, end to end, share of polars' speed (2 threads)",
        "at least 0.25",
        "by_time.share_of_polars_2",
        _least(0.25),
    ),
    (
        "ingest",
        "wide CSV, end to end, share of polars' speed (2 threads)",
        "at least 0.25",
        "wide.share_of_polars_2",
        _least(0.25),
    ),
    ("ingest", "size of a file that can be read, MB", "at least 2,000", "by_time.mb", _least(2000)),
    ("api", "loop health while an audit runs, p50 ms", "below 10", "busy.loop health.p50_ms", _most(10)),
    ("api", "loop health while an audit runs, p99 ms", "below 30", "busy.loop health.p99_ms", _most(30)),
    ("api", "whole table, again, while an audit runs, p50 ms", "below 400", "busy.table, whole.p50_ms", _most(400)),
    ("api", "plant page on the screen, ms", "below 1,000", "browser.plant page.painted_ms", _most(1000)),
    ("api", "table page on the screen, ms", "below 1,000", "browser.table page.painted_ms", _most(1000)),
)


def _search(found: Figures) -> str:
    rows = []
    for name, label in (("one_parameter", "one parameter"), ("two_parameter", "two parameters")):
        it = found[name]
        told = (it["fits"], number(it["ms"]), number(it["us_a_fit"]), number(it["gram_limit_ms"]))
        rows.append((f"{label}, {it['points']} points", *told, number(it["times_the_limit"])))
    head = ("grid", "fits", "ms", "µs per fit", "arithmetic limit of the Gram matrices, ms", "times the limit")
    text = (
        f"## The order search\n\n{found['record']}, N = {found['samples']}, {found['orders']} orders, one thread.\n\n"
    )
    text += table(head, rows)
    text += f"\nOur exact fit of one order (`refine`) takes {number(found['ours_refined']['ms_a_fit'])} ms.\n\n"
    return text + "".join(_peer(found, name, label) for name, label in PEERS)


PEERS = (("statsmodels", "statsmodels (SARIMAX with exogenous input)"), ("sippy", "SIPPY (ARMAX, ILLS)"))


def _peer(found: Figures, name: str, label: str) -> str:
    it = found[name]
    if "skipped" in it:
        return f"**{label}**: skipped, {it['skipped']}.\n\n"
    text = (
        f"**{label}**: {number(it['s_a_fit'])} s per fit (mean of {it['fits']}); the whole search would take "
        f"{number(it['search_would_take_h'])} h. A fit of our search is {number(it['ratio_to_the_search'])} times as "
        f"fast, our exact fit {number(it['ratio_to_our_exact_fit'])} times. Both make the same choice in "
        f"{it['choices_alike']} of {it['choices']} comparisons (of the order for a band, and of the band for an order)."
    )
    gaps = [apart["our_aic_gap"] for apart in it["apart"] if "our_aic_gap" in apart]
    if gaps:
        text += f" Where they differ, our criterion rates the peer's choice worse by at most {number(max(gaps), 2)}."
    return text + "\n\n"


SPREADS = (("", "{}, simulated"), ("longer", "{}, simulated"), ("recorded", "at most {}, recorded in plants"))
"""Groups of loops whose audits are timed, by their key in the section, and what the page calls their samples."""


def _audit(found: Figures) -> str:
    text = "## A whole audit\n\nCPU time of one thread, with every part of the audit switched on.\n\n"
    shown = ("loops", "ms_mean", "ms_median", "ms_p95", "ms_max")
    head = ("samples", "loops", "mean, ms", "median", "95th percentile", "maximum")
    spreads = [(label, found[name] if name else found) for name, label in SPREADS if not name or name in found]
    rows = [(label.format(number(it["samples"], 4)), *(number(it[key], 4) for key in shown)) for label, it in spreads]
    text += table(head, rows) + "\n"
    if "yardstick_ms" in found.get("longer", {}):
        text += _yardstick(found["longer"])
    stages = [
        (r["stage"], number(r["ms"]), f"{100 * r['share']:.0f} %", number(r["calls_a_loop"])) for r in found["stages"]
    ]
    text += table(("called by the audit", "ms per loop", "share", "calls per loop"), stages)
    text += "\n(From a profiler, which makes small functions look more expensive than they are. Rows may overlap.)\n\n"
    text += LONGEST
    rows, before = [], None
    for row in found["samples_growth"]:
        linear = "" if before is None else number(_slope(before, row, "ms_all_samples"))
        rows.append((f"{row['samples']:,}", number(row["ms"]), number(row.get("ms_all_samples")), linear))
        before = row
    columns = ("samples", "ms, as configured", "ms, all samples identified", "growth of the latter, relative to linear")
    text += table(columns, rows) + "\n"
    for name, label in (("grid", "values of d"), ("search_space", "maximum na, nb, nc")):
        text += table((label, "one-parameter identification, ms"), [(r["value"], number(r["ms"])) for r in found[name]])
        text += "\n"
    return text


def _yardstick(longer: Figures) -> str:
    """How fast this machine was during the runs, and what the audits cost in that unit."""
    unit, least, samples = longer["yardstick_ms"], number(longer["ms_max_least"], 4), number(longer["samples"], 4)
    dearest, mean = number(longer["ms_max"] / unit), number(longer["ms_mean"] / unit)
    return (
        f"Each loop counts with the median of its runs. In its fastest run, no simulated loop of {samples} samples "
        f"took more than {least} ms. Between the runs, a million additions in a Python loop took {number(unit)} ms "
        f"(median): the most expensive audit cost {dearest} times that, the mean audit {mean} times. These ratios "
        "carry over to other machines better than the times do." + SLOWEST
    )


def _slope(before: Figures, row: Figures, name: str) -> float | None:
    if name not in before or name not in row:
        return None
    return row[name] / before[name] / (row["samples"] / before["samples"])


def _files(found: Figures) -> str:
    text = (
        "## Reading a file a loop\n\nEach file holds a day of one loop: PV, OP and SP once a minute. There are "
        f"{found['each']} files of each kind, all of different loops, so that how times, tags and values are written "
        "must be found out anew in each file (opened) before its rows become samples. `polars.read_csv(path)` reads "
        "the same files for comparison; it separates no loops and reads no times. CPU time of all threads, mean per "
        "file.\n\n"
    )
    rows = []
    for it in found["kinds"]:
        opened, read, polars = (number(it[name]) for name in ("opened_ms", "read_ms", "polars_ms"))
        rows.append((it["file"], opened, read, polars, number(it["read_ms"] / it["polars_ms"], 2)))
    return text + table(("file layout", "opened, ms", "opened and read, ms", "polars, ms", "times polars"), rows)


def _ingest(found: Figures) -> str:
    text = (
        f"## Reading a day of {found['loops']:,} loops\n\n{found['values'] / 1e6:.1f} million values go from the "
        "file to series in PostgreSQL. They are received (copied, fingerprinted and synced, as an upload is before its "
        "202) and then read by one worker. The comparison is `polars.read_csv(path)` (or `read_parquet`) on the same "
        "file, which reads no times, separates no loops and stores nothing. The share of its speed counts both our "
        "steps, end to end.\n\nPlain rows of long text are read in one compiled pass, other files by polars too. With "
        "polars alone, and tags compared with the order of the scan, parsing took 8.3 s of CPU instead of 4.8 s (timed "
        "once, side by side, on 2026-11-22); on a faster machine that difference decided whether the target was met."
        f"\n\n{_reading_runs(found)}\n\n"
    )
    head = (
        "file",
        "MB",
        "values",
        "received + read, s",
        "values per second",
        "polars, s (1 / 2 threads)",
        "share of its speed",
        "worker before / peak, MB",
    )
    rows = []
    for it in found["files"]:
        polars = " / ".join(number(it["polars_s"][threads]) for threads in ("1", "2"))
        share = " / ".join(number(it[f"share_of_polars_{threads}"], 2) for threads in ("1", "2"))
        memory = f"{number(it['before_mb'])} / {number(it['peak_mb'])}"
        speed = number(it["values_a_s"])
        took = f"{number(it['received_s'])} + {number(it['read_s'])}"
        rows.append((it["file"], number(it["mb"]), f"{it['values']:,}", took, speed, polars, share, memory))
    return text + table(head, rows)


def _reading_runs(found: Figures) -> str:
    """How often and in which order both were timed."""
    runs = [it["polars_runs_s"] | {"ours": it["runs_whole_s"]} for it in found["files"]]
    rounds = min(len(times) for it in runs for times in it.values())
    polars, ours = (max(max(it[who]) / min(it[who]) for it in runs) for who in ("2", "ours"))
    return (
        f"There were {rounds} rounds of one run each (polars with one thread, with two, then ours into an empty "
        f"database). Each run follows {number(found['rest_s'])} s of rest, so that none finds memory warm that another "
        f"has just freed. The median counts. The slowest run of a file took up to {number(polars)} times (polars, two "
        f"threads) and {number(ours)} times (ours) as long as the fastest."
    )


def _plant(found: Figures) -> str:
    head = (
        "loops", "workers", "wall, s", "loops per second", "ms per loop and worker", "engine, ms per loop",
        "engine's share",
        "peak memory of a worker, MB", "growth of its memory",
    )  # fmt: skip
    rows = []
    names = [name for name, _ in SCALING if name in found]
    order = ", ".join(str(found[name]["workers"]) for name in names)
    for name in (*names, "whole"):
        it = found[name]
        told = [number(it[key]) for key in ("wall_s", "loops_a_s", "ms_a_loop", "engine_ms_a_loop", "engine_share")]
        rows.append((f"{it['loops']:,}", it["workers"], *told, number(it["peak_mb"]), number(it["growth"])))
    failed = found["whole"]["failed"]
    return (
        f"## The plant's night\n\n{found['loops']:,} simulated loops of {found['samples']:,} samples go from rows in "
        f"PostgreSQL to verdicts in PostgreSQL, through Redis. Two workers do {number(found['scaling'])} times the "
        f"work of one, by the median times of runs with, in this order, {order} workers (so that whatever else the "
        f"machine does affects both alike). {failed} loops failed.\n\n"
        + table(head, rows)
        + "\nThe engine's share is the wall time inside the engine, as the workers measured it for each verdict, "
        "divided by workers times wall time. Growth is a worker's memory late in its life divided by that early in it, "
        "for the worst worker.\n"
    )


def _browser(found: Figures) -> str:
    if "skipped" in found:
        return f"Pages in a browser: skipped, {found['skipped']}.\n\n"
    head = ("page", "first paint, median", "slowest", "load event, median", "slowest")
    rows = [
        (name, *(number(it[key]) for key in ("painted_ms", "painted_max_ms", "loaded_ms", "loaded_max_ms")))
        for name, it in found.items()
    ]
    return f"In headless Chromium, with nothing cached and nothing else to do, in ms:\n\n{table(head, rows)}\n"


API_FIGURES = ("requests_a_s", "first_ms", "p50_ms", "p90_ms", "p99_ms", "max_ms", "service_cpu_ms", "kb")


def _api(found: Figures) -> str:
    head = ("request", "requests per second", "first", "p50", "p90", "p99", "maximum", "service's CPU", "kB")
    text = (
        f"## The API\n\n{found['loops']:,} loops, {found['nights']} nights, {found['verdict_rows']:,} verdicts. One "
        "client in a second process sends one request after another. Times are in ms.\n\n"
    )
    for name, label in (("busy", "While an audit runs on two workers"), ("idle", "With nothing else to do")):
        rows = []
        for request, it in found[name].items():
            told = [number(it[key]) for key in API_FIGURES]
            rows.append((request + (f" ({it['wrong']} refused)" if it["wrong"] else ""), *told))
        text += f"{label}:\n\n{table(head, rows)}\n"
    meanwhile = found["audits_meanwhile"]
    return (
        text
        + _browser(found.get("browser", {"skipped": "not measured yet"}))
        + f"{meanwhile['loops']:,} loops were audited during the busy measurement. The plant's summary takes "
        f"{number(found['summary_ms'])} ms. The service used at most {number(found['peak_mb'])} MB of memory.\n"
    )
