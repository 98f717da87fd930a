"""Writing a small file and reading it whole."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from app.ingest import FileSummary, IngestOptions, LoopSamples, Rejects, TagMapping, read_export


@dataclass(frozen=True)
class Content:
    """A file, read to its end."""

    loops: dict[str, LoopSamples]
    rejects: Rejects
    summary: FileSummary


Read = Callable[..., Content]


@pytest.fixture
def read(tmp_path: Path) -> Read:
    def read_it(
        data: str | bytes,
        name: str = "export.csv",
        mapping: TagMapping | None = None,
        options: IngestOptions | None = None,
    ) -> Content:
        path = tmp_path / "stored"
        path.write_bytes(data.encode() if isinstance(data, str) else data)
        export = read_export(path, filename=name, mapping=mapping, options=options)
        loops = list(export.loops())
        by_name = {samples.loop: samples for samples in loops}
        assert len(by_name) == len(loops), "a loop came twice"
        return Content(by_name, export.rejects(), export.summary())

    return read_it
