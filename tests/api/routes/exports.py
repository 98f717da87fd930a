"""Exports that the tests of the routes send, and how."""

import csv
import io

TAGS = ["FIC101", "LIC7", "=AREA 1/<b>\"FIC' 1</b>?&#%2F"]
HOSTILE = TAGS[2]


def wide(*tags: str, samples: int = 400) -> bytes:
    """A wide export in which every loop swings, so that each can be audited."""
    text = io.StringIO()
    rows = csv.writer(text)
    rows.writerow(["DateTime", *(f"{tag}.{signal}" for tag in tags for signal in ("PV", "OP", "SP"))])
    for k in range(samples):
        minutes, seconds = divmod(k * 5, 60)
        swing = (k % 40) / 20 - 1
        stamp = f"2026-01-01T{minutes // 60:02d}:{minutes % 60:02d}:{seconds:02d}Z"
        rows.writerow([stamp, *(value for _ in tags for value in (50 + swing**2 + k % 3 * 0.1, 40 + 5 * swing, 50))])
    return text.getvalue().encode()


def sent(client, body: bytes, **params) -> dict:
    answer = client.post("/v1/uploads", content=body, params=params, headers={"Content-Type": "text/csv"})
    assert answer.status_code == 202, answer.text
    return answer.json()
