"""What the schema says of the routes."""

import json
import re

import pytest


def test_openapi_describes_every_field_and_parameter(client):
    schema = client.get("/openapi.json").json()
    models = schema["components"]["schemas"]
    bare = [
        f"{model}.{name}"
        for model, body in models.items()
        if "ValidationError" not in model
        for name, field in body.get("properties", {}).items()
        if not field.get("description")
    ]
    assert not bare
    for path, operations in schema["paths"].items():
        for method, operation in operations.items():
            assert operation.get("summary"), (method, path)
            assert not [p["name"] for p in operation.get("parameters", ()) if not p.get("description")], (method, path)


def test_openapi_says_that_errors_are_problems_and_refers_to_what_is_there(client):
    schema = client.get("/openapi.json").json()
    text = json.dumps(schema)
    assert "Problem" in schema["components"]["schemas"]
    for reference in re.findall(r'"#/components/schemas/([^"]+)"', text):
        assert reference in schema["components"]["schemas"]
    for path, operations in schema["paths"].items():
        for method, operation in operations.items():
            for status, answer in operation["responses"].items():
                if status.startswith("4"):
                    assert list(answer["content"]) == ["application/problem+json"], (method, path, status)
    operations = [o["operationId"] for methods in schema["paths"].values() for o in methods.values()]
    assert len(set(operations)) == len(operations)


def test_documentation_from_elsewhere_is_off(client):
    assert client.get("/docs").status_code == 404
    assert client.get("/redoc").status_code == 404


def test_the_schema_says_where_a_key_is_needed(client):
    paths = client.get("/openapi.json").json()["paths"]
    assert paths["/v1/loops"]["get"]["security"]
    assert {"401", "403", "429"} <= set(paths["/v1/loops/{tag}"]["patch"]["responses"])
    assert "security" not in paths["/healthz"]["get"]


def test_what_is_sent_only_where_it_has_changed_says_so(client):
    paths = client.get("/openapi.json").json()["paths"]
    told = {path for path, operations in paths.items() if "304" in operations.get("get", {}).get("responses", {})}
    assert told == {"/v1/reliability", "/v1/loops/{tag}", "/v1/loops/{tag}/health"}


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("POST", "/v1/audits"),
        ("PATCH", "/v1/loops/A"),
        ("POST", "/v1/loops/A/notes"),
        ("POST", "/v1/loops/A/explanations"),
    ],
)
def test_a_form_where_json_is_wanted_is_415(client, method, path):
    answer = client.request(method, path, data={"text": "x"})
    assert (answer.status_code, answer.json()["code"]) == (415, "media_type")
