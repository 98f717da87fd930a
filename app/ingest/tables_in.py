"""Files that hold tables with types: parquet and workbooks."""

from pathlib import Path

from app.ingest.model import IngestOptions


def open_frames(path: Path, stem: str, options: IngestOptions) -> None:
    return None
