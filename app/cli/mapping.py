"""`--mapping FILE`: the tags of a plant whose names do not tell their loops."""

from pathlib import Path
from typing import Annotated

import typer

from app.errors import DataError

MappingOption = Annotated[
    Path | None,
    typer.Option(
        "--mapping",
        help="CSV or JSON that says which tag is which signal of which loop: columns tag, loop, signal (PV, OP, SP, "
        "MODE or OTHER) and, where known, unit, low, high, loop_type, area, description, owner. A tag that is not "
        "named in it is grouped by its name.",
    ),
]


def mapping_bytes(file: Path | None) -> bytes | None:
    """What the file holds, checked as the service checks it. Raises DataError("no_such_file" or "bad_mapping")."""
    if file is None:
        return None
    if not file.is_file():
        raise DataError("no_such_file", f"the mapping {file} is not there or not a file")
    from app.ingest import TagMapping  # with all that reads files: who sends one without a mapping waits for none of it

    data = file.read_bytes()
    TagMapping.from_bytes(data)
    return data
