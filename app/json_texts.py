"""What is written as JSON for each loop of a night: short, and a fifth of the time that `json` takes; and what others
write as JSON.

Null says "not known", on purpose, by whoever measured (`number`, `numbers`): a NaN that became one would hide a fault.
"""

import json
from collections import Counter
from collections.abc import Sequence
from math import isfinite
from typing import Any

import numpy as np
import orjson

_WITHOUT_FRACTION = frozenset({str, int, bool, type(None)})


def short_json(value: Any) -> bytes:
    """Without spaces, in UTF-8; numpy's numbers are numbers. Raises ValueError where one is not finite."""
    text = stored_json(value)
    if b"null" in text:  # as which alone it could be written
        check_finite(value)
    return text


def stored_json(value: Any) -> bytes:
    """The same of what is stored already: an older release may have kept what is no number, and null stands for it."""
    return orjson.dumps(value, option=orjson.OPT_SERIALIZE_NUMPY)


def read_json(text: str | bytes) -> Any:
    """Of what is stored, too."""
    try:
        return orjson.loads(text)
    except ValueError:  # an older release may have kept what is no number
        return json.loads(text)


class DoubledNameError(ValueError):
    """An object of a JSON text gives one name several values; `name` is it, as it can be told, `times` how often it is
    given."""

    def __init__(self, name: str, times: int) -> None:
        self.name = name[:60].encode(errors="backslashreplace").decode()  # half of a letter may stand there
        self.times = times
        super().__init__(f"{self.name!r} is given {times} times and takes one value")


def given_json(text: str | bytes) -> Any:
    """Of what people and programs send. Raises DoubledNameError where a name is given twice in one object: the first
    value would be passed over in silence; ValueError or RecursionError where it is no JSON."""
    return json.loads(text, object_pairs_hook=_once_each)


def _once_each(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise DoubledNameError(*Counter(name for name, _ in pairs).most_common(1)[0])
    return found


def check_finite(value: Any, name: str = "") -> None:
    """Raises ValueError where a number is not finite, with its place: `.spectra.pv[]`."""
    if isinstance(value, dict):
        for key, part in value.items():
            kind = type(part)  # asked here: of a verdict's thousand parts most are plain, and a call each is dear
            if kind not in _WITHOUT_FRACTION and (kind is not float or not isfinite(part)):
                check_finite(part, f"{name}.{key}")
    elif isinstance(value, (list, tuple)) and not _sums_up(value):
        for part in value:
            check_finite(part, f"{name}[]")
    elif isinstance(value, (float, np.floating, np.ndarray)) and not np.isfinite(value).all():
        raise ValueError(f"{name or 'value'} is {value}, no number that could be stored")


def _sums_up(values: Sequence[Any]) -> bool:
    """Whether they are numbers, or unknown, and none is without end: long lists of them are most of a verdict."""
    try:
        return isfinite(sum(filter(None, values)))
    except (TypeError, ValueError, OverflowError):  # texts, tables, arrays; each is then looked at for itself
        return False
