"""docs/PERFORMANCE.md out of the figures: what was measured, beside what was promised, also where it misses."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from app.lab.bench.bench import Figures
from app.lab.bench.growth import growth
from app.lab.bench.plant import SCALING

TITLE = """# Performance

Measured, not promised: `make bench` wrote the figures on this page, from `docs/performance.json`, on the machine
described below; what was timed once beside it says so with its date. Times belong to that machine; ratios to peers
travel. A target that is missed stands here as missed.
"""

REPEAT = """## How to repeat it

```
make bench                                  # all sections, about twenty minutes, rewrites this page
make bench SECTIONS="search audit"          # some; the others keep their figures
.venv/bin/loopaudit bench --quick           # small sizes, to see that it runs
```

PostgreSQL and Redis are needed for ingest, plant and API (`POSTGRES=`, `REDIS=` name them; the Redis data base must be
empty). A data base is made and dropped. The machine should do nothing else meanwhile. `sippy-unipi` comes from
`requirements-bench.lock`; it is no dependency of the product.
"""


LONGEST = """The tables below are of one long record, its first samples in the first and its first 1,440 in the others:
a pressure loop of the simulated plant whose valve sticks (S 2 %, J 0.5 %), a value a minute. Such audits are dear.

"""

SLOWEST = """On the slowest machine seen the additions took
66 to 69 ms (engine 0.1.10, three runs on 2026-11-29): there simulated audits of 2,000 samples took 42 ms in the mean
and 72, 80 and 75 ms for the dearest, recordings 45 ms in the mean and 148, 183 and 190 ms for the dearest, so the
60 ms of the targets hold on a quicker machine only.

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
    """The machine of the newest figures, and any other one with the sections that were measured there."""
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
            lines.append(f"**Not so for {', '.join(names)}**: {machine}.\n")
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
    ("search", "one-parameter search, ms", "at most 5", "one_parameter.ms", _most(5)),
    ("search", "two-parameter search, ms", "at most 25", "two_parameter.ms", _most(25)),
    ("search", "a fit against statsmodels", "300,000 times", "statsmodels.ratio_to_the_search", _least(3e5)),
    ("search", "a fit against SIPPY", "10,000 times", "sippy.ratio_to_the_search", _least(1e4)),
    ("audit", "an audit of 2,000 samples, the dearest of 60, ms", "at most 60", "longer.ms_max", _most(60)),
    ("audit", "an audit of as many, the dearest recording, ms", "at most 60", "recorded.ms_max", _most(60)),
    ("plant", "the plant's night, min", "at most 8", "whole.wall_min", _most(8)),
    ("plant", "engine's share of it", "at least 0.8", "whole.engine_share", _least(0.8)),
    ("plant", "two workers over one", "at least 1.85", "scaling", _least(1.85)),
    ("plant", "a worker's memory, MB", "at most 400", "whole.peak_mb", _most(400)),
    (
        "ingest",
        "long CSV, end to end, share of polars (2 threads)",
        "at least 0.25",
        "by_time.share_of_polars_2",
        _least(0.25),
    ),
    (
        "ingest",
        "wide CSV, end to end, share of polars (2 threads)",
        "at least 0.25",
        "wide.share_of_polars_2",
        _least(0.25),
    ),
    ("ingest", "a file of at least, MB, goes through", "2,000", "by_time.mb", _least(2000)),
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
    head = ("grid", "fits", "ms", "µs a fit", "arithmetic limit of the Gram matrices, ms", "times the limit")
    text = (
        f"## The order search\n\n{found['record']}, N = {found['samples']}, {found['orders']} orders, one thread.\n\n"
    )
    text += table(head, rows)
    text += f"\nAn exact fit of one order of ours (`refine`): {number(found['ours_refined']['ms_a_fit'])} ms.\n\n"
    return text + "".join(_peer(found, name, label) for name, label in PEERS)


PEERS = (("statsmodels", "statsmodels (SARIMAX with exogenous input)"), ("sippy", "SIPPY (ARMAX, ILLS)"))


def _peer(found: Figures, name: str, label: str) -> str:
    it = found[name]
    if "skipped" in it:
        return f"**{label}**: skipped, {it['skipped']}.\n\n"
    text = (
        f"**{label}**: {number(it['s_a_fit'])} s a fit (mean of {it['fits']}); the whole search would take "
        f"{number(it['search_would_take_h'])} h. A fit of the search is {number(it['ratio_to_the_search'])} times as "
        f"fast, our exact fit {number(it['ratio_to_our_exact_fit'])} times. Same choice in {it['choices_alike']} of "
        f"{it['choices']} comparisons (the order for a band, the band for an order)."
    )
    gaps = [apart["our_aic_gap"] for apart in it["apart"] if "our_aic_gap" in apart]
    if gaps:
        text += f" Where not, our criterion holds the peer's choice to be worse by {number(max(gaps), 2)} at most."
    return text + "\n\n"


SPREADS = (("", "{}, simulated"), ("longer", "{}, simulated"), ("recorded", "{} at most, recorded in plants"))
"""Groups of loops whose audits are timed, by their key in the section, and what the page calls their samples."""


def _audit(found: Figures) -> str:
    text = "## A whole audit\n\nProcessor time of one thread, every part of the audit switched on.\n\n"
    shown = ("loops", "ms_mean", "ms_median", "ms_p95", "ms_max")
    head = ("samples", "loops", "mean, ms", "median", "95th percentile", "greatest")
    spreads = [(label, found[name] if name else found) for name, label in SPREADS if not name or name in found]
    rows = [(label.format(number(it["samples"], 4)), *(number(it[key], 4) for key in shown)) for label, it in spreads]
    text += table(head, rows) + "\n"
    if "yardstick_ms" in found.get("longer", {}):
        text += _yardstick(found["longer"])
    stages = [
        (r["stage"], number(r["ms"]), f"{100 * r['share']:.0f} %", number(r["calls_a_loop"])) for r in found["stages"]
    ]
    text += table(("called by the audit", "ms a loop", "share", "calls a loop"), stages)
    text += (
        "\n(By a profiler, which makes small functions look dearer than they are; rooms may contain each other.)\n\n"
    )
    text += LONGEST
    rows, before = [], None
    for row in found["samples_growth"]:
        linear = "" if before is None else number(_slope(before, row, "ms_all_samples"))
        rows.append((f"{row['samples']:,}", number(row["ms"]), number(row.get("ms_all_samples")), linear))
        before = row
    columns = ("samples", "ms, as configured", "ms, all samples identified", "growth of the latter against linear")
    text += table(columns, rows) + "\n"
    for name, label in (("grid", "values of d"), ("search_space", "greatest na, nb, nc")):
        text += table((label, "one-parameter identification, ms"), [(r["value"], number(r["ms"])) for r in found[name]])
        text += "\n"
    return text


def _yardstick(longer: Figures) -> str:
    """How fast this machine was meanwhile, and what the audits cost in that unit."""
    unit, least, samples = longer["yardstick_ms"], number(longer["ms_max_least"], 4), number(longer["samples"], 4)
    dearest, mean = number(longer["ms_max"] / unit), number(longer["ms_mean"] / unit)
    return (
        f"Each is a median; of the {samples} simulated samples none cost more than {least} ms at its quickest. Between "
        f"these a million additions in a loop of Python took {number(unit)} ms (a median): the dearest audit cost "
        f"{dearest} times that, the mean one {mean} times, and these ratios travel better than the times. " + SLOWEST
    )


def _slope(before: Figures, row: Figures, name: str) -> float | None:
    if name not in before or name not in row:
        return None
    return row[name] / before[name] / (row["samples"] / before["samples"])


def _files(found: Figures) -> str:
    text = (
        "## Reading a file a loop\n\nA day of one loop in each file, PV, OP and SP once a minute, "
        f"{found['each']} files of each kind, no two of one loop: how times, tags and values are written is found out "
        "in each file anew (opened), then its rows become samples. Beside it `polars.read_csv(path)` of the same "
        "files, which parts no loops and reads no times. Processor time of all threads, the mean of a file.\n\n"
    )
    rows = []
    for it in found["kinds"]:
        opened, read, polars = (number(it[name]) for name in ("opened_ms", "read_ms", "polars_ms"))
        rows.append((it["file"], opened, read, polars, number(it["read_ms"] / it["polars_ms"], 2)))
    return text + table(("a file of", "opened, ms", "opened and read, ms", "polars, ms", "times polars"), rows)


def _ingest(found: Figures) -> str:
    text = (
        f"## Reading a day of {found['loops']:,} loops\n\n{found['values'] / 1e6:.1f} million values; from the file "
        "to series in PostgreSQL: received (copied, fingerprinted and synced, as an upload is before its 202) and read "
        "by one worker, beside `polars.read_csv(path)` (or `read_parquet`) of the same file, which reads no times, "
        "parts no loops and stores nothing. Plain rows of long text are read in one compiled pass, others by polars "
        "too: with polars alone, tags compared with the order of the scan, parsing took 8.3 s of CPU instead of 4.8 s "
        "(timed once, beside each other, on 2026-11-22), and the time between decided on this target on a faster "
        f"machine. The share is of both together, end to end. {_reading_runs(found)}\n\n"
    )
    head = (
        "file",
        "MB",
        "values",
        "received + read, s",
        "values a second",
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
        f"{rounds} rounds of one run each (polars with one thread, with two, then ours into an empty data base), each "
        f"after {number(found['rest_s'])} s of rest, so that none finds memory warm that another has just freed; the "
        f"median counts. The slowest run of a file took up to {number(polars)} (polars, two threads) and "
        f"{number(ours)} times (ours) as long as the fastest."
    )


def _plant(found: Figures) -> str:
    head = (
        "loops", "workers", "wall, s", "loops a second", "ms a loop and worker", "engine, ms a loop", "engine's share",
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
        f"## The plant's night\n\n{found['loops']:,} simulated loops of {found['samples']:,} samples, from rows in "
        f"PostgreSQL to verdicts in PostgreSQL, through Redis. Two workers do {number(found['scaling'])} "
        f"times the work of one (by the median times of runs with, in this order, {order} workers, so that what the "
        f"machine does meanwhile falls on both). {failed} loops failed.\n\n"
        + table(head, rows)
        + "\nThe engine's share: wall time inside of the engine, as the workers measured it for each verdict, over "
        "workers times wall time. Growth: memory late in a worker's life over that early in it, the worst worker.\n"
    )


def _browser(found: Figures) -> str:
    if "skipped" in found:
        return f"Pages in a browser: skipped, {found['skipped']}.\n\n"
    head = ("page", "first paint, median", "slowest", "load event, median", "slowest")
    rows = [
        (name, *(number(it[key]) for key in ("painted_ms", "painted_max_ms", "loaded_ms", "loaded_max_ms")))
        for name, it in found.items()
    ]
    return f"In headless Chromium, nothing cached, with nothing else to do; ms:\n\n{table(head, rows)}\n"


API_FIGURES = ("requests_a_s", "first_ms", "p50_ms", "p90_ms", "p99_ms", "max_ms", "service_cpu_ms", "kb")


def _api(found: Figures) -> str:
    head = ("request", "requests a second", "first", "p50", "p90", "p99", "greatest", "service's processor", "kB")
    text = (
        f"## The API\n\n{found['loops']:,} loops, {found['nights']} nights, {found['verdict_rows']:,} verdicts; one "
        "client in a second process, one request after the other; times in ms.\n\n"
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
        + f"Meanwhile {meanwhile['loops']:,} loops were audited. The plant's summary takes "
        f"{number(found['summary_ms'])} ms. Memory of the service: {number(found['peak_mb'])} MB at most.\n"
    )
