"""What grows with what, carried from what was measured to 100,000 loops: what breaks first, and what to add."""

import math

from app.lab.bench.bench import Figures
from app.settings import Settings

LOOPS = 100_000
NIGHT_H = 6.0
KEPT_DAYS = {
    "series": Settings.model_fields["keep_series_days"].default,
    "verdict_details": Settings.model_fields["keep_details_days"].default,
    "verdicts": Settings.model_fields["keep_verdicts_days"].default,
}
"""Unless it is set otherwise."""


def growth(sections: Figures) -> str:
    """The page's part on growth; without a measured plant there is nothing to carry on."""
    plant = sections.get("plant", {})
    if "whole" not in plant:
        return "## Growth\n\nNeeds the section `plant`.\n"
    lines = ["## Growth to 100,000 loops", "", *_cost(plant), "", *_storage(plant), "", *_first(plant, sections)]
    return "\n".join(lines) + "\n"


def _cost(plant: Figures) -> list[str]:
    whole = plant["whole"]
    some = plant["some_2"]
    ratio = whole["ms_a_loop"] / some["ms_a_loop"]
    hours = LOOPS * whole["ms_a_loop"] / 3.6e6
    needed = max(1, math.ceil(hours / NIGHT_H))
    can_do = "one worker does" if needed == 1 else f"{needed} workers do"
    return [
        f"A loop costs {whole['ms_a_loop']:.0f} ms of a worker in a run of {whole['loops']:,} loops and "
        f"{some['ms_a_loop']:.0f} ms in one of {some['loops']:,} ({ratio:.2f} times): the cost is linear in loops. "
        f"100,000 loops need {hours:.1f} worker hours a night, that is {hours / 2 * 60:.0f} minutes with two workers; "
        f"{can_do} it within {NIGHT_H:.0f} hours. Two workers did {plant['scaling']:.2f} times the work of one; what "
        "they share is the database.",
    ]


def _storage(plant: Figures) -> list[str]:
    per = plant["storage"]
    rows = ["| table | bytes per loop and night | 14,000 loops, a year | 100,000 loops, a year |", "|---|---|---|---|"]
    for name, size in per.items():
        rows.append(
            f"| {name} | {size:,.0f} | {size * 14_000 * 365 / 1e9:,.0f} GB | {size * LOOPS * 365 / 1e9:,.0f} GB |"
        )
    return rows


def _first(plant: Figures, sections: Figures) -> list[str]:
    table_kb = sections.get("api", {}).get("busy", {}).get("table, whole", {}).get("kb")
    loops = sections.get("api", {}).get("loops") or 1
    whole = f": with 100,000 rows {table_kb / loops * LOOPS / 1e3:.0f} MB" if table_kb else ""
    return [
        "What reaches its limit first, in this order, and what to do then:",
        "",
        f"1. **Disk**: {_disk(plant['storage'])}. Keep series for weeks (an audit reads the newest week) and "
        "`verdict_details` for a month, or move the packed stretches of series to object storage and leave their keys "
        "in PostgreSQL. If you keep months of them, partition both by month: retention is then a DROP instead of "
        "millions of deletes.",
        f"2. **Answers that hold every loop**{whole}. They stop at 20,000 rows: read pages, or one unit at a time.",
        "3. **Worker hours**: add workers on other machines. A claim is one short statement for a chunk of loops; "
        "dozens of workers can share a database before claims are felt.",
        "4. **Verdicts**: 36 million rows a year. Reads go by loop or by run through an index and are not affected; "
        "vacuum and backups are. At that size, partition `verdicts` by run and keep `verdict_details` for months only.",
        "5. **One file with the whole day**: 430 million values. It needs no more memory, but only one worker reads "
        "it. Send one file per unit, and as many workers read as there are files.",
    ]


def _disk(per: Figures) -> str:
    """Bytes a night, and what they come to with the days for which they are kept."""
    a_night = {name: per[name] * LOOPS / 1e9 for name in KEPT_DAYS}
    parts = ", ".join(f"{size:.1f} of `{name}`" for name, size in a_night.items())
    kept = ", ".join(
        f"{size * KEPT_DAYS[name]:,.0f} GB of `{name}` ({KEPT_DAYS[name]:,} days)" for name, size in a_night.items()
    )
    return f"{sum(a_night.values()):.1f} GB a night ({parts}), and with the default retention {kept}"
