"""Lists that a plant keeps in spreadsheets, of its tags or its loops: the bytes of a CSV into rows of named cells."""

import csv
import io
from typing import Any

from app.errors import DataError
from app.ingest.opening import detect_encoding

DELIMITERS = ",;\t"
BEYOND = "beyond the names"


def list_text(data: bytes, what: str, code: str) -> str:
    """Decoded as an export is. Raises DataError(code), which says `what` it was to be, where it is no text."""
    encoding = detect_encoding(data)
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        raise DataError(code, f"{what} is no text in {encoding}: {error.reason}") from error


def list_rows(text: str, what: str, code: str) -> list[dict[str, str]]:
    """Each row's cells by the names in the first one, both without blanks around, names in small letters; under
    `BEYOND` what a row has beyond them. Cells are parted by what the row of names has most of. Raises DataError(code)
    where it is no CSV.
    """
    first = text.split("\n", 1)[0]
    delimiter = max(DELIMITERS, key=first.count)
    try:
        return [_whole(row) for row in csv.DictReader(io.StringIO(text), restkey=BEYOND, delimiter=delimiter)]
    except csv.Error as error:
        raise DataError(code, f"{what} is not CSV: {error}") from error


def _whole(row: dict[Any, Any]) -> dict[str, str]:
    beyond = [cell for cell in row.pop(BEYOND, ()) if cell.strip()]
    return named_cells(row) | ({BEYOND: " ".join(beyond)} if beyond else {})


def named_cells(row: dict[Any, Any]) -> dict[str, str]:
    """What has a name and is there, as text."""
    told = {name: cell for name, cell in row.items() if name is not None and cell is not None}
    return {str(name).strip().lower(): str(cell).strip() for name, cell in told.items()}
