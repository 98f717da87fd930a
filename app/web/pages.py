"""The plant, its table, its groups, and what each figure means."""

from importlib.metadata import version
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query
from fastapi.responses import HTMLResponse
from fastapi.staticfiles import StaticFiles
from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from starlette.responses import FileResponse, JSONResponse

from app.engine.codes import UNANSWERED
from app.engine.plant_wide.groups import IN_STEP
from app.http.backend import Services
from app.services.auditing.audits import get_audit
from app.services.cursors import LONGEST as LONGEST_CURSOR
from app.services.cursors import identifier
from app.services.loops import RETIRED
from app.services.plant import groups as grouped
from app.services.plant import overview as plants
from app.services.plant import reliability
from app.services.plant.arrivals import arrivals
from app.services.plant.course import course, unit_columns
from app.services.plant.glossary import FIGURES
from app.services.plant.judged import judged
from app.services.plant.nights import nights
from app.services.plant.plant_sheet import plant_sheet
from app.services.plant.reliability import RowFilter
from app.services.plant.worst import WORST, listed_first, worst_of_old
from app.services.reports.documents import MOST_TOGETHER
from app.services.telling.asked_wording import asked_words
from app.services.telling.health_classes import BOUNDS, HealthClass
from app.services.telling.next_steps import OF_NO_VERDICT
from app.services.telling.wording import CAUSE_WORDS, RELIABILITY_WORDS, VERDICT_WORDS
from app.web import loop, loop_list, runs, uploads
from app.web.columns import COLUMNS, USUAL, orders, query_without, sorted_column
from app.web.rendering import CHARTS, STATIC, page

A_WEEK = {"Cache-Control": "public, max-age=604800"}
ROWS_A_PAGE = 100
WORST_FIRST = "-priority"
CHANGES, GROUPS, UNITS = 10, 5, 12
YES_NO = {"true": True, "false": False}

router = APIRouter(include_in_schema=False)
for module in (loop, loop_list, runs, uploads):
    router.include_router(module.router)
static = StaticFiles(directory=STATIC)


class TableForm(BaseModel):
    """What the form above the table sends; empty means: any."""

    model_config = ConfigDict(extra="ignore")

    search: str = Field("", max_length=200)
    unit: str = Field("", max_length=200)
    no_unit: Literal["", "true", "false"] = ""
    owner: str = Field("", max_length=200)
    verdict: str = Field("", max_length=40)
    reliability: str = Field("", max_length=40)
    likely_cause: str = Field("", max_length=100)
    health_class: Literal["", HealthClass] = ""
    retired: Literal["", "false", "true", "any"] = ""
    open_order: Literal["", "true", "false"] = ""
    audit_id: str = Field("", max_length=40)
    sort: Annotated[str, AfterValidator(lambda name: name or WORST_FIRST)] = Field(WORST_FIRST, max_length=60)
    cursor: str = Field("", max_length=LONGEST_CURSOR)
    column: list[str] = Field([], max_length=len(COLUMNS))

    @property
    def narrows(self) -> bool:
        """Whether a loop that has a verdict may be left out, but for one that is retired."""
        words = (
            self.search,
            self.unit,
            self.owner,
            self.verdict,
            self.reliability,
            self.likely_cause,
            self.health_class,
        )
        return any((*words, self.no_unit, self.open_order, self.audit_id, self.cursor)) or self.retired == "true"

    @property
    def unknown(self) -> str:
        """That there is no such verdict or reliability, as a sentence; empty where there is."""
        if self.verdict and self.verdict not in VERDICT_WORDS:
            return f"There is no verdict {self.verdict!r}."
        if self.reliability and self.reliability not in RELIABILITY_WORDS:
            return f"There is no reliability {self.reliability!r}."
        return ""

    def filters(self) -> RowFilter:
        return RowFilter(
            verdict=(self.verdict,) if self.verdict else None,
            reliability=self.reliability or None,
            unit=self.unit or None,
            owner=self.owner or None,
            likely_cause=self.likely_cause or None,
            health=BOUNDS[self.health_class] if self.health_class else None,
            search=self.search or None,
            retired=RETIRED[self.retired or "false"],
            open_order=YES_NO.get(self.open_order),
            no_unit=YES_NO.get(self.no_unit),
            audit_id=identifier(self.audit_id) if self.audit_id else None,
        )


@router.get("/")
def plant(backend: Services) -> HTMLResponse:
    reach = arrivals(backend)
    sheet = plant_sheet(backend, reach)
    audited, changed, by = sheet["seen"].audited, sheet["changed"], sheet["listing"]
    today, worst = listed_first(backend, by, changed) if audited else ([], [])
    any_old = audited and (reach.behind or reach.undated)
    old = worst_of_old(backend, by) if any_old else []
    listed = [row["loop"] for row in [*today[:CHANGES], *worst, *old]]
    return page(
        "plant.html",
        backend.clock,
        **sheet,
        today=today,
        unanswered_cause=UNANSWERED,
        worst=worst,
        old=old,
        last_nights=nights(backend, listed + [row.loop for row in changed.rows[:CHANGES]]),
        judged=judged(backend, listed),
        most_changes=CHANGES,
        no_room_for_more=len(worst) >= WORST,
        most_groups=GROUPS,
    )


@router.get("/plant/tiles")
def tiles(backend: Services, unit: Annotated[str | None, Query(max_length=200)] = None) -> JSONResponse:
    """Units with their worst loops; with `unit` (empty: the loops that name none) more of that one."""
    return JSONResponse(plants.tiles(backend) if unit is None else plants.unit_tiles(backend, unit or None))


@router.get("/plant/course")
def plant_course(backend: Services) -> HTMLResponse:
    """How many valves stick night by night, for the page of the plant, which does not wait for it."""
    return page("_course.html", backend.clock, course=course(backend))


@router.get("/table")
def table(backend: Services, form: Annotated[TableForm, Query()]) -> HTMLResponse:
    names = [name for name in form.column if name in COLUMNS] or list(USUAL)
    run, asked = get_audit(backend, form.audit_id) if form.audit_id else None, form.filters()
    found = reliability.table(backend, ROWS_A_PAGE, form.cursor or None, form.sort, asked)
    listed = [row["loop"] for row in found.rows]
    told: dict[str, Any] = form.model_dump(exclude={"cursor"}) | {"column": names}
    if run is not None:  # of a run the API leaves none out unless it is told so
        told["retired"] = form.retired or "false"
    return page(
        "table.html",
        backend.clock,
        rows=found.rows,
        run=run,
        most_reports=MOST_TOGETHER,
        place=reliability.page_place(backend, ROWS_A_PAGE, form.cursor or None, form.sort, asked),
        asked=asked_words(asked),
        last_nights=nights(backend, listed, asked.audit_id),
        judged=judged(backend, listed, asked.audit_id),
        next_cursor=found.next_cursor,
        form=form,
        names=names,
        columns=COLUMNS,
        sorted_by=sorted_column(form.sort),
        orders=orders(names, form.sort),
        units=plants.unit_names(backend),
        owners=plants.owner_names(backend),
        causes=sorted(map(cause_to_ask_for, CAUSE_WORDS), key=lambda cause: cause[1].casefold()),
        address=query_without(told),
        told=told,
        query_without=query_without,
    )


def cause_to_ask_for(code: str) -> tuple[str, str]:
    """With its words: some causes of a verdict, and of that there is none, have the same ones."""
    return code, f"{CAUSE_WORDS[code]}{' (not auditable)' if code in OF_NO_VERDICT else ''}"


@router.get("/groups")
def groups(backend: Services) -> HTMLResponse:
    found = grouped.shown(backend)
    shaken, by_chance = grouped.told_apart(found.groups or ())
    audited = bool(found.groups) or reliability.count(backend, RowFilter()) > 0
    told = {"groups": shaken, "by_chance": by_chance, "known": found.groups is not None, "before": found.before}
    return page("groups.html", backend.clock, in_step_from=IN_STEP, audited=audited, **told)


@router.get("/nights")
def by_night(backend: Services) -> HTMLResponse:
    """A page of its own: it reads the verdicts of a fortnight."""
    nights_of_plant = course(backend)
    return page("nights.html", backend.clock, course=nights_of_plant, units=unit_columns(nights_of_plant, UNITS))


@router.get("/glossary")
def glossary() -> HTMLResponse:
    return page("glossary.html", figures=FIGURES, product_version=version("loopaudit"))


@router.get("/static/plotly.min.js")
def charts() -> FileResponse:
    """The chart library out of its Python package: nothing is fetched from elsewhere."""
    return FileResponse(CHARTS, media_type="text/javascript", headers=A_WEEK)
