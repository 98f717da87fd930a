"""The first pages: the plant's reliability table, and a page a loop."""

from pathlib import Path
from typing import Any

import plotly
from fastapi import APIRouter
from fastapi.responses import FileResponse, HTMLResponse
from fastapi.staticfiles import StaticFiles

from app.api.backend import Services
from app.api.paths import LoopTag
from app.errors import NotFoundError
from app.services import loops, reliability
from app.services.wording import VERDICT_RANK, VERDICT_WORDS, worst_first
from app.web.explanation import newest_in_words
from app.web.rendering import STATIC, figure, page

SHOWN_ROWS = 20_000
CHARTS = Path(plotly.__file__).parent / "package_data" / "plotly.min.js"
A_WEEK = {"Cache-Control": "public, max-age=604800"}

router = APIRouter(include_in_schema=False)
static = StaticFiles(directory=STATIC)


@router.get("/")
def plant(backend: Services) -> HTMLResponse:
    table = reliability.reliability_page(backend, limit=SHOWN_ROWS)
    rows = worst_first(table.rows)
    return page("plant.html", rows=rows, tiles=tiles(rows), more=table.next_cursor is not None)


@router.get("/loops/{tag:path}")
def loop(backend: Services, tag: LoopTag) -> HTMLResponse:
    found = loops.get_loop(backend, tag)
    explained = newest_in_words(backend, tag)
    try:
        row = loops.loop_health(backend, tag)
    except NotFoundError:
        return page("loop.html", tag=found.tag, row=None, rmse=None, explanation=explained)
    detail = loops.verdict_detail(backend, tag)
    reasons = [reason["text"] for reason in detail["reasons"]]
    told = {"reasons": reasons, "figures": figures(row), "rmse": rmse_curve(detail), "explanation": explained}
    return page("loop.html", tag=found.tag, row=row, **told)


@router.get("/static/plotly.min.js")
def charts() -> FileResponse:
    """The chart library out of its Python package: nothing is fetched from elsewhere."""
    return FileResponse(CHARTS, media_type="text/javascript", headers=A_WEEK)


def rmse_curve(detail: dict[str, Any]) -> dict[str, Any] | None:
    """RMSE over the stiction band, as the last rung of the ladder found it."""
    if not detail["rungs"]:
        return None
    curve = detail["rungs"][-1]["one_parameter"]
    return {name: curve[name] for name in ("d", "rmse", "best")}


def tiles(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """How many loops of each verdict, and of how many it can be relied on."""
    return [
        {
            "verdict": verdict,
            "words": VERDICT_WORDS[verdict],
            "count": sum(row["verdict"] == verdict for row in rows),
            "reliable": None
            if verdict == "not_auditable"
            else sum(row["verdict"] == verdict and row["reliability"] == "reliable" for row in rows),
        }
        for verdict in VERDICT_RANK
    ]


def figures(row: dict[str, Any]) -> list[tuple[str, str]]:
    """The key figures of a verdict, in words and with units."""
    orders = "/".join(str(row[f"hammerstein_{n}"]) for n in ("na", "nb", "nc")) if row["hammerstein_na"] else "–"
    return [
        ("Samples", str(row["samples"])),
        ("Sampling interval", f"{figure(row['sampling_interval_s'], 1)} s"),
        ("Period of the oscillation", f"{figure(row['oscillation_period_s'], 0)} s"),
        ("Yper", f"{figure(row['yper_pct'], 1)} %"),
        ("Stiction band", f"{figure(row['stiction_band_pct_of_op_range'], 1)} % of the range of OP"),
        ("S and J", f"{figure(row['hammerstein_S'], 2)} and {figure(row['hammerstein_J'], 2)} (units of OP)"),
        ("ARMAX orders na/nb/nc", orders),
        (
            "Search space",
            f"{row['hammerstein_search_space'] or '–'}, widened {row['hammerstein_widenings'] or 0} times",
        ),
        ("Likely cause", (row["likely_cause"] or "not known").replace("_", " ")),
        ("Audited window", f"{row['window_start'] or '–'} to {row['window_end'] or '–'}"),
        ("Audited at", row["audited_at"] or "–"),
        ("Engine", row["engine_version"]),
    ]
