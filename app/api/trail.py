"""Who did what: for administrators."""

from typing import Annotated, Any

from fastapi import APIRouter, Query

from app.api.models import TrailPage
from app.http.backend import Cursor, Limit, Services
from app.http.problems import responses
from app.services.access import trail as service
from app.services.access.identity import OF_ACTION, OF_WHO

router = APIRouter(tags=["trail"])

Who = Annotated[str | None, Query(max_length=200, description=OF_WHO)]
Action = Annotated[str | None, Query(max_length=100, description=OF_ACTION)]


@router.get("/trail", response_model=TrailPage, responses=responses(400, 422), summary="Who did what, newest first")
def trail(backend: Services, limit: Limit = 100, cursor: Cursor = None, who: Who = None, action: Action = None) -> Any:
    return service.list_trail(backend, limit, cursor, who=who, action=action)
