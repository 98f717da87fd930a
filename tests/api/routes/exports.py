"""Exports that the tests of the routes send, and how."""

TAGS = ["FIC101", "LIC7", "=AREA 1/<b>\"FIC' 1</b>?&#%2F"]
HOSTILE = TAGS[2]


def sent(client, body: bytes, **params) -> dict:
    answer = client.post("/v1/uploads", content=body, params=params, headers={"Content-Type": "text/csv"})
    assert answer.status_code == 202, answer.text
    return answer.json()
