"""Reports: what is known of a loop or of the plant, in one HTML file that needs neither network nor scripts."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from markupsafe import Markup

from app.errors import NotFoundError
from app.services import loops
from app.services.addresses import loop_address
from app.services.backend import Backend
from app.services.explaining import explanations
from app.services.explaining.wording import in_words
from app.services.moments import PlantClock, iso_utc, seconds_of
from app.services.plant.arrivals import arrivals
from app.services.plant.charts import charts
from app.services.plant.course import course, unit_columns
from app.services.plant.groups import plant_groups, told_apart
from app.services.plant.judged import judged
from app.services.plant.loop_sheet import loop_head, loop_sheet
from app.services.plant.overview import Overview
from app.services.plant.plant_sheet import plant_sheet
from app.services.plant.reliability import count, table
from app.services.plant.sticking import sticking
from app.services.plant.work_list import work_list
from app.services.plant.worst import complaints_of_old, complaints_of_units, nothing_worst
from app.services.rendering import document
from app.services.reports.svg import WIDTH, Ends, Line, chart
from app.services.stating import notes
from app.services.stating.shelving import Shelf, shelf
from app.services.telling.asked_wording import asked_words
from app.services.telling.wording import measured_probability
from app.storage.asked_rows import RowFilter

NOTES = 20
NOT_AUDITED = "no loop of the plant has been audited yet"
MOST_TOGETHER = 50
"""Reports in one file: some ten megabytes, which a browser can still lay out and print."""
WORST_OF_UNIT = 5
REFUSED = 200
UNITS_BY_NIGHT = 8
COMPLAINTS = ("stiction", "inconclusive")
PV, OP, SP, VALVE, GOOD = "#0b5394", "#b3261e", "#8a5a00", "#7a3fa0", "#1a6b3c"
COLOURS = {"stiction": "#b3261e", "inconclusive": "#c98a1b", "not_auditable": "#8794a3", "no_stiction": "#2f8f57"}
BAR_WIDTH = 180


def loop_report(backend: Backend, tag: str) -> str:
    """Raises NotFoundError for a loop that there is not, or that was never audited."""
    plant_groups(backend)  # a page is loaded again when they are known, a file is not
    return document("loop_report.html", **_told_of(backend, tag, shelf(backend)))


def loop_reports(
    backend: Backend, filters: RowFilter | None = None, sort: str = "-priority", most: int = MOST_TOGETHER
) -> str:
    """The reports of the loops that fit, in this order, in one file: the first `most` of them."""
    plant_groups(backend)
    shelved = shelf(backend)
    page = table(backend, most, sort=sort, filters=filters, shelved=shelved)
    reports: list[dict[str, Any]] = []
    meanings: dict[str, Any] = {}
    for row in page.rows:
        try:
            told = _told_of(backend, row["loop"], shelved)
        except NotFoundError:  # its verdict went with an old run since the table was read
            continue
        meanings |= {figure.label: figure for figure, _, _ in told["figures"]}
        reports.append({"it": told["it"], "row": told["row"], "html": Markup(document("_loop.html", **told))})  # noqa: S704 - our own template, which escapes
    values = {
        "reports": reports,
        "meanings": list(meanings.values()),
        "counted": count(backend, filters or RowFilter()),
    }
    values["asked"], values["of_run"] = (asked_words(filters), filters.audit_id) if filters else ("", None)
    return document("loop_reports.html", **values, **_made(backend))


def _told_of(backend: Backend, tag: str, shelved: Shelf) -> dict[str, Any]:
    """By the names of the template of one loop."""
    found = loops.find(backend, tag)
    explained = explanations.newest(backend, tag)
    sheet = loop_sheet(backend, found, explained, shelved)
    together, by_chance = told_apart(sheet["groups"])
    drawn = charts(backend, tag)
    written = notes.list_notes(backend, found)
    return {
        **(loop_head(backend, found, shelved) | sheet | {"groups": together}),
        "by_chance": by_chance,
        "notes": written[:NOTES],
        "more_notes": max(len(written) - NOTES, 0),
        "explanation": in_words(explained, backend.clock) if explained and explained["state"] == "done" else None,
        "trend": _trend(drawn, backend.clock),
        "damage": drawn["damage"],
        "path": _path(drawn),
        "path_of": _path_of(drawn),
        "course": _course(sheet["history"], backend.clock),
        "address": loop_address(backend.settings.public_url, tag),
        **_made(backend),
    }


def plant_report(backend: Backend) -> str:
    """Raises NotFoundError where nothing has been audited."""
    reach = arrivals(backend)
    plant_groups(backend)
    sheet = plant_sheet(backend, reach)
    seen, by = sheet["seen"], sheet["listing"]
    if not seen.audited:
        why = "no loop of the plant is in service" if seen.retired and not seen.loops else NOT_AUDITED
        raise NotFoundError("not_audited", why)
    worst = complaints_of_units(backend, by, WORST_OF_UNIT)
    old = complaints_of_old(backend, by)
    nights = course(backend)
    listed = [row["loop"] for rows in (*(rows for _, rows in worst), old) for row in rows]
    return document(
        "plant_report.html",
        **sheet,
        bars={unit.unit: _bar(unit.verdicts) for unit in seen.units},
        work=work_list(backend, by),
        sticking=sticking(backend, by.shelf, seen.reliable.get("stiction", 0)),
        course=nights,
        course_units=unit_columns(nights, UNITS_BY_NIGHT),
        worst=worst,
        more_of={unit: _more_of(seen, unit, rows) for unit, rows in worst},
        nothing_worst=nothing_worst(seen.verdicts.get("stiction", 0), bool(old)),
        old=old,
        judged=judged(backend, listed),
        refused=table(backend, REFUSED, sort="loop", filters=RowFilter(verdict=("not_auditable",))).rows,
        public_url=backend.settings.public_url,
        address_of=lambda tag: loop_address(backend.settings.public_url, tag),
        **_made(backend),
    )


def _more_of(seen: Overview, unit: str | None, listed: Sequence[Mapping[str, Any]]) -> dict[str, int]:
    """How many loops of a unit stick or may, by verdict, whatever keeps them from being listed; empty where all
    of them are."""
    counted = next((one.verdicts for one in seen.units if one.unit == unit), {})
    complaints = {code: counted[code] for code in COMPLAINTS if counted.get(code)}
    shown = sum(row["verdict"] in COMPLAINTS for row in listed)
    return complaints if sum(complaints.values()) > shown else {}


def _made(backend: Backend) -> dict[str, Any]:
    return {"plant_name": backend.settings.plant, "made_at": iso_utc(datetime.now(UTC)), "clock": backend.clock}


def _trend(drawn: Mapping[str, Any], clock: PlantClock) -> list[Markup]:
    trend = drawn["trend"]
    if trend is None:
        return []
    x = [seconds_of(stamp) for stamp in trend["time"]]
    first, last = trend["time"][0], trend["time"][-1]
    ends = Ends(x[0], x[-1], clock.short(first), clock.told(last), "the audited window is shaded")
    window = drawn["window"]
    shaded = (seconds_of(window[0]), seconds_of(window[1])) if window else None
    above = [Line("PV", trend["pv"], PV), *([Line("SP", trend["sp"], SP)] if trend.get("sp") else [])]
    valve = [Line("valve, estimated", trend["valve"], VALVE)] if trend.get("valve") and drawn["size"] else []
    below = [Line("OP", trend["op"], OP), *valve]
    return [
        chart(x, above, ends, title="PV and SP over time", shaded=shaded),
        chart(x, below, ends, title="OP over time", shaded=shaded),
    ]


def _path(drawn: Mapping[str, Any]) -> Markup | None:
    path = drawn["pv_op"]
    if path is None or len(set(path["pv"])) < 2:  # a PV that stands draws none
        return None
    low, high = min(path["op"]), max(path["op"])
    ends = Ends(low, high, f"{low:.4g}", f"{high:.4g}", "OP")
    return chart(
        path["op"], [Line("PV over OP", path["pv"], PV)], ends, title="PV over OP", height=320, width=WIDTH // 2
    )


def _path_of(drawn: Mapping[str, Any]) -> str:
    path = drawn["pv_op"] or {"samples": 0, "shown": 0}
    window = "the audited window" if drawn["window"] else "what was given to the audit"
    of = "the stretch that speaks for the record" if drawn["judged"] else window
    whole = path["shown"] == path["samples"]
    count = f"All {path['samples']:,}" if whole else f"The newest {path['shown']:,} of the {path['samples']:,}"
    return f"{count} samples of {of}."


def _course(history: Sequence[Mapping[str, Any]], clock: PlantClock) -> Markup | None:
    if len(history) < 2:
        return None
    nights = list(reversed(history))
    x = [seconds_of(night["audited_at"]) for night in nights]
    measured = [measured_probability(night) for night in nights]
    probability = [None if value is None else 100.0 * value for value in measured]
    ends = Ends(x[0], x[-1], clock.short(nights[0]["audited_at"]), clock.short(nights[-1]["audited_at"]))
    lines = [
        Line("probability of stiction, %", probability, OP, dots=True),
        Line("health", [night["health"] for night in nights], GOOD, dots=True),
    ]
    return chart(x, lines, ends, title="Probability of stiction and health, night by night", limits=(-3.0, 103.0))


def _bar(counted: Mapping[str, int]) -> Markup:
    """A unit's loops by verdict, as a bar; the numbers stand beside it."""
    total, at, parts = sum(counted.values()) or 1, 0.0, []
    for verdict, colour in COLOURS.items():
        wide = BAR_WIDTH * counted.get(verdict, 0) / total
        parts.append(Markup('<rect x="{:.1f}" width="{:.1f}" height="12" fill="{}"/>').format(at, wide, colour))
        at += wide
    whole = Markup('<svg viewBox="0 0 {0} 12" width="{0}" height="12" aria-hidden="true">{1}</svg>')
    return whole.format(BAR_WIDTH, Markup("").join(parts))
