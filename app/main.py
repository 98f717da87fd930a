"""The web application: API and pages on one backend."""

import asyncio
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from importlib.metadata import version
from typing import Any
from weakref import WeakValueDictionary

from fastapi import Depends, FastAPI
from fastapi.concurrency import run_in_threadpool

from app.api import operations
from app.api.reliability import PARTS_AT_ONCE
from app.api.routes import api
from app.api.schema import described
from app.http import problems
from app.http.bodies import LimitBodies
from app.http.compressing import CompressApi
from app.http.crowding import LimitCrowd
from app.http.guard import Guard
from app.http.headers import SecurityHeaders, WholeFiles
from app.http.heads import AnswerHead
from app.http.parameters import no_zero_bytes
from app.http.paths import KeepTagsEncoded, OneSlashLess
from app.http.probing import Probe
from app.http.receiving import MAPPINGS_AT_ONCE
from app.http.request_ids import RequestIds
from app.http.stopping import AnswerWhenStopped, all_told
from app.services.access.authentication import Authenticator
from app.services.access.rates import Rates
from app.services.backend import Backend
from app.services.upkeep.readiness import NO_ANSWER, readiness
from app.settings import Settings
from app.web import explanation, login, pages
from app.web.errors import error_page

READY_KEPT_S = 1.0

DESCRIPTION = """Verdicts on valve stiction for every control loop of a plant, and which of them can be trusted.

Errors are `application/problem+json` (RFC 9457) with a stable `code`. Times are ISO 8601 in UTC. Pages have
`next_cursor`, which is null on the last one: stop there, as an empty `cursor` asks for the first page again."""


def create_app(settings: Settings, *, keys_required: bool | None = None) -> FastAPI:
    """The application on these settings; the backend is opened when the server starts, after any fork.

    `keys_required` None: as the settings say, and for every request that does not come in over loopback.
    """

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        begin(app, await run_in_threadpool(Backend.open, settings))
        yield
        await all_told(app.state.under_way)
        await run_in_threadpool(app.state.backend.close)

    app = FastAPI(
        title="loopaudit",
        version=version("loopaudit"),
        description=DESCRIPTION,
        docs_url=None,  # Swagger and ReDoc come from elsewhere, which a closed network does not reach
        redoc_url=None,
        redirect_slashes=False,
        lifespan=lifespan,
        dependencies=[Depends(no_zero_bytes)],
        generate_unique_id_function=operation_id,
    )
    app.state.rates = Rates(settings)
    app.state.under_way = set()
    app.state.error_page = error_page
    problems.install(app)
    # Called from the last to the first.
    app.add_middleware(CompressApi)
    app.add_middleware(Guard, of=app, settings=settings, keys_required=keys_required)
    app.add_middleware(LimitBodies, settings=settings)
    app.add_middleware(LimitCrowd, settings=settings)
    app.add_middleware(AnswerWhenStopped)
    app.add_middleware(WholeFiles)
    app.add_middleware(SecurityHeaders)
    app.add_middleware(KeepTagsEncoded)
    app.add_middleware(OneSlashLess)
    app.add_middleware(AnswerHead)
    app.add_middleware(RequestIds)
    app.include_router(api())
    app.include_router(operations.router)
    app.include_router(explanation.router)
    app.include_router(pages.router)
    app.include_router(login.router)
    app.mount("/static", pages.static)
    app.openapi = described(app)  # type: ignore[method-assign]  # as FastAPI says to extend it
    return app


def begin(app: FastAPI, backend: Backend) -> None:
    """What the routes share, made when the server starts."""
    app.state.backend = backend
    app.state.access = Authenticator(backend)
    app.state.one_by_one = asyncio.Lock()
    app.state.ready = Probe(partial(readiness, backend), READY_KEPT_S, late=NO_ANSWER)
    app.state.watched = WeakValueDictionary()
    app.state.spelled_tags = set()
    app.state.table_places = asyncio.Semaphore(PARTS_AT_ONCE)
    app.state.mapping_places = asyncio.Semaphore(MAPPINGS_AT_ONCE)


def operation_id(route: Any) -> str:
    """A name that a client generator can use: the method and the words of the path."""
    words = re.findall(r"\w+", route.path.replace(":path", ""))
    return "_".join([*sorted(method.lower() for method in route.methods), *words])
