"""What of a column's name is the same however it is written."""

import re

from app.ingest.remembering import remembered
from app.ingest.tags.grouping import spelled_out


@remembered(1 << 17)
def plain(name: str) -> str:
    """Letters and digits of a name, in small letters without accents; empty where it has none outside of brackets."""
    return re.sub(r"[\W_]", "", re.sub(r"[\[(][^\[(\])]*[\])]", "", spelled_out(name.lower())))
