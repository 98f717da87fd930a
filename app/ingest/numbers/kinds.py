"""Kinds of fields in columns of numbers, by what they tell of marks: those of all fields of a column are one number."""

import numpy as np
from numpy.typing import NDArray

from app.ingest.numbers.kind_codes import COMMA, DOUBTFUL_COMMA, DOUBTFUL_POINT, OTHER, POINT, WHOLE, WORD

DOUBTFUL = DOUBTFUL_POINT | DOUBTFUL_COMMA
SURE = {".": POINT, ",": COMMA}
WITH = {".": POINT | DOUBTFUL_POINT, ",": COMMA | DOUBTFUL_COMMA}
IN_DOUBT = POINT | COMMA | DOUBTFUL | OTHER


def kinds_of(lines: bytes, delimiter: str, width: int) -> NDArray[np.uint8] | None:
    """(width,) the kinds of each column's fields that are not empty. None where there are quotes or rows are longer."""
    if b'"' in lines:
        return None
    from app.ingest.numbers.kind_kernel import column_kinds

    kinds = np.zeros(width, dtype=np.uint8)
    return kinds if column_kinds(np.frombuffer(lines, np.uint8), ord(delimiter), kinds) else None


def decimal_mark_of(kinds: int) -> str:
    """The mark that stands before decimals in fields of these kinds, where some show it and none has another one;
    empty elsewhere."""
    shown = [mark for mark, sure in SURE.items() if kinds & sure and not kinds & ~(WITH[mark] | WHOLE | WORD)]
    return shown[0] if shown else ""


def tells_nothing(kinds: int, thousands: str) -> bool:
    """Whether nothing among fields of these kinds tells how they are written, beside what the file tells."""
    if thousands:
        return not kinds & (WITH[thousands] | OTHER)
    return bool(kinds & DOUBTFUL) and not kinds & ~(DOUBTFUL | WORD)
