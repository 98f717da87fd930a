"""For those who run the service: liveness, readiness, Prometheus."""

from collections.abc import Iterable, Iterator
from typing import Any

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse

from app.http.backend import Services
from app.services.outward import ReadyOut
from app.services.upkeep.metrics import Metric
from app.services.upkeep.metrics import metrics as collected

PROMETHEUS = "text/plain; version=0.0.4; charset=utf-8"

router = APIRouter(tags=["operations"])


@router.get("/healthz", summary="Whether the process lives")
def healthz() -> dict[str, str]:
    return {"state": "alive"}


@router.get("/readyz", response_model=ReadyOut, responses={503: {"model": ReadyOut}}, summary="Whether it can work")
async def readyz(request: Request) -> Any:
    """200 when ready or degraded (the broker is away: uploads are kept, audits wait; or the database is read-only:
    pages and figures can be read, nothing is stored; or the data folder is: no export is taken; or all connections to
    read with are in use: requests wait for one), 503 otherwise, also where nothing is known after 5 s. The answer may
    be a second old, or some while the next one is awaited."""
    found = await request.app.state.ready.found()
    return JSONResponse(vars(found), status_code=503 if found.state == "not_ready" else 200)


@router.get("/metrics", response_class=PlainTextResponse, summary="Figures for Prometheus")
def metrics(backend: Services) -> PlainTextResponse:
    """Collected from the database at each scrape, so that all workers are counted."""
    return PlainTextResponse("".join(exposition(collected(backend))), media_type=PROMETHEUS)


def exposition(metrics: Iterable[Metric]) -> Iterator[str]:
    """Prometheus' text format."""
    for metric in metrics:
        yield f"# HELP {metric.name} {escaped(metric.help, quotes=False)}\n# TYPE {metric.name} {metric.kind}\n"
        for sample in metric.samples:
            labels = ",".join(f'{name}="{escaped(value)}"' for name, value in sample.labels.items())
            yield f"{metric.name}{'{' + labels + '}' if labels else ''} {figure(sample.value)}\n"


def figure(value: float) -> str:
    """All its digits: six of them would leave a time in seconds a quarter of an hour off."""
    return repr(int(value)) if float(value).is_integer() else repr(float(value))


def escaped(text: str, quotes: bool = True) -> str:
    text = text.replace("\\", "\\\\").replace("\n", "\\n")
    return text.replace('"', '\\"') if quotes else text
