"""What is written as JSON for each loop of a night: short, and a fifth of the time that `json` takes."""

from typing import Any

import orjson


def short_json(value: Any) -> bytes:
    """Without spaces, in UTF-8. What is no number becomes null; numpy's numbers are numbers."""
    return orjson.dumps(value, option=orjson.OPT_SERIALIZE_NUMPY)
