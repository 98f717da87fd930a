"""A client of the HTTP API, for scripts and notebooks: it needs httpx alone, and knows nothing of the server's parts.

    with Client("http://plant-server:8000", key="la_read_...") as client:
        for row in client.reliability(verdict="stiction", reliability="reliable", sort="-priority"):
            print(row.loop, row.stiction_probability, row.reasons_text)

Each answer is a frozen dataclass of the fields that are used most; `raw` is all that was sent, so that a field which a
newer service adds is there too.
"""

from app.client.answers import Answer, Audit, Explanation, Group, Loop, LoopsChanged, Note, Row, Trend, Upload
from app.client.connection import Client, NoServiceError, ServiceError

__all__ = [
    "Answer",
    "Audit",
    "Client",
    "Explanation",
    "Group",
    "Loop",
    "LoopsChanged",
    "NoServiceError",
    "Note",
    "Row",
    "ServiceError",
    "Trend",
    "Upload",
]
