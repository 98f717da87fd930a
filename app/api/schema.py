"""OpenAPI as it is: every error is a problem, also those that the framework would describe otherwise."""

from collections.abc import Callable
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from app.http.permissions import ROUTES
from app.http.problems import MEDIA_TYPE, Problem, responses

PROBLEM = {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}
KEYS = {
    "bearer": {"type": "http", "scheme": "bearer", "description": "Authorization: Bearer la_..."},
    "header": {"type": "apiKey", "in": "header", "name": "X-API-Key"},
}
CLOSED = {(method, path.replace(":path", "")) for (method, path), permission in ROUTES.items() if permission.needs}
FRAMEWORKS = ("HTTPValidationError", "ValidationError")


def described(app: FastAPI) -> Callable[[], dict[str, Any]]:
    """The app's schema, made once."""

    def schema() -> dict[str, Any]:
        if not app.openapi_schema:
            made = get_openapi(title=app.title, version=app.version, description=app.description, routes=app.routes)
            app.openapi_schema = with_problems(with_keys(made))
        return app.openapi_schema

    return schema


def with_keys(schema: dict[str, Any]) -> dict[str, Any]:
    """Which operations ask for a key, and what is answered before a route is reached."""
    schema.setdefault("components", {})["securitySchemes"] = KEYS
    for path, operations in schema["paths"].items():
        for method, operation in operations.items():
            answers = operation["responses"]
            if (method.upper(), path) in CLOSED:
                operation["security"] = [{name: []} for name in KEYS]
                answers.update({str(status): told for status, told in responses(401, 403, 429).items()})
            if "requestBody" in operation:
                for status, told in responses(400, 408, 413).items():
                    answers.setdefault(str(status), told)
    return schema


def with_problems(schema: dict[str, Any]) -> dict[str, Any]:
    models = schema.setdefault("components", {}).setdefault("schemas", {})
    for name in FRAMEWORKS:
        models.pop(name, None)
    models["Problem"] = Problem.model_json_schema()
    for operations in schema["paths"].values():
        for operation in operations.values():
            for status, answer in operation["responses"].items():
                if status.startswith("4"):
                    answer["content"] = PROBLEM
    return schema
